"""Onset and kind of a change, from the past of the estimates.

theta and P at two times give the information of the samples between them, called a stretch.  R theta, with R = P^-1, is
the sum of psi (eps + psi' theta) with the same forgetting as R.  So R_k theta_k - lam^n R_(k-1) theta_(k-1) depends on
the samples of the stretch only.  Its mean is dR theta and its covariance lambda_0 dR, with dR = R_k - lam^n R_(k-1); it
is white from stretch to stretch.  ``find_change`` finds the change in the means of the stretches by Bayes' rule.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.state import NEVER

MIN_STRETCHES = 8
"""Least number of stretches."""

LAG = 4
"""Distance of two stretches that are hardly correlated any more."""

ROUNDING = 1e-9
"""Information below this share of the total is a rounding error."""

MIN_INFORMATION = 1e-4
"""A stretch with less than this share of the median information is ignored."""


COVERED = 0.9
"""Probability of every interval."""


class Change(NamedTuple):
    """A change of a series: its time ``best`` in an interval of probability COVERED, its size at the end, its kind."""

    low: float
    best: float
    high: float
    size: float
    size_sd: float
    drift: float
    """Logarithm of the odds of a drift against a step"""


class Past(NamedTuple):
    """Deviations and P at several times, with equal numbers of learned samples between them."""

    t_us: Ints  # (N,)
    d: Floats  # (N, p)
    P: Floats  # (N, p, p)
    lam: float
    """lambda to the power of the samples of a stretch"""
    lam0: float
    lag_us: float
    """Longest delay from a change of a parameter until its estimate moves: the predictor's slowest time constant"""


def past_of(t_us: Ints, kept: Floats, p: int, lam: float, lam0: float, lag_us: float) -> Past:
    """Past from the arrays of the kernel: t_us (N,), NEVER for empty entries; kept (N, p + p (p + 1) / 2).

    The past begins where the clock was last set back, as earlier times cannot be ordered.
    """
    first = int(np.count_nonzero(t_us == NEVER))  # empty entries come first
    set_back = np.flatnonzero(np.diff(t_us) < 0)
    first = max(first, int(set_back[-1]) + 1 if set_back.size else 0)
    known = kept[first:]
    return Past(t_us[first:].copy(), known[:, :p].copy(), known[:, _square(p)], lam, lam0, lag_us)


@cache
def _square(p: int) -> Ints:
    """Index of each element of P (p, p) in the kernel's rows: the upper triangle follows the deviations (p,)."""
    places = np.empty((p, p), np.int64)
    rows, columns = np.triu_indices(p)
    places[rows, columns] = places[columns, rows] = p + np.arange(len(rows))
    return places


def lately(past: Past, stretches: int) -> tuple[Floats, Floats] | None:
    """Deviations (p,) that fit the last stretches with equal weights, and their covariance; None: too little is known.

    The covariance is that of the information times the scatter found in the stretches.
    """
    if len(past.t_us) <= MIN_STRETCHES:
        return None
    dR, ds = _of_stretches(past)
    R, s = dR[-stretches:].sum(0), ds[-stretches:].sum(0)
    scale = np.sqrt(np.abs(np.diag(R)))
    with np.errstate(all="ignore"):
        normal = R / np.outer(scale, scale)
        rounding = np.diag(R) < ROUNDING / np.diag(past.P[-1])
    if rounding.any() or not np.isfinite(normal).all() or np.linalg.eigvalsh(normal)[0] < ROUNDING:
        return None
    V = np.linalg.inv(normal) / np.outer(scale, scale)
    return V @ s, float(np.mean(scatters(past) ** 2)) * past.lam0 * V


def _of_stretches(past: Past) -> tuple[Floats, Floats]:
    """Information dR (N, p, p) and dR theta (N, p) of each single stretch."""
    R = _inverses(past.P)
    before = past.lam * R[:-1]
    ds = np.einsum("kij,kj->ki", R[1:], past.d[1:]) - np.einsum("kij,kj->ki", before, past.d[:-1])
    return R[1:] - before, ds


def _inverses(P: Floats) -> Floats:
    """Inverses of matrices (N, p, p); NaN for a singular P, as a diverging predictor may have."""
    try:
        return np.asarray(np.linalg.inv(P))
    except np.linalg.LinAlgError:
        if len(P) == 1:
            return np.full_like(P, np.nan)
        return np.concatenate([_inverses(P[k : k + 1]) for k in range(len(P))])


def change_of(past: Past, i: int, alone: bool) -> Change | None:
    """The change of parameter i, with times in microseconds from the end of the past; None: too little is known.

    ``alone``: no other parameter has changed; otherwise the others may have changed, which leaves less information.
    """
    edges, value, sd = _stretches(past, i, alone)
    if len(value) < MIN_STRETCHES:
        return None
    change = find_change(edges, value, sd, float(np.sqrt(past.lam0 * past.P[-1, i, i] / 2)))
    low, best = change.low - past.lag_us, change.best - min(past.lag_us / 2, change.best - change.low)
    return change._replace(low=low, best=best)


def return_of(past: Past, i: int, alone: bool, since_us: int) -> tuple[int, float]:
    """Time [us] until which parameter i surely had its changed value, and the evidence that it is back since.

    The evidence is a log-likelihood ratio: a constant change since ``since_us`` that has ended later, against one that
    lasts; -inf: too little is known.  ``alone``: no other parameter has changed.
    """
    edges, value, sd = _stretches(past, i, alone)
    ends_us = past.t_us[-1] + edges.astype(np.int64)
    first = int(np.searchsorted(ends_us[1:], since_us))
    w = (sd[first:] * scatter(past, i)) ** -2
    if len(w) < 2:
        return since_us, -np.inf
    explained = np.cumsum(w * value[first:]) ** 2 / (2 * np.cumsum(w))
    last = int(explained[:-1].argmax())
    # In that stretch the parameter may have begun to come back.
    return int(ends_us[first + max(last, 1)]), float(explained[last] - explained[-1])


def scatter(past: Past, i: int) -> float:
    """Ratio of the scatter of the estimate of parameter i to that of P, from differences of stretches; at least 1.

    A single change hardly affects differences of neighbours.  These are smaller if neighbours are correlated; the
    result is corrected for that, as the mean then converges more slowly.
    """
    _, value, sd = _stretches(past, i, alone=True)
    if len(value) < 4 * LAG:
        return 1.0
    near, far = _variance(value, sd, 1), _variance(value, sd, LAG)
    if far == 0.0:
        return 1.0
    r = min(max(1 - near / far, 0.0), 0.5)
    return max(1.0, float(np.sqrt(far * (1 + r) / (1 - r))))


def scatters(past: Past) -> Floats:
    """``scatter`` of each parameter (p,)."""
    return np.array([scatter(past, i) for i in range(past.d.shape[1])])


def _variance(value: Floats, sd: Floats, apart: int) -> float:
    """Variance of values in units of their sd, from differences; the largest are left out, as they may be a change."""
    square = (value[apart:] - value[:-apart]) ** 2 / (sd[apart:] ** 2 + sd[:-apart] ** 2)
    return float(np.mean(np.sort(square)[:-apart]))


def _stretches(past: Past, i: int, alone: bool) -> tuple[Floats, Floats, Floats]:
    """Stretches with information on parameter i: edges (N + 1,) [us from the end], values (N,) and their sd (N,)."""
    if len(past.t_us) <= MIN_STRETCHES:
        return np.zeros(1), np.zeros(0), np.zeros(0)
    dR, ds = _of_stretches(past)
    value, information = _of_itself(dR, ds, i) if alone else _beside_others(dR, ds, i)
    use = np.isfinite(value) & np.isfinite(information) & (information > 0)
    use &= information > MIN_INFORMATION * (np.median(information[use]) if use.any() else 0.0)
    t_us = past.t_us - past.t_us[-1]  # absolute times have more digits than a float
    edges = np.append(t_us[0], t_us[1:][use]).astype(float)
    return edges, value[use], np.sqrt(past.lam0 / information[use])


def _of_itself(dR: Floats, ds: Floats, i: int) -> tuple[Floats, Floats]:
    information = dR[:, i, i]
    with np.errstate(all="ignore"):
        return ds[:, i] / information, information


def _beside_others(dR: Floats, ds: Floats, i: int) -> tuple[Floats, Floats]:
    """Value and information of each stretch for unknown other parameters; 0 if it does not separate them."""
    value, information = np.zeros(len(dR)), np.zeros(len(dR))
    for k, (A, b) in enumerate(zip(dR, ds, strict=True)):
        scale = np.sqrt(np.abs(np.diag(A)))
        with np.errstate(all="ignore"):
            normal = A / np.outer(scale, scale)
        if np.isfinite(normal).all() and np.linalg.eigvalsh(normal)[0] > 1e-6:
            inverse = np.linalg.inv(normal) / np.outer(scale, scale)
            value[k], information[k] = (inverse @ b)[i], 1 / inverse[i, i]
    return value, information


# --- Change of a series: time, and step or drift ----------------------------------------------------------------------


# All times have the same prior probability.  The level before and the size of the change, both Gaussian, are integrated
# out.

PARTS = 4
"""Number of possible times of a change in each stretch"""

SURE = 3.0
"""Logarithm of the odds from which a change is called a step, or a drift"""


def find_change(edges: Floats, values: Floats, sd: Floats, level_sd: float) -> Change:
    """The change in the means ``values`` (N,), of standard deviation ``sd`` (N,), over the stretches between ``edges``.

    Args:
        edges: (N + 1,) in any unit of time, increasing.
        values: white, apart from the change.
        sd: lower bound of the standard deviations; a larger scatter around the best fit is used instead.
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
    """The first edge, for a change before it, and the middles of equal parts of each stretch."""
    share = (np.arange(PARTS) + 0.5) / PARTS
    return np.append(edges[0], (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel())


def _steps(edges: Floats, moments: Floats) -> Floats:
    """Mean, over each stretch, of a step of size one at each moment (moments, N)."""
    after = np.maximum(edges - moments[:, None], 0.0)
    return np.asarray(np.diff(after) / np.diff(edges))


def _ramps(edges: Floats, moments: Floats) -> Floats:
    """As ``_steps`` for a ramp that begins at each moment and has reached one at the end."""
    after = np.maximum(edges - moments[:, None], 0.0) ** 2 / 2
    return np.asarray(np.diff(after) / np.diff(edges) / (edges[-1] - moments[:, None]))


def _fit(f: Floats, values: Floats, sd: Floats, level_sd: float) -> tuple[Floats, Floats, Floats]:
    """Logarithm of the evidence, size and its standard deviation, for each moment; f (moments, N): unit changes."""
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
    """Central interval of probability COVERED, for p (moments,), which is uniform within each part of a stretch.

    It begins at the first edge if the change may have been before it.
    """
    times = np.append((edges[:-1, None] + np.diff(edges)[:, None] * np.arange(PARTS) / PARTS).ravel(), edges[-1])
    low, high = np.interp([(1 - COVERED) / 2, (1 + COVERED) / 2], np.cumsum(p), times)
    return float(low), float(high)
