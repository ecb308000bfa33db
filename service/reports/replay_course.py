"""The course of one axis over a record of any length, in bounded memory: least and largest values in short bins.

Nothing that crosses a line between two bins' ends is lost.  When the bins are full, two of them become one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection import Crossing, HypothesisBank
from monitor_core.monitoring import (
    DOUBTED,
    GATED,
    IDLE,
    RESTART,
    SEED,
    SETTLE,
    SKIP,
    TRACK,
    UNSEEN,
    AxisMonitor,
    BankTrace,
    Trace,
    standard_deviation,
)

MOST_BINS = 1600
SIGMAS = 2.0
"""Half the width of the band around an estimate, in reported standard deviations."""
FATES = (RESTART, SETTLE, SEED, GATED, IDLE, DOUBTED, TRACK)
ESTIMATE, BELOW, NOMINAL, TOLERATED_BELOW, ABOVE, TOLERATED_ABOVE, UP, DOWN = range(8)
"""Rows of ``Course.low`` and ``Course.high``: theta, ends of its band, theta_0(s), theta_0(s) -+ nu, g of both
directions."""
_ROWS = 8


class Course:
    """What the recursion of one axis did, bin by bin."""

    def __init__(self, monitor: AxisMonitor, most: int = MOST_BINS) -> None:
        self._most, self._monitor = most - most % 2, monitor
        self._names = monitor.model.monitored
        p = len(self._names)
        self.h: Floats = monitor.batch.thresholds[:, monitor.lane].copy()
        """Thresholds (p,)"""
        self.beside: BankCourse | None = None
        """Of the multi-model detector; None: there is none, or it has taken no sample"""
        self.timeline = Timeline()
        self._width = max(1, round(monitor.settings.interval_s * 1e6))
        self._extremes = Extremes(_ROWS, p, self._most)
        self._sum = np.zeros((p, self._most))
        self._fates = np.zeros((len(FATES), self._most), np.int64)
        self._unseen = np.zeros((p, self._most), np.int64)
        self._gaps = np.zeros(self._most, np.bool_)

    # --- while it runs ---------------------------------------------------------------------------------

    def take(
        self, t_us: Times, trace: Trace, crossings: Iterable[Crossing], beside: BankTrace | None = None
    ) -> None:
        """Samples of the axis (N,), crossings of h, and the traces of the recursion and of the multi-model detector."""
        took = trace.mode != SKIP
        if not took.any():
            return
        before, fresh = self.timeline.end_us, self.timeline.start_us is None
        t, does = t_us[took], trace.mode[took]
        where = self.timeline.take(t)
        while where[-1] // self._width >= self._most:
            self._merge()
        bins = where // self._width
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        self._extremes.take(bins[starts], starts, self._rows(trace, took))
        if beside is not None:
            self._of_the_bank().take(bins[starts], starts, beside.g[took])
        self._sum[:, bins[starts]] += np.add.reduceat(trace.theta[took].T, starts, axis=1)
        fates = np.stack([does == fate for fate in FATES])
        self._fates[:, bins[starts]] += np.add.reduceat(fates, starts, axis=1, dtype=np.int64)
        unseen = trace.observed[took].T == UNSEEN
        self._unseen[:, bins[starts]] += np.add.reduceat(unseen, starts, axis=1, dtype=np.int64)
        since = np.concatenate(([before], where[:-1])) // self._width
        for k in np.flatnonzero(does == RESTART)[fresh:].tolist():
            self._gaps[since[k] : bins[k] + 1] = True
        for crossing in crossings:  # at that very sample g has started again
            row, i = UP if crossing.direction == "up" else DOWN, self._names.index(crossing.parameter)
            self._extremes.raise_to(self.h[i], row, i, bins[int(np.argmax(t == crossing.time_us))])

    def _rows(self, trace: Trace, took: NDArray[np.bool_]) -> Floats:
        """All that is followed (rows, p, N), in the order of the rows."""
        theta, P, g = trace.theta[took], trace.P[took], trace.g[took]
        model, settings = self._monitor.model, self._monitor.settings
        alpha1, _, allowance = settings.tests(len(self._names))
        nominal = model.theta0 + trace.shift[took]
        band = SIGMAS * standard_deviation(settings, 1.0) * np.sqrt(P)
        nu = alpha1 * np.sqrt(settings.lam0 * P) + allowance * model.scale
        rows = (theta, theta - band, nominal, nominal - nu, theta + band, nominal + nu, g[:, 0], g[:, 1])
        return np.stack([row.T for row in rows])

    def _of_the_bank(self) -> BankCourse:
        """Made with the first samples: by then there is a multi-model detector."""
        if self.beside is None:
            assert self._monitor.multimodel is not None
            self.beside = BankCourse(self._monitor.multimodel.bank, self._names, self._most)
        return self.beside

    def _merge(self) -> None:
        """Two bins become one, twice as wide."""
        self._width *= 2
        self._extremes.merge()
        self._sum = joined(self._sum, np.add, 0)
        self._fates, self._unseen = (joined(c, np.add, 0) for c in (self._fates, self._unseen))
        self._gaps = joined(self._gaps, np.logical_or, 0)
        if self.beside is not None:
            self.beside.merge()

    # --- afterwards ------------------------------------------------------------------------------------

    @property
    def used(self) -> int:
        """Bins up to the last sample."""
        return 0 if self.timeline.start_us is None else self.timeline.end_us // self._width + 1

    @property
    def middles(self) -> Floats:
        """Of the bins [s], since the first sample."""
        return (np.arange(self.used, dtype=float) + 0.5) * (1e-6 * self._width)

    @property
    def edges(self) -> Floats:
        """Of the bins [s]: one more than there are bins."""
        return np.arange(self.used + 1, dtype=float) * (1e-6 * self._width)

    def low(self, row: int, i: int) -> Floats:
        """The least values in each bin; NaN: none."""
        return self._extremes.low(self.used, row, i)

    def high(self, row: int, i: int) -> Floats:
        """The largest values in each bin; NaN: none."""
        return self._extremes.high(self.used, row, i)

    def mean(self, i: int) -> Floats:
        """Of the estimates in each bin; NaN: none."""
        count = self._fates[:, : self.used].sum(axis=0)
        mean: Floats = self._sum[i, : self.used] / np.maximum(count, 1)
        mean[count == 0] = np.nan
        return mean

    def largest_g(self, i: int) -> float:
        """Of both directions; h where it was crossed and g started again."""
        values = np.concatenate([self.high(UP, i), self.high(DOWN, i)])
        return float(np.nanmax(values, initial=0.0))

    def fate(self, fate: int) -> Counts:
        """How many samples of each bin had that fate, one of FATES."""
        return self._fates[FATES.index(fate), : self.used]

    def unseen(self, i: int) -> Counts:
        """At how many samples of each bin a parameter was not observed."""
        return self._unseen[i, : self.used]

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """Which bins have a part without samples after which the predictor restarted."""
        return self._gaps[: self.used]


# --- The multi-model detector: the least and the largest g / h of each cause, bin by bin -----------------------------


EITHER = 0
"""The way of a change that has none."""


class Group(NamedTuple):
    """Hypotheses that are drawn as one line: those of a cause, of a parameter those of an increase or of a decrease."""

    cause: str
    way: int
    """1 up, -1 down, 0 either"""


class BankCourse:
    """At each sample the largest g / h of each group counts: an alarm is raised where one of them crosses 1.

    Args:
        bank: of the axis.
        parameters: monitored; their increases and decreases are groups of their own.
        most: bins.
    """

    def __init__(self, bank: HypothesisBank, parameters: Sequence[str], most: int) -> None:
        self._h, self._most = bank.h, most
        groups = [_group(hypothesis.cause, hypothesis.size, parameters) for hypothesis in bank.hypotheses]
        self.groups: tuple[Group, ...] = tuple(dict.fromkeys(groups))
        """What is drawn as one line each"""
        self._members = [np.flatnonzero([group_of == group for group_of in groups]) for group in self.groups]
        self._extremes = Extremes(len(self.groups), most)

    def take(self, bins: Counts, starts: Counts, g: Floats) -> None:
        """Take g (N, H) of samples; those from ``starts[k]`` on are of ``bins[k]``."""
        share = g / self._h
        largest = np.stack([share[:, members].max(axis=1) for members in self._members])
        self._extremes.take(bins, starts, largest)

    def merge(self) -> None:
        """Two bins become one, twice as wide."""
        self._extremes.merge()

    def low(self, group: Group, used: int) -> Floats:
        """The least values in the first bins; NaN: none."""
        return self._extremes.low(used, self.groups.index(group))

    def high(self, group: Group, used: int) -> Floats:
        """The largest values in the first bins; NaN: none."""
        return self._extremes.high(used, self.groups.index(group))

    def largest(self, cause: str) -> float:
        """g / h of a cause, of all samples."""
        values = [
            self._extremes.high(self._most, k) for k, own in enumerate(self.groups) if own.cause == cause
        ]
        return float(np.nanmax(values, initial=0.0))


def _group(cause: str, size: float, parameters: Sequence[str]) -> Group:
    return Group(cause, (1 if size > 0 else -1) if cause in parameters else EITHER)


# --- Times on a line that always goes on: pauses are cut out, and clocks that were set back go on ---------------------


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
