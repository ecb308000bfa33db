"""Times of samples on a line that always goes on: pauses are cut out, and clocks that were set back go on."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

Times = NDArray[np.int64]
PAUSE_S = 60.0
"""A longer time without samples is cut out, so that what is before and after it can be seen."""
_MOST_STRETCHES = 4096


class Stretch(NamedTuple):
    """Samples without a pause: times of the first and the last [us], and where the first one is on the line [us]."""

    first: int
    last: int
    at: int
    pause_s: float
    """Before it; negative: the clock went back"""


class Timeline:
    """The line of one axis, from 0 on.  The last 4096 stretches are known."""

    def __init__(self) -> None:
        self._stretches: deque[Stretch] = deque(maxlen=_MOST_STRETCHES)
        self.start_us: int | None = None
        """Time of the first sample"""
        self.end_us = 0
        """Where the last sample is on the line"""
        self.pauses = 0

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """All that are known, in their order."""
        return tuple(self._stretches)

    def take(self, t_us: Times) -> Times:
        """Where samples, in the order of their receipt, are on the line (N,) [us]; it never goes back."""
        if not t_us.size:
            return t_us
        before = self._stretches[-1].last if self._stretches else int(t_us[0])
        steps = np.diff(t_us, prepend=before)
        cut = (steps < 0) | (steps > PAUSE_S * 1e6)
        where = self.end_us + np.cumsum(np.where(cut, 0, steps))
        edges = np.concatenate(([0], np.flatnonzero(cut), [t_us.size]))
        for first, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            if first < end:
                self._go_on(t_us, where, first, end - 1, steps, bool(cut[first]))
        self.end_us = int(where[-1])
        return where

    def _go_on(self, t_us: Times, where: Times, first: int, last: int, steps: Times, new: bool) -> None:
        if self._stretches and not new:
            self._stretches[-1] = self._stretches[-1]._replace(last=int(t_us[last]))
            return
        self.pauses += bool(self._stretches)
        self.start_us = int(t_us[first]) if self.start_us is None else self.start_us
        stretch = int(t_us[first]), int(t_us[last]), int(where[first]), 1e-6 * int(steps[first])
        self._stretches.append(Stretch(*stretch))

    def find(self, t_us: int | None) -> float | None:
        """Where on the line a time is [s], the latest place where it is; None: nowhere."""
        if t_us is None:
            return None
        for _stretch in reversed(self._stretches):
            if _stretch.first <= t_us <= _stretch.last:
                return 1e-6 * (_stretch.at + t_us - _stretch.first)
        return None


# --- Short stretches of a record, of which the least and the largest values are kept ----------------------------------


Counts = NDArray[np.int64]
_T = TypeVar("_T", bound=np.generic)


class Extremes:
    """The least and the largest values of signals (*shape) in each of so many bins."""

    def __init__(self, *shape: int) -> None:
        self._low, self._high = np.full(shape, np.inf), np.full(shape, -np.inf)

    def take(self, bins: Counts, starts: Counts, values: Floats) -> None:
        """Take values (.., N); those from ``starts[k]`` on are of ``bins[k]``."""
        for which, least in ((self._low, np.minimum), (self._high, np.maximum)):
            which[..., bins] = least(which[..., bins], least.reduceat(values, starts, axis=-1))

    def merge(self) -> None:
        """Two bins become one, twice as wide."""
        self._low, self._high = joined(self._low, np.minimum, np.inf), joined(self._high, np.maximum, -np.inf)

    def raise_to(self, value: float, *place: int) -> None:
        """The largest value at a place is at least that."""
        self._high[place] = max(self._high[place], value)

    def low(self, used: int, *signal: int) -> Floats:
        """The least values of a signal in the first bins; NaN: none."""
        return _known(self._low[signal][:used])

    def high(self, used: int, *signal: int) -> Floats:
        """The largest values of a signal in the first bins; NaN: none."""
        return _known(self._high[signal][:used])


def _known(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.nan)


def zigzag(t: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """A line through the least and the largest value of each bin, at its time; down one, up the next."""
    both = np.stack([low, high], axis=1)
    both[1::2] = both[1::2, ::-1]
    return np.repeat(t, 2), both.ravel()


def joined(values: NDArray[_T], join: np.ufunc, empty: float) -> NDArray[_T]:
    """Neighbours along the last axis joined in its first half, the second one empty."""
    half = values.shape[-1] // 2
    out = np.full_like(values, empty)
    out[..., :half] = join(values[..., : 2 * half : 2], values[..., 1 : 2 * half : 2])
    return out
