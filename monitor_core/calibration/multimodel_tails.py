"""The tail of g of each hypothesis of a bank: its highest excursions on copies of records, and what lies beyond.

The excursions are found piece by piece along g, over all copies of the records; only a limited number is kept.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.kernel.excursions import ORIGIN, PEAK, PLACE, START, excursion_peaks

TOP = 500
"""Number of highest excursions that are used: lower ones have another distribution than the tail."""
LEAST_HEIGHT = 2.0
"""Lower excursions are left out: they say nothing about the tail."""


class ExcursionPeaks:
    """Peaks of the excursions of g of all hypotheses, collected piece by piece over copies of records."""

    def __init__(self, many: int) -> None:
        self._least = np.full(many, LEAST_HEIGHT)
        self._largest: list[Floats] = [np.empty(0) for _ in range(many)]
        self._times: list[Ints] = [np.empty((4, 0), np.int64) for _ in range(many)]
        self._top, self._now = np.zeros(many), np.zeros((4, many), np.int64)
        self.largest = np.zeros(many)
        self.samples = 0
        """Tested ones."""

    def course(self) -> tuple[Floats, Ints]:
        """State of a new course of g, to be given to ``take`` with each of its pieces."""
        return np.zeros_like(self._top), np.zeros_like(self._now)

    def take(self, g: Floats, clock: int, place: Ints, origin: Ints, going_on: tuple[Floats, Ints]) -> None:
        """Add g (N, H) from time ``clock`` [samples] on, with the blocks of its motion and innovations (N,)."""
        N, many = g.shape
        self.largest = np.maximum(self.largest, g.max(axis=0, initial=0.0))
        largest, times = np.empty((many, N // 2 + 1)), np.empty((4, many, N // 2 + 1), np.int64)
        found = np.zeros(many, np.int64)
        g = np.ascontiguousarray(g)
        excursion_peaks(g, clock, place, origin, self._least, *going_on, largest, times, found)
        for i in np.flatnonzero(found):
            self._keep(int(i), largest[i, : found[i]], times[:, i, : found[i]])

    def _keep(self, i: int, largest: Floats, times: Ints) -> None:
        self._largest[i] = np.append(self._largest[i], largest)
        self._times[i] = np.concatenate([self._times[i], times], axis=1)
        if len(self._largest[i]) > 2 * TOP:
            order = np.argsort(self._largest[i])[: -TOP - 2 : -1]
            self._largest[i], self._times[i] = self._largest[i][order], self._times[i][:, order]
            self._least[i] = self._largest[i][-1]

    def highest(self, i: int) -> tuple[float, Floats, Ints]:
        """The highest excursions of hypothesis i.

        Returns the level that they exceed, by how much (n,), falling, and place and origin of the peaks (2, n).
        """
        order = np.argsort(self._largest[i])[::-1]
        base = float(self._largest[i][order[TOP]]) if len(order) > TOP else LEAST_HEIGHT
        return base, self._largest[i][order[:TOP]] - base, self._times[i][[PLACE, ORIGIN]][:, order[:TOP]]

    def events(self, i: int, many: int) -> Floats:
        """First sample, and the sample at which they reach the lowest of them (2, n), of the highest excursions.

        The latter is interpolated from the peak, as if g rose linearly.
        """
        order = np.argsort(self._largest[i])[::-1][:many]
        heights, times = self._largest[i][order], self._times[i][:, order]
        share = heights[-1:] / heights
        return np.stack([times[START], times[START] + share * (times[PEAK] - times[START])])


# --- The tail of g above them, extrapolated ---------------------------------------------------------------------------


# Exceedances of a high level have a generalised Pareto distribution (Pickands 1975) of shape xi: 0 (exponential) for an
# exact model; above 0 where small excursions come from noise and high ones from model errors, so that the tail becomes
# flatter.  The shape of one hypothesis alone is uncertain: it is shrunk towards the mean of all as far as they do not
# differ by more than chance (empirical Bayes, Efron and Morris 1975).  The tail does not become flatter for ever: g
# rises against a drift and falls exponentially far out.  So the shape is used for as far again as it was seen, and from
# there on the slope stays.
#
# Excursions at the same place of the motion, or from the same few large innovations of the record, are not independent.
# So the uncertainty of a tail is that of other places and other innovations: drawn with random weights (Bayesian
# bootstrap, Rubin 1981), the same for all hypotheses, as their excursions are correlated.  The product of both weights
# counts the variance of each single excursion three times (Owen 2007); that is computed from its influence and
# subtracted.

ALIKE = 10
"""Where there are fewer than TOP excursions, this number is added, distributed as for an exact model."""
_LEAST_SHAPE, _MOST_SHAPE = -0.1, 0.45
"""Bounds of the shape.  No tail falls faster than an exponential, but chance makes half of its shapes negative."""
_NO_SHAPE = 1e-6
_UNSURE = 0.25
"""Relative standard deviation of the shapes beyond the range in which they were seen."""


@dataclass(frozen=True)
class BankTails:
    """Tails of H hypotheses; draws (B, H) over motion and innovations, the first is the estimate.

    Excursions above ``base`` (H,) occur at the rate exp(log_rate) per sample and exceed it by ``mean`` on average.
    """

    base: Floats
    log_rate: Floats
    mean: Floats
    shape: Floats
    seen: float
    """Logarithm of the factor by which the rate of excursions above ``base`` falls within the range that was seen"""

    def log_rates(self, h: Floats, steeper: Floats) -> Floats:
        """Logarithms (B, H) of the rates of excursions above h (H,), where g is steeper by a factor (B, H)."""
        sigma, xi, end, slope = self._form
        above = h * steeper - self.base
        fallen = np.log1p(xi / sigma * np.clip(above, 0.0, end)) / xi
        return np.asarray(
            self.log_rate - fallen - np.minimum(above, 0.0) / sigma - slope * np.maximum(above - end, 0.0)
        )

    @cached_property
    def _form(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Scale, shape, end of the range of the shape, slope of -log of the survival function beyond; each (B, H)."""
        xi = np.where(np.abs(self.shape) > _NO_SHAPE, self.shape, _NO_SHAPE)
        sigma = self.mean * (1 - xi)
        end = sigma * np.expm1(2 * self.seen * xi) / xi
        return sigma, xi, end, 1 / (sigma + xi * end)


def bank_tails(
    heights: ExcursionPeaks, many: int, weights: tuple[Floats, Floats], farther: Floats
) -> BankTails:
    """Tails of ``many`` hypotheses; weights (B, places) of motion and innovations; ``farther`` (B,) standard normal."""
    highest = [heights.highest(i) for i in range(many)]
    base = np.array([pair[0] for pair in highest])
    number = np.array([len(pair[1]) for pair in highest])
    alike = np.where(number == TOP, 0, ALIKE)[:, np.newaxis]
    count, first, lower = (np.empty((many, len(farther))) for _ in range(3))
    own = np.array([_own_variances(above, ALIKE * (len(above) < TOP)) for _, above, _ in highest])
    for i, (_, above, (place, origin)) in enumerate(highest):
        w = weights[0][:, place] * weights[1][:, origin]
        higher = np.cumsum(w, axis=1) - w / 2  # as they fall
        count[i], first[i], lower[i] = w.sum(axis=1), w @ above, (w * higher) @ above
    mean = (first + alike) / (count + alike)
    # By probability-weighted moments (Hosking and Wallis 1987):  xi = 2 - m / (m - 2 a),  a the mean of x (1 - F).
    a = (lower + alike * count / 4) / (np.maximum(count, 1e-12) * (count + alike))
    shape = 2 - mean / np.maximum(mean - 2 * a, 1e-12 * mean)
    # With fewer excursions the base would lie among the small ones, outside of the tail.
    shape = np.clip(_shrink_to_mean(_with_chance(shape, own[:, 2]), number == TOP), _LEAST_SHAPE, _MOST_SHAPE)
    shape *= np.maximum(1 + _UNSURE * farther, 0.0)
    log_rate = _with_chance(np.log(np.maximum(count, 1.0) / max(heights.samples, 1)), own[:, 0])
    mean = np.exp(_with_chance(np.log(mean), own[:, 1]))
    return BankTails(base, log_rate.T, mean.T, shape.T, float(np.log(TOP)))


def _own_variances(falling: Floats, alike: int) -> tuple[float, float, float]:
    """Variances of the logs of number and mean, and of the shape, for independent excursions (n,).

    The sums of the squares of their influences (Hampel 1974).
    """
    n = len(falling)
    if not n:
        return 0.0, 0.0, 0.0
    mean, m = (falling.sum() + alike) / (n + alike), falling.mean()
    of_mean = (falling - mean) / (n + alike) / mean
    smaller = (falling.sum() - np.cumsum(falling) + falling * np.arange(1, n + 1)) / n  # E min(x, X)
    left = max(m - smaller.mean(), 1e-12 * m)
    of_shape = 2 / (n * left**2) * (smaller.mean() / 2 * (falling - m) - m * (smaller - smaller.mean()))
    return 1 / n, float(of_mean @ of_mean), float(of_shape @ of_shape)


def _with_chance(drawn: Floats, own: Floats) -> Floats:
    """Draws (H, B) around the estimate with the chance of single excursions, ``own`` (H,), counted once.

    They are centred on the estimate: where few innovations make a tail, most draws lack some of them.
    """
    differs = drawn[:, 1:] - drawn[:, 1:].mean(axis=1, keepdims=True)
    found = differs.var(axis=1)
    less = np.minimum(np.maximum(found - 2 * own, own) / np.maximum(found, np.finfo(float).tiny), 1.0)
    return np.hstack([drawn[:, :1], drawn[:, :1] + np.sqrt(less)[:, np.newaxis] * differs])


def _shrink_to_mean(shape: Floats, tell: Bools) -> Floats:
    """Each shape shrunk towards the mean of all (H, B); those that are undetermined get the mean."""
    out = np.zeros_like(shape)
    if tell.any():
        own, mean = shape[tell, :1], shape[tell].mean(axis=0)
        differs = shape[tell] - own - (mean - mean[0])  # from draw to draw
        chance = differs[:, 1:].var(axis=1)
        between = max(float(own.var() - chance.mean()), 0.0)
        kept = (between / (between + np.maximum(chance, 1e-12)))[:, np.newaxis]
        out[tell] = mean + kept * (own - mean[0]) + np.sqrt(kept) * differs
        out[~tell] = mean
    return out
