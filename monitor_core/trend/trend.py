"""Trend of a parameter from its slow history: steady, drift or step, with probabilities.

All combinations of trend models and noise models (trend_models.py) are weighted by their evidence.  The result is a
mixture of Gaussians for level and slope.  It gives the probabilities of the kinds, the slope, and the time at which a
limit is reached.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.trend.entries import HistoryEntry, thinned
from monitor_core.trend.trend_models import (
    AFTER,
    BEFORE,
    KINDS,
    Noises,
    Shapes,
    Weighed,
    possible,
    shapes,
    weigh,
    whitened,
)

FEWEST = 24
"""Least number of entries for a trend."""

SPAN = 120
"""Least time that the entries must span, in hours (``hour_s``): several days, as days differ from nights."""

MOST = 160
"""Largest number of entries that are used; more are merged."""

COARSE = 12
"""Number of times of a change that are tried first, with every noise model."""

LIKELY, MOST_LIKELY = 1e-3, 24
"""Noise models that are kept for all times of a change: least likelihood relative to the best, and largest number."""

CHANGE = 0.3
"""Prior standard deviation of a change, as a share of the size of the parameter."""

KEPT = 1e-6
"""Trends below this probability are left out."""


class Mixture(NamedTuple):
    """The K most likely trends with their probabilities, in the unit of the parameter; times in s after ``zero_us``."""

    zero_us: int
    p: Floats  # (K,) probabilities
    at: Floats  # (K,) times of the changes
    begin: float  # first and last time of the history
    end: float
    level: Floats  # (K,) before the change, given the changes ``mean``
    level_variance: Floats  # (K,) given the changes
    pull: Floats  # (K, 2) decrease of the level for a change of one: step and ramp
    mean: Floats  # (K, 2) of step and ramp
    covariance: Floats  # (K, 2, 2)

    def at_times(self, t: Floats) -> tuple[Floats, Floats]:
        """Mean and standard deviation (T, K) of each trend at times t (T,), also in the future."""
        after = t[:, None] >= self.at
        ramp = np.maximum(t[:, None] - self.at, 0.0) / np.maximum(self.end - self.at, 1e-300)
        f = np.stack([after.astype(float), ramp], axis=-1)  # (T, K, 2)
        mean = self.level + np.einsum("tkf,kf->tk", f, self.mean)
        k = f - self.pull
        variance = self.level_variance + np.einsum("tkf,kfh,tkh->tk", k, self.covariance, k)
        return mean, np.sqrt(variance)


class Trend(NamedTuple):
    """Trend of a slow history; per second, in the unit of the parameter."""

    time_us: int
    """Time of the last entry, at which the trend ends"""
    since_us: int
    """Start of the first entry"""
    probability: dict[str, float]
    """Probabilities of steady, drift, step, both (a step, and a drift since)"""
    level: float
    level_sd: float
    slope: float
    slope_sd: float
    change_us: int
    """Time at which the likeliest kind of change began; the start of the history for a steady parameter"""
    change: float
    """Mean of the change since then"""
    change_sd: float
    """Standard deviation of the change"""
    scatter: float
    """Standard deviation of the mean of an hour around the trend"""
    mixture: Mixture


def trend_of(entries: Sequence[HistoryEntry], size: float, hour_s: float) -> Trend | None:
    """Trend of the entries of a parameter; None: there are too few entries, or they cover too little time.

    ``size``: size of the parameter, in its unit: |nominal| or its scale.  ``hour_s``: time in operation per entry [s].
    """
    zero_us = entries[-1].middle_us if entries else 0
    if len(entries) < FEWEST or zero_us - entries[0].middle_us < SPAN * hour_s * 1e6 / 1.001:
        return None
    few = thinned(entries, MOST)
    t = np.array([(e.middle_us - zero_us) / 1e6 for e in few])
    keep = np.diff(t, prepend=-np.inf) > 0
    few, t = [e for e, k in zip(few, keep, strict=True) if k], t[keep]
    y = np.array([e.mean for e in few])
    zero = float(np.median(y))
    y = (y - zero) / size
    variance = np.array([e.variance for e in few]) / size**2
    share = np.minimum(1.0, hour_s / np.array([e.operating_s for e in few]))
    weighed, noises, likely = _weighed(t, y, variance, share, hour_s)
    variances = noises.white + noises.lasting + np.median(variance)
    scatter = float(np.sqrt(likely @ variances / likely.sum()))
    return _summary(entries, t, weighed, (zero, size), zero_us, scatter)


def _weighed(t: Floats, y: Floats, variance: Floats, share: Floats, hour_s: float) -> tuple[Weighed, Noises, Floats]:
    """Evidence of the trends: first all noise models with a few times of a change, then the likely ones with all."""
    N = len(t)
    every = np.concatenate([[0], np.arange(BEFORE, N - AFTER + 1)])
    few = every[np.unique(np.linspace(0, len(every) - 1, COARSE).round().astype(int))]
    noises = possible(t, _spread(t, y, variance), hour_s)
    coarse, s = _with(t, y, variance, share, noises, few)
    by_noise = _by_noise(coarse, len(noises.white), len(s.at))
    best = np.argsort(-by_noise, kind="stable")[:MOST_LIKELY]
    best = best[by_noise[best] > by_noise.max() + np.log(LIKELY)]
    noises = Noises(*(x[best] for x in noises))
    fine, s = _with(t, y, variance, share, noises, every)
    by_noise = _by_noise(fine, len(best), len(s.at))
    return fine, noises, np.exp(by_noise - by_noise.max())


def _with(
    t: Floats, y: Floats, variance: Floats, share: Floats, noises: Noises, first: Floats
) -> tuple[Weighed, Shapes]:
    s = shapes(t, first)
    columns = np.column_stack([y, np.ones_like(y), s.step, s.ramp])
    W, log_det = whitened(t, columns, variance, share, noises)
    prior = np.gradient(s.at[1:]) if len(s.at) > 2 else np.ones(1)
    return weigh(W, log_det - 2 * noises.log_prior, s, CHANGE, prior / prior.sum()), s


def _spread(t: Floats, y: Floats, variance: Floats) -> float:
    """Approximate scatter of the values: the residuals of a line or of two levels; at least that of P."""
    line = y - np.polyval(np.polyfit(t, y, 1), t)
    left = [float(line @ line)]
    n = np.arange(1, len(y))
    before, total = np.cumsum(y)[:-1], y.sum()
    left.append(float((y @ y - before**2 / n - (total - before) ** 2 / (len(y) - n)).min()))
    return float(np.sqrt(max(min(left) / len(y), float(np.median(variance)))))


def _by_noise(w: Weighed, G: int, M: int) -> Floats:
    """Log evidence of each noise model (G,), summed over all trends."""
    parts = [w.log_weight[:G, None], *(x.reshape(G, M) for x in np.split(w.log_weight[G:], 3))]
    return np.asarray(np.logaddexp.reduce(np.concatenate(parts, axis=1), axis=1))


def _summary(
    entries: Sequence[HistoryEntry], t: Floats, w: Weighed, scale: tuple[float, float], zero_us: int, scatter: float
) -> Trend:
    zero, size = scale
    p = np.exp(w.log_weight - w.log_weight.max())
    p /= p.sum()
    kinds = {kind: float(p[w.kind == k].sum()) for k, kind in enumerate(KINDS)}
    keep = p > KEPT
    m = Mixture(
        zero_us,
        p[keep] / p[keep].sum(),
        w.at[keep],
        float(t[0]),
        float(t[-1]),
        w.level[keep] * size + zero,
        w.level_variance[keep] * size**2,
        w.pull[keep],
        w.mean[keep] * size,
        w.covariance[keep] * size**2,
    )
    level, level_sd = _moments(m.p, *(x[0] for x in m.at_times(np.array([m.end]))))
    duration = m.end - m.at
    drifts = (w.kind[keep] == KINDS.index("drift")) | (w.kind[keep] == KINDS.index("both"))
    rate = np.where(drifts, 1 / np.maximum(duration, 1e-300), 0.0)
    slope, slope_sd = _moments(m.p, m.mean[:, 1] * rate, np.sqrt(m.covariance[:, 1, 1]) * rate)
    likeliest = max(KINDS[1:], key=kinds.__getitem__)
    own = m.p * (w.kind[keep] == KINDS.index(likeliest))
    own = own / own.sum() if own.sum() > 0 else m.p
    changed = np.sqrt(np.maximum(m.covariance.sum((1, 2)), 0.0))
    change, change_sd = _moments(own, m.mean.sum(1), changed)
    began = float(own @ m.at) if kinds["steady"] < 0.5 else m.begin
    return Trend(
        time_us=entries[-1].end_us,
        since_us=entries[0].start_us,
        probability=kinds,
        level=level,
        level_sd=level_sd,
        slope=slope,
        slope_sd=slope_sd,
        change_us=zero_us + round(began * 1e6),
        change=change,
        change_sd=change_sd,
        scatter=scatter * size,
        mixture=m,
    )


def _moments(p: Floats, mean: Floats, sd: Floats) -> tuple[float, float]:
    """Mean and standard deviation of a mixture."""
    middle = float(p @ mean)
    return middle, float(np.sqrt(p @ (sd**2 + (mean - middle) ** 2)))
