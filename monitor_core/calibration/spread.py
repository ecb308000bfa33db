"""What healthy records differ by, beside what chance makes of it: the allowance in nu."""

from collections.abc import Sequence

import numpy as np
from scipy.special import gammaincinv  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats
from monitor_core.calibration.healthy import Deviations
from monitor_core.calibration.scatter import BINS, Scatter, binned

SHORTEST, MOST = 20, 10
"""Memories in a part, and parts of a record."""
FACTOR = 3.0
"""The allowance is so many standard deviations of what the means of parts differ by."""
LEVEL = 0.99
"""A spread that chance makes less often than in one of a hundred is real."""


def allowance(found: Sequence[Deviations], scatter: Scatter) -> Floats:
    """Allowance of each parameter (p,), in sizes.

    The means of parts, of all records, scatter by sigma sqrt(2 / memories) if there is nothing but noise.  What is
    beyond that (DerSimonian and Laird 1986; nothing, where chance would do) is a bias that comes and goes: of the
    pose, of the temperature.  To it comes the bias that stays, of nominal values that are not quite those of the axis.
    """
    q = max(1, round(scatter.memory / BINS))
    means, weights = [], []
    for one in found:
        d = binned(one, q)[:, 0]
        count = int(np.clip(len(d) // (SHORTEST * BINS), 1, MOST))
        for part in np.array_split(d, count) if len(d) else ():
            means.append(part.mean(axis=0))
            weights.append(len(part) / BINS / 2)
    m, w = np.array(means), np.array(weights)[:, np.newaxis]
    if len(m) < 2:
        return scatter.beyond
    # Within the parts, or the spread would be its own measure.
    inside = np.sqrt(np.maximum(scatter.sigma**2 - m.var(axis=0), 0.1 * scatter.sigma**2))
    w = w / inside**2
    mean = (w * m).sum(axis=0) / w.sum(axis=0)
    Q, freedom = (w * (m - mean) ** 2).sum(axis=0), len(m) - 1
    excess = (Q - freedom) / (w.sum(axis=0) - (w**2).sum(axis=0) / w.sum(axis=0))
    real = 2 * gammaincinv(freedom / 2, LEVEL ** (1 / len(Q))) < Q
    return np.asarray(scatter.beyond + np.where(real, FACTOR * np.sqrt(np.maximum(excess, 0.0)), 0.0))
