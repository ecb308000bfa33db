"""The course of one axis over a record of any length, in bounded memory: least and largest values in short bins.

Extremes within a bin are not lost.  When the bins are full, pairs of them are joined.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.detection import Crossing
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
from service.reports.timeline import Timeline

MOST_BINS = 1600
SIGMAS = 2.0
"""Half the width of the band around an estimate, in reported standard deviations."""
FATES = (RESTART, SETTLE, SEED, GATED, IDLE, DOUBTED, TRACK)
ESTIMATE, BELOW, NOMINAL, TOLERATED_BELOW, ABOVE, TOLERATED_ABOVE, UP, DOWN = range(8)
"""Signals of each parameter: theta, ends of its band, theta_0(s), theta_0(s) -+ nu, g of both directions."""
EVIDENCE = 8
"""Signal of each cause that the multi-model detector knows: the largest g / h of its sizes."""


class ReplayCourse:
    """The course of the recursion of one axis, bin by bin.

    Signals are named by their kind, such as UP, and their parameter or cause.
    """

    def __init__(self, monitor: AxisMonitor, most: int = MOST_BINS) -> None:
        self._monitor, self._most = monitor, most - most % 2
        names = monitor.model.monitored
        self.h: dict[str, float] = dict(zip(names, monitor.batch.thresholds[:, monitor.lane].tolist(), strict=True))
        """Threshold of each parameter"""
        self.causes = () if monitor.multimodel is None else monitor.multimodel.causes
        """Those that the multi-model detector knows; empty: there is no such detector"""
        self.timeline = Timeline()
        self._width = max(1, round(monitor.settings.interval_s * 1e6))
        kinds = [
            *((kind, name) for kind in range(EVIDENCE) for name in names),
            *((EVIDENCE, c) for c in self.causes),
        ]
        self._rows = {signal: row for row, signal in enumerate(kinds)}
        self._low = Bins(np.minimum, np.full((len(kinds), self._most), np.inf))
        self._high = Bins(np.maximum, np.full((len(kinds), self._most), -np.inf))
        self._sums = Bins(np.add, np.zeros((len(names), self._most)))
        self._fates = Bins(np.add, np.zeros((len(FATES), self._most), np.int64))
        self._unseen = Bins(np.add, np.zeros((len(names), self._most), np.int64))
        self._tested = Bins(np.logical_or, np.zeros((len(names), self._most), np.bool_))
        self._gaps = Bins(np.logical_or, np.zeros((1, self._most), np.bool_))

    # --- while it runs ---------------------------------------------------------------------------------

    def take(
        self, t_us: Ints, trace: Trace, crossings: Iterable[Crossing], multimodel: BankTrace | None = None
    ) -> None:
        """Add samples of the axis (N,), crossings of h, and traces of the recursion and of the multi-model detector."""
        took = trace.mode != SKIP
        if not took.any():
            return
        before, fresh = self.timeline.end_us, self.timeline.start_us is None
        t, mode = t_us[took], trace.mode[took]
        where = self.timeline.take(t)
        while where[-1] // self._width >= self._most:
            self._merge()
        bins = where // self._width
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        signals = self._signals(trace, took)
        if multimodel is not None:
            signals = np.concatenate([signals, self._evidence(multimodel.g[took])])
        for kept, values in (
            (self._low, signals),
            (self._high, signals),
            (self._sums, trace.theta[took].T),
            (self._fates, np.stack([mode == fate for fate in FATES]).astype(np.int64)),
            (self._unseen, (trace.observed[took].T == UNSEEN).astype(np.int64)),
            (self._tested, self._tests(trace, multimodel)[:, took]),
        ):
            kept.take(bins[starts], starts, values)
        since = np.concatenate(([before], where[:-1])) // self._width
        for k in np.flatnonzero(mode == RESTART)[fresh:].tolist():
            self._gaps.values[0, since[k] : bins[k] + 1] = True
        for crossing in crossings:  # at that very sample g has started again
            row = self._rows[UP if crossing.direction == "up" else DOWN, crossing.parameter]
            place = row, bins[int(np.argmax(t == crossing.time_us))]
            self._high.values[place] = max(self._high.values[place], self.h[crossing.parameter])

    def _signals(self, trace: Trace, took: Bools) -> Floats:
        """All signals of the parameters (kinds * p, N), in the order of the kinds."""
        theta, P, g = trace.theta[took], trace.P[took], trace.g[took]
        model, settings = self._monitor.model, self._monitor.settings
        alpha1, _, allowance = settings.tests(len(self.h))
        nominal = model.theta0 + trace.shift[took]
        band = SIGMAS * standard_deviation(settings, 1.0) * np.sqrt(P)
        nu = alpha1 * np.sqrt(settings.lam0 * P) + allowance * model.scale
        kinds = (theta, theta - band, nominal, nominal - nu, theta + band, nominal + nu, g[:, 0], g[:, 1])
        return np.concatenate(kinds, axis=1).T

    def _evidence(self, g: Floats) -> Floats:
        """The largest g / h of each cause (causes, N), from those of its hypotheses (N, H)."""
        h, members = self._hypotheses
        return np.stack([(g[:, own] / h[own]).max(axis=1, initial=0.0) for own in members])

    def _tests(self, trace: Trace, multimodel: BankTrace | None) -> Bools:
        """Mask of the samples at which the alarming detector tested a parameter (p, N)."""
        if self._monitor.alarm_source == "multimodel" and multimodel is not None:
            assert self._monitor.multimodel is not None
            causes, ran = self._monitor.multimodel.bank.causes, ~np.isnan(multimodel.llr).all(axis=1)
            return np.stack([ran & (name in causes) for name in self.h])
        tests: Bools = (trace.mode == TRACK) & (trace.observed.T != UNSEEN)
        return tests

    @cached_property
    def _hypotheses(self) -> tuple[Floats, list[Ints]]:
        """Thresholds of the hypotheses, and the hypotheses of each cause; the detector exists only with samples."""
        assert self._monitor.multimodel is not None
        bank = self._monitor.multimodel.bank
        causes = [hypothesis.cause for hypothesis in bank.hypotheses]
        return bank.h, [np.flatnonzero([cause == name for cause in causes]) for name in self.causes]

    def _merge(self) -> None:
        """Join pairs of bins to bins of double width."""
        self._width *= 2
        for kept in (self._low, self._high, self._sums, self._fates, self._unseen, self._tested, self._gaps):
            kept.merge()

    # --- afterwards ------------------------------------------------------------------------------------

    @property
    def used(self) -> int:
        """Number of bins up to the last sample."""
        return 0 if self.timeline.start_us is None else self.timeline.end_us // self._width + 1

    @property
    def edges(self) -> Floats:
        """Edges of the bins [s] since the first sample: one more than there are bins."""
        return np.arange(self.used + 1, dtype=float) * (1e-6 * self._width)

    def low(self, kind: int, name: str) -> Floats:
        """The smallest values of a signal in each bin; NaN: none."""
        return self._known(self._low, kind, name)

    def high(self, kind: int, name: str) -> Floats:
        """The largest values of a signal in each bin; NaN: none."""
        return self._known(self._high, kind, name)

    def _known(self, bins: Bins, kind: int, name: str) -> Floats:
        values = bins.values[self._rows[kind, name], : self.used]
        return np.where(np.isfinite(values), values, np.nan)

    def mean(self, name: str) -> Floats:
        """Mean of the estimates in each bin; NaN: none."""
        count = self._fates.values[:, : self.used].sum(axis=0)
        mean: Floats = self._sums.values[list(self.h).index(name), : self.used] / np.maximum(count, 1)
        mean[count == 0] = np.nan
        return mean

    def largest(self, *kinds: int, name: str) -> float:
        """The largest value of these signals; g counts as h where it was crossed and g started again."""
        values = np.concatenate([self.high(kind, name) for kind in kinds])
        return float(np.nanmax(values, initial=0.0))

    def fate(self, fate: int) -> Ints:
        """Number of samples of each bin with this fate, one of FATES."""
        return self._fates.values[FATES.index(fate), : self.used]

    def unseen(self, name: str) -> Ints:
        """Number of samples of each bin at which a parameter was not observed."""
        return self._unseen.values[list(self.h).index(name), : self.used]

    def tested(self, name: str) -> Bools:
        """Mask of the bins in which the alarming detector tested a parameter."""
        return self._tested.values[list(self.h).index(name), : self.used]

    @property
    def gaps(self) -> Bools:
        """Mask of the bins with a gap without samples after which the predictor restarted."""
        return self._gaps.values[0, : self.used]


class Bins:
    """Values of signals (rows, bins); the samples of a bin are combined by a function such as the minimum."""

    def __init__(self, join: np.ufunc, empty: NDArray[Any]) -> None:
        self._join, self._empty, self.values = join, empty[..., :1].copy(), empty

    def take(self, bins: Ints, starts: Ints, values: NDArray[Any]) -> None:
        """Add values (rows, N); those from ``starts[k]`` on belong to ``bins[k]``."""
        self.values[:, bins] = self._join(self.values[:, bins], self._join.reduceat(values, starts, axis=1))

    def merge(self) -> None:
        """Combine neighbours into the first half of the bins; the second half becomes empty."""
        joined = self._join(self.values[:, ::2], self.values[:, 1::2])
        self.values = np.concatenate([joined, np.repeat(self._empty, joined.shape[1], axis=1)], axis=1)


_NARROWEST = 0.003
"""Smallest visible share of the whole length; shorter spans are drawn with this width."""


def runs_of(where: Bools, edges: Floats) -> Iterator[tuple[float, float]]:
    """Start and width of each run of marked bins (N,) with these edges (N + 1,)."""
    steps = np.diff(np.concatenate(([0], where.astype(np.int8), [0])))
    for start, end in zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True):
        yield float(edges[start]), max(float(edges[end] - edges[start]), _NARROWEST * float(edges[-1]))
