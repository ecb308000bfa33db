"""Divides the samples of records into cells of the motion: places of the axis, each by how it moves there.

What a drive lacks (weights of further links, ripple, the curve of friction) follows place and speed.  So it comes back
wherever the axis comes by again in the same way, and a thousand samples of one cell tell little more than a few.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.drive.structure import Output

_PLACES, _SPEEDS = 5, 4
"""Parts of the range of the angle, and of the range of the speed in each of them; equally many samples in all"""
_BEFORE = 4
"""The speed from an angle is since so many samples before, as an angle has a resolution."""


class PredictedMotion(NamedTuple):
    """The motion of a record as predicted from the samples before: a measured one has the error of its own sample."""

    t: Floats
    """(N,) s"""
    y: Floats
    """(N,) angle [rad] or speed [rad/s]; NaN: not known"""
    quantity: Output
    counted: Bools
    """(N,) the samples that are divided equally; the others are in the nearest cells"""


def motion_cells(motions: Sequence[PredictedMotion]) -> list[Ints]:
    """The cell of each sample (N,), from 0 on, of each record of an axis.

    Of records of the speed the place is the angle from the first sample on.
    """
    angle, speed = (np.concatenate(values) for values in zip(*map(_angle_and_speed, motions), strict=True))
    used = np.concatenate([motion.counted for motion in motions])
    place = _part_of(angle, used, _PLACES)
    cell = np.zeros(len(place), np.int64)
    for k in np.unique(place).tolist():
        own = place == k
        cell[own] = k * _SPEEDS + _part_of(speed[own], used[own], _SPEEDS)
    return np.split(cell, np.cumsum([len(motion.t) for motion in motions])[:-1])


def _part_of(values: Floats, used: Bools, count: int) -> Ints:
    """In which of so many parts (N,) a value is, each of which has as many of the used values as the others."""
    if not used.any():
        return np.zeros(len(values), np.int64)
    limits = np.quantile(values[used], np.arange(1, count) / count)
    return np.asarray(np.searchsorted(limits, values), np.int64)


def _angle_and_speed(motion: PredictedMotion) -> tuple[Floats, Floats]:
    """Angle and speed (N,); straight between the samples that are known."""
    known = np.isfinite(motion.y)
    y = np.interp(motion.t, motion.t[known], motion.y[known])
    if motion.quantity == "speed":
        return np.concatenate([[0.0], np.cumsum(y[:-1] * np.diff(motion.t))]), y
    now = np.arange(len(y))
    before = np.maximum(now - _BEFORE, 0)
    now[0] = 1  # the first speed is that of the first interval
    return y, (y[now] - y[before]) / (motion.t[now] - motion.t[before])
