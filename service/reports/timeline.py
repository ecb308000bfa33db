"""Times on a line that always goes on: pauses are cut out, and clocks that were set back go on."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Ints

PAUSE_S = 60.0
"""A longer time without samples is cut out, so that the samples before and after it stay visible."""

_MOST_STRETCHES = 4096


class Stretch(NamedTuple):
    """Samples without a pause: times of the first and the last, position of the first one on the time line [us]."""

    first: int
    last: int
    at: int
    pause_s: float
    """Pause before the stretch; negative: the clock went back"""


class Timeline:
    """The time line of one axis, which starts at 0. The last 4096 stretches are kept."""

    def __init__(self) -> None:
        self._stretches: deque[Stretch] = deque(maxlen=_MOST_STRETCHES)
        self.start_us: int | None = None
        """Time of the first sample"""
        self.end_us = 0
        """Position of the last sample on the time line"""
        self.pauses = 0

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """All stretches that are kept, in order."""
        return tuple(self._stretches)

    def take(self, t_us: Ints) -> Ints:
        """Positions of samples on the time line (N,) [us], in the order of their receipt; never decreasing."""
        if not t_us.size:
            return t_us
        before = self._stretches[-1].last if self._stretches else int(t_us[0])
        steps = np.diff(t_us, prepend=before)
        cut = (steps < 0) | (steps > PAUSE_S * 1e6)
        where = self.end_us + np.cumsum(np.where(cut, 0, steps))
        if self.start_us is None:
            self.start_us = int(t_us[0])
            self._stretches.append(Stretch(self.start_us, self.start_us, 0, 0.0))
        cuts = [*np.flatnonzero(cut).tolist(), t_us.size]
        self.pauses += len(cuts) - 1
        if cuts[0] > 0:
            self._stretches[-1] = self._stretches[-1]._replace(last=int(t_us[cuts[0] - 1]))
        for first, end in pairwise(cuts):
            times = int(t_us[first]), int(t_us[end - 1])
            self._stretches.append(Stretch(*times, int(where[first]), 1e-6 * int(steps[first])))
        self.end_us = int(where[-1])
        return where

    def find(self, t_us: int | None) -> float | None:
        """Latest position of a time on the time line [s]; None: not on it."""
        if t_us is None:
            return None
        for stretch in reversed(self._stretches):
            if stretch.first <= t_us <= stretch.last:
                return 1e-6 * (stretch.at + t_us - stretch.first)
        return None


class TimeUnit(NamedTuple):
    """Unit in which times of a record are written."""

    name: str
    seconds: float

    def written(self, s: float) -> str:
        """A time to at least four digits, such as 5.21 s."""
        value = s / self.seconds
        return f"{value:.{2 if value < 1000 else 0}f} {self.name}"


def time_unit(length_s: float) -> TimeUnit:
    """The unit for a record of this length."""
    for name, seconds, most in (("s", 1.0, 600.0), ("min", 60.0, 4 * 3600.0), ("h", 3600.0, 4 * 86400.0)):
        if length_s <= most:
            return TimeUnit(name, seconds)
    return TimeUnit("d", 86400.0)
