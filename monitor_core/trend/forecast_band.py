"""Where the course of a parameter may be at any time, past and future: quantiles of the mixture that is left of it."""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from monitor_core.arrays import Floats
from monitor_core.trend.trend import Mixture

_BEYOND = 8.0
"""Standard deviations from every mean within which each quantile is sought."""
_BISECTIONS = 40
_LEFT_OUT = 1e-4
"""Probability of all the courses together that are passed over, the least likely of thousands."""


def quantiles(m: Mixture, t: Floats, probabilities: Sequence[float]) -> Floats:
    """Levels (len(probabilities), T) below which the parameter's course is with each probability.

    The line of 95 % reaches an upper limit where the interval of its forecast begins.

    Args:
        m: of a trend.
        t: (T,) seconds after ``m.zero_us``.
        probabilities: between 0 and 1.
    """
    p, (mean, sd) = m.p, m.at_times(t)
    least_first = np.argsort(p)
    kept = least_first[np.cumsum(p[least_first]) > _LEFT_OUT]
    p, mean, sd = p[kept] / p[kept].sum(), mean[:, kept], sd[:, kept]
    wanted = np.asarray(probabilities)[:, None]
    low = np.broadcast_to((mean - _BEYOND * sd).min(axis=1), (len(probabilities), len(t))).copy()
    high = np.broadcast_to((mean + _BEYOND * sd).max(axis=1), low.shape).copy()
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        below = np.stack([ndtr((x[:, None] - mean) / sd) @ p for x in middle]) < wanted
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray((low + high) / 2)
