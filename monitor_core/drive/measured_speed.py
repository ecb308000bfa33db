"""Speed of an axis at its sensor, from sample to sample; blocks may be split anywhere."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output


class MeasuredSteps(NamedTuple):
    """Steps to samples (N,), each from the last sample before it whose output was measured."""

    interval_us: NDArray[np.int64]
    """Time since that sample; 0: there is none, or this sample was not measured; negative: the clock went back"""
    speed: Floats
    """Magnitude of the speed [rad/s] (for a measured angle the mean over the interval); NaN: unknown"""
    distance: Floats
    """Magnitude of the change of a measured angle [rad]; 0 for a measured speed, or if unknown"""


class MeasuredSpeed:
    """Computes the steps of one axis with this output, block by block."""

    def __init__(self, output: Output) -> None:
        self._angle = output == "angle"
        self.before: tuple[int, float] | None = None
        """Time [us] and output of the last measured sample; None: there is none yet"""

    def take(self, t_us: NDArray[np.int64], y: Floats) -> MeasuredSteps:
        """The steps to samples with times ``t_us`` (N,) and outputs ``y`` (N,); NaN: not measured."""
        N, measured = len(t_us), np.flatnonzero(np.isfinite(y))
        interval, speed, distance = np.zeros(N, np.int64), np.full(N, math.nan), np.zeros(N)
        if not self._angle:
            speed = np.abs(y)
        if not measured.size:
            return MeasuredSteps(interval, speed, distance)
        t, q = t_us[measured], y[measured]
        first = (int(t[0]), float(q[0])) if self.before is None else self.before
        h = np.diff(t, prepend=np.int64(first[0]))
        interval[measured] = h
        if self._angle:
            moved = np.abs(np.diff(q, prepend=first[1]))
            distance[measured] = moved
            with np.errstate(divide="ignore", invalid="ignore"):
                speed[measured] = np.where(h > 0, moved / h * 1e6, math.nan)
        self.before = int(t[-1]), float(q[-1])
        return MeasuredSteps(interval, speed, distance)
