"""Impulse responses of a one-step predictor from few excited frequencies: a prior of smooth decay.

The predictor  y(t) = sum_k h_k' z(t-k) + e  has more lags than a band-limited torque tells apart: least squares leaves
the response beyond the band to the noise.  As a Gaussian process whose increments have the variance c a^k (1 - a), the
tuned-correlated or first-order stable spline kernel c a^max(i, j), h is smooth and decays; c and a of each signal
are those of the largest likelihood of the record (Pillonetto, Chiuso and De Nicolao, Automatica 47 (2011)).

With h = F D w, F sums from each lag on, D the diagonal of the increments' standard deviations, w white:

    -2 log L = log det S - b' S^-1 b + const,     S = I + D M D / lam0,     M = F' Z' Z F,     b = D F' Z' y / lam0
    d(-2 log L) / d log D_k^2 = 1 - (S^-1)_kk - w_k^2,                 w = S^-1 b
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from scipy.optimize import minimize

from monitor_core.arrays import Floats

_START = (np.log(0.05), 2.0, np.log(0.05), 2.0)
"""log c and logit a of torque and output; signals have the size 1."""
_BOUNDS = ((-25.0, 10.0), (-3.0, 9.0), (-25.0, 10.0), (-3.0, 9.0))
_ROUNDING = 1e-14


def smooth_predictor(Z: Floats, y: Floats, lam0: float) -> Floats:
    """h (2 p,) of the largest posterior.

    Args:
        Z: (r, 2 p) rows of u(t-1), y(t-1), .. u(t-p), y(t-p), of about the size 1.
        y: (r,) right-hand side.
        lam0: variance of e.
    """
    F = np.kron(np.triu(np.ones((Z.shape[1] // 2, Z.shape[1] // 2))), np.eye(2))
    ZF = Z @ F
    M, c = ZF.T @ ZF / lam0, ZF.T @ y / lam0
    # -2 log L to a tenth, while it is as large as y' y / lam0.
    options = {"maxiter": 40, "ftol": 0.1 * lam0 / float(y @ y)}
    found = minimize(_cost, _START, (M, c), "L-BFGS-B", jac=True, bounds=_BOUNDS, options=options)  # type: ignore[call-overload]
    d = np.exp(_log_variance(found.x, Z.shape[1] // 2)[0] / 2)
    # Not by M, whose square root has half the digits only.
    rows = np.vstack([ZF * d, np.sqrt(lam0) * np.eye(d.size)])
    w = np.linalg.lstsq(rows, np.concatenate([y, np.zeros(d.size)]))[0]
    return np.asarray(F @ (d * w))


def _cost(q: Floats, M: Floats, c: Floats) -> tuple[float, Floats]:
    """-2 log L and its gradient (4,)."""
    log_variance, slope = _log_variance(q, len(c) // 2)
    d = np.exp(log_variance / 2)
    L = _root(M, d)
    inverse = sla.lapack.dtrtri(L, lower=1)[0]
    half = inverse @ (d * c)
    w = inverse.T @ half
    by_variance = 1 - np.sum(inverse**2, axis=0) - w**2
    return float(2 * np.log(np.diag(L)).sum() - half @ half), np.asarray(slope @ by_variance)


def _root(M: Floats, d: Floats) -> Floats:
    S = M * np.outer(d, d)
    # What rounding takes from a smooth, almost noiseless output is given back.
    S[np.diag_indices_from(S)] += 1 + _ROUNDING * S.trace()
    return np.asarray(sla.cholesky(S, lower=True, overwrite_a=True, check_finite=False))


def _log_variance(q: Floats, p: int) -> tuple[Floats, Floats]:
    """Of the increments (2 p,), and its derivatives (4, 2 p):  c a^k (1 - a), the last c a^p."""
    k, value, slope = np.arange(1, p + 1), np.empty(2 * p), np.zeros((4, 2 * p))
    last = k == p
    for signal in range(2):
        log_c, s = q[2 * signal : 2 * signal + 2]
        log_a, log_1a = -np.logaddexp(0, -s), -np.logaddexp(0, s)
        value[signal::2] = log_c + k * log_a + np.where(last, 0.0, log_1a)
        slope[2 * signal, signal::2] = 1
        slope[2 * signal + 1, signal::2] = k * np.exp(log_1a) - np.where(last, 0.0, np.exp(log_a))
    return value, slope
