"""The tail of g of each hypothesis of a bank: its highest excursions on copies of records, and their extrapolation.

The excursions are found piece by piece along g, over all copies of the records; only a limited number is kept.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.kernel.excursions import ORIGIN, PEAK, PLACE, START, excursion_peaks

TOP = 500
"""Number of highest excursions that are used; lower ones do not have the distribution of the tail."""
LEAST_HEIGHT = 2.0
"""Lower excursions are left out, as they contain no information about the tail."""


class ExcursionPeaks:
    """Peaks of the excursions of g of all hypotheses, collected piece by piece over copies of records."""

    def __init__(self, many: int) -> None:
        self._least = np.full(many, LEAST_HEIGHT)
        self._largest: list[Floats] = [np.empty(0) for _ in range(many)]
        self._times: list[Ints] = [np.empty((4, 0), np.int64) for _ in range(many)]
        self._top, self._now = np.zeros(many), np.zeros((4, many), np.int64)
        self.largest = np.zeros(many)
        self.samples = 0
        """Number of tested samples"""

    def course(self) -> tuple[Floats, Ints]:
        """State of a new course of g, to be passed to ``take`` with each of its pieces."""
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

        Returns the level that they exceed, the excesses (n,) in falling order, and place and origin of the peaks (2,
        n).
        """
        order = np.argsort(self._largest[i])[::-1]
        base = float(self._largest[i][order[TOP]]) if len(order) > TOP else LEAST_HEIGHT
        return base, self._largest[i][order[:TOP]] - base, self._times[i][[PLACE, ORIGIN]][:, order[:TOP]]

    def events(self, i: int, many: int) -> Floats:
        """First sample of each of the highest excursions, and the sample at which it reaches the lowest peak (2, n).

        The second sample is interpolated from the peak, as if g rose linearly.
        """
        order = np.argsort(self._largest[i])[::-1][:many]
        heights, times = self._largest[i][order], self._times[i][:, order]
        share = heights[-1:] / heights
        return np.stack([times[START], times[START] + share * (times[PEAK] - times[START])])


# --- Extrapolation of the tail of g -----------------------------------------------------------------------------------


# Exceedances of a high level have a generalised Pareto distribution (Pickands 1975) of shape xi.  The shape is 0
# (exponential) for an exact model.  It is above 0, so that the tail becomes flatter, if small excursions come from
# noise and high ones from model errors.  The shape of one hypothesis alone is uncertain, so it is shrunk towards the
# mean of all hypotheses if they do not differ by more than chance (empirical Bayes, Efron and Morris 1975).  The tail
# does not become flatter for ever: g rises against a drift, so far out the tail falls exponentially.  So the shape is
# used over twice the observed range; beyond that the slope is constant.
#
# Excursions at the same place of the motion, or from the same few large innovations of the record, are not independent.
# So the uncertainty of a tail comes from the choice of places and innovations: both get random weights (Bayesian
# bootstrap, Rubin 1981), the same for all hypotheses, as their excursions are correlated.  The product of both weights
# counts the variance of each single excursion three times (Owen 2007); the surplus is computed from the influence of
# the excursions and subtracted.

ADDED_EXCURSIONS = 10
"""If there are fewer than TOP excursions, this number is added, distributed as for an exact model."""
_LEAST_SHAPE, _MOST_SHAPE = -0.1, 0.45
"""Bounds of the shape.  No tail falls faster than an exponential, but the estimate of a zero shape is negative in half
of the cases."""
_NO_SHAPE = 1e-6
_SHAPE_SD = 0.25
"""Relative standard deviation of the shapes beyond the observed range."""


@dataclass(frozen=True)
class BankTails:
    """Tails of H hypotheses: draws (B, H) over motion and innovations, of which the first is the estimate.

    Excursions above ``base`` (H,) occur at the rate exp(log_rate) per sample and exceed ``base`` by ``mean`` on
    average.
    """

    base: Floats
    log_rate: Floats
    mean: Floats
    shape: Floats
    seen: float
    """Logarithm of the factor by which the rate of excursions above ``base`` falls within the observed range"""

    def log_rates(self, h: Floats, steeper: Floats) -> Floats:
        """Logarithms (B, H) of the rates of excursions above h (H,), if the slope r is larger by ``steeper`` (B, H)."""
        sigma, xi, end, slope = self._form
        above = h * steeper - self.base
        fallen = np.log1p(xi / sigma * np.clip(above, 0.0, end)) / xi
        return np.asarray(
            self.log_rate - fallen - np.minimum(above, 0.0) / sigma - slope * np.maximum(above - end, 0.0)
        )

    @cached_property
    def _form(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Scale, shape, end of the range with this shape, and slope of -log(survival) beyond the range; (B, H) each."""
        xi = np.where(np.abs(self.shape) > _NO_SHAPE, self.shape, _NO_SHAPE)
        sigma = self.mean * (1 - xi)
        end = sigma * np.expm1(2 * self.seen * xi) / xi
        return sigma, xi, end, 1 / (sigma + xi * end)


def bank_tails(heights: ExcursionPeaks, many: int, weights: tuple[Floats, Floats], farther: Floats) -> BankTails:
    """Tails of ``many`` hypotheses.

    ``weights``: random weights (B, places) of the blocks of motion and of innovations.  ``farther`` (B,): standard
    normal draws for the uncertainty of the shapes beyond the observed range.
    """
    highest = [heights.highest(i) for i in range(many)]
    base = np.array([pair[0] for pair in highest])
    number = np.array([len(pair[1]) for pair in highest])
    alike = np.where(number == TOP, 0, ADDED_EXCURSIONS)[:, np.newaxis]
    count, first, lower = (np.empty((many, len(farther))) for _ in range(3))
    own = np.array([_own_variances(above, ADDED_EXCURSIONS * (len(above) < TOP)) for _, above, _ in highest])
    for i, (_, above, (place, origin)) in enumerate(highest):
        w = weights[0][:, place] * weights[1][:, origin]
        higher = np.cumsum(w, axis=1) - w / 2  # weight of the higher ones, as ``above`` is in falling order
        count[i], first[i], lower[i] = w.sum(axis=1), w @ above, (w * higher) @ above
    mean = (first + alike) / (count + alike)
    # By probability-weighted moments (Hosking and Wallis 1987):  xi = 2 - m / (m - 2 a),  a the mean of x (1 - F).
    a = (lower + alike * count / 4) / (np.maximum(count, 1e-12) * (count + alike))
    shape = 2 - mean / np.maximum(mean - 2 * a, 1e-12 * mean)
    # Only with TOP excursions the base lies in the tail; other hypotheses get the mean shape.
    shape = np.clip(_shrink_to_mean(_with_chance(shape, own[:, 2]), number == TOP), _LEAST_SHAPE, _MOST_SHAPE)
    shape *= np.maximum(1 + _SHAPE_SD * farther, 0.0)
    log_rate = _with_chance(np.log(np.maximum(count, 1.0) / max(heights.samples, 1)), own[:, 0])
    mean = np.exp(_with_chance(np.log(mean), own[:, 1]))
    return BankTails(base, log_rate.T, mean.T, shape.T, float(np.log(TOP)))


def _own_variances(falling: Floats, alike: int) -> tuple[float, float, float]:
    """Variances of the logs of number and mean, and of the shape, for independent excursions (n,).

    Each is the sum of the squared influences of the excursions (Hampel 1974).
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
    """Draws (H, B) with the variance of single excursions, ``own`` (H,), counted once, and centred on the estimate.

    Without centring they would be biased: if few innovations make up a tail, most draws lack some of them.
    """
    differs = drawn[:, 1:] - drawn[:, 1:].mean(axis=1, keepdims=True)
    found = differs.var(axis=1)
    less = np.minimum(np.maximum(found - 2 * own, own) / np.maximum(found, np.finfo(float).tiny), 1.0)
    return np.hstack([drawn[:, :1], drawn[:, :1] + np.sqrt(less)[:, np.newaxis] * differs])


def _shrink_to_mean(shape: Floats, tell: Bools) -> Floats:
    """Shapes (H, B), each shrunk towards the mean of all; shapes that are not determined (``tell``) get the mean."""
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
