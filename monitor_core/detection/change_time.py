"""When a series left its level, and whether suddenly or gradually: Bayes for one change in white noise.

The values are means over consecutive stretches of time.  Each moment has the same prior probability; the level before
the change and its size are integrated out, both Gaussian.
"""

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats

PARTS = 4
"""Moments that are considered in each stretch."""

SURE = 3.0
"""Logarithm of the odds from which on a change is called a step, or a drift."""

COVERED = 0.9
"""Probability of every interval."""


class Change(NamedTuple):
    """A change of a series: the moment in an interval of probability COVERED, the size at the end, and its kind."""

    low: float
    best: float
    high: float
    size: float
    size_sd: float
    drift: float
    """Logarithm of the odds of a drift against a step"""


def find_change(edges: Floats, values: Floats, sd: Floats, level_sd: float) -> Change:
    """The change in the means ``values`` (N,), of standard deviation ``sd`` (N,), over the stretches between ``edges``.

    Args:
        edges: (N + 1,) in any unit of time, increasing.
        values: white but for the change.
        sd: lower bound; a larger scatter around the best fit is used instead.
        level_sd: standard deviation of the level before, around zero.
    """
    moments = _moments(edges)
    step, ramp = _steps(edges, moments), _ramps(edges, moments)
    sd = sd * max(1.0, min(_excess(f, values, sd, level_sd) for f in (step, ramp)))
    fits = [_fit(f, values, sd, level_sd) for f in (step, ramp)]
    odds = [np.logaddexp.reduce(log_evidence) for log_evidence, _, _ in fits]
    log_evidence, size, size_sd = fits[int(odds[1] > odds[0])]
    p = np.exp(log_evidence - log_evidence.max())
    best = int(p.argmax())
    low, high = _interval(edges, p / p.sum())
    middle = min(max(moments[best], low), high)
    return Change(low, middle, high, float(size[best]), float(size_sd[best]), float(odds[1] - odds[0]))


def _moments(edges: Floats) -> Floats:
    """Middles of equal parts of each stretch."""
    share = (np.arange(PARTS) + 0.5) / PARTS
    return np.asarray((edges[:-1, None] + np.diff(edges)[:, None] * share).ravel())


def _steps(edges: Floats, moments: Floats) -> Floats:
    """Mean, over each stretch, of a step of size one at each moment (moments, N)."""
    after = np.maximum(edges - moments[:, None], 0.0)
    return np.asarray(np.diff(after) / np.diff(edges))


def _ramps(edges: Floats, moments: Floats) -> Floats:
    """As ``_steps`` for a ramp that begins at each moment and has reached one at the end."""
    after = np.maximum(edges - moments[:, None], 0.0) ** 2 / 2
    return np.asarray(np.diff(after) / np.diff(edges) / (edges[-1] - moments[:, None]))


def _fit(f: Floats, values: Floats, sd: Floats, level_sd: float) -> tuple[Floats, Floats, Floats]:
    """Logarithm of the evidence for each moment, size and its standard deviation; f (moments, N)."""
    w = 1 / sd**2
    large = 10 * (np.abs(values).max() + sd.max())
    a, b, c = f**2 @ w + large**-2, f @ w, w.sum() + level_sd**-2
    u, v = f @ (w * values), w @ values
    det = a * c - b**2
    size = (c * u - b * v) / det
    level = (a * v - b * u) / det
    return np.asarray((size * u + level * v) / 2 - np.log(det) / 2), size, np.asarray(np.sqrt(c / det))


def _excess(f: Floats, values: Floats, sd: Floats, level_sd: float) -> float:
    """Root mean square of the residuals of the best fit, in standard deviations (three degrees of freedom)."""
    log_evidence, size, _ = _fit(f, values, sd, level_sd)
    best = int(log_evidence.argmax())
    rest = values - size[best] * f[best]
    w = 1 / sd**2
    rest = rest - w @ rest / (w.sum() + level_sd**-2)
    return float(np.sqrt(np.sum(w * rest**2) / max(len(values) - 3, 1)))


def _interval(edges: Floats, p: Floats) -> tuple[float, float]:
    """The central interval of probability COVERED of p (moments,), uniform within the parts of the stretches."""
    at = np.append((edges[:-1, None] + np.diff(edges)[:, None] * np.arange(PARTS) / PARTS).ravel(), edges[-1])
    total = np.append(0.0, np.cumsum(p))
    low, high = np.interp([(1 - COVERED) / 2, (1 + COVERED) / 2], total, at)
    return float(low), float(high)
