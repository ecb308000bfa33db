"""State-space models without iteration over the samples: predictor-based subspace identification (PBSIDopt).

    x(t+1) = A x + B u + K e,     y = C x + e          (paper, eq. 3)

Chiuso, Automatica 43 (2007): the one-step predictor of p lags has the Markov parameters h; their Hankel matrix times
the past z is the future as far as the past tells it, and the largest directions of that are the state; A, B, C and K
then follow by least squares.  It is consistent in closed loop, too, since nothing is projected along future inputs.
h is estimated with a prior of smooth decay: by plain least squares it fails with a band-limited torque,
because the shifted h then no longer cancel beyond the band.  All of it comes from one small matrix that the
samples are boiled down to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from scipy.optimize import minimize

from monitor_core.arrays import Floats
from monitor_core.identification.black_boxes.arx import ONES, Lags, factor
from monitor_core.identification.records.record import Record
from monitor_core.identification.records.uniform_grid import Regular, of_size_one, on_grid

_LONGEST = 80
"""Lags of the past, at most."""
_LEAST = 1e-12
"""Of the variance of y: noise below that is rounding."""


class Innovations(NamedTuple):
    """An innovations model with n states."""

    A: Floats  # (n, n)
    B: Floats  # (n,) of the torque, N m
    C: Floats  # (n,) of the output
    K: Floats  # (n,) predictor gain (A times the filter gain)
    lam0: float  # variance of e


class Past(NamedTuple):
    """All samples boiled down to as many rows as there are columns, without the constant part.

    Least squares on these rows are least squares on all.
    """

    z: Floats  # (r, 2 p) the past: u(t-1), y(t-1), .. u(t-p), y(t-p); upper triangular
    next: Floats  # (r, 2 p) the past one sample later: u(t), y(t), ..
    u: Floats  # (r,) u(t)
    y: Floats  # (r,) y(t)
    rows: int  # samples behind them


def fit_subspace(
    records: Sequence[Record] | Sequence[Regular], order: int, *, past: int | None = None
) -> Innovations:
    """The innovations model of one or several records; its poles are inside the unit circle.

    Args:
        records: with one interval; rows that need a missing sample are left out.
        order: n.
        past: lags of the past; default: 80, or a tenth of the samples.

    Raises:
        ValueError: an order that the past cannot hold, irregular samples, or a record that is too short.
    """
    series, su, sy = of_size_one(on_grid(records))
    boiled = _boil_down(series, past)
    p = boiled.z.shape[1] // 2
    if not 0 < order <= p:
        raise ValueError(f"order {order}: a past of {p} samples can hold orders from 1 to {p}")
    A, B, C, K, lam0 = _realised(boiled, _directions(boiled)[:order])
    return Innovations(A, B / su, C * sy, K / sy, lam0 * sy**2)


def _boil_down(series: Sequence[Regular], past: int | None) -> Past:
    """The triangular factor of past and present."""
    known = sum(int(record.known.sum()) for record in series)
    p = past or max(2, min(_LONGEST, known // 10))
    blocks = [Lags(0, 0, p), Lags(1, 0, p), *(Lags(ONES + k, 0, 0) for k in range(len(series)))]
    pairs = [c for lag in range(1, p + 1) for c in (p + 1 + lag, lag)]
    # The records' constants first: without their rows and columns, the rest is centred.
    constants = [2 * p + 2 + k for k in range(len(series))]
    found = factor(series, blocks, np.array([*constants, *pairs, p + 1, 0]))
    if found.rows <= 3 * p:
        raise ValueError(f"{found.rows} rows without a missing sample for a past of {p} samples: a longer record,"
                         " fewer gaps or a shorter past is needed")  # fmt: skip
    R = found.R[len(series) :, len(series) :]
    z, now = R[:, : 2 * p], R[:, 2 * p :]
    return Past(z, np.hstack([now, z[:, :-2]]), now[:, 0], now[:, 1], found.rows)


def _directions(past: Past) -> Floats:
    """T (p, 2 p): what the future depends on is x = T z, the most important first."""
    width = past.z.shape[1]
    p, Rz, y = width // 2, past.z[:width], past.y[:width]
    lam0 = float(np.sum(past.y[width:] ** 2)) / (past.rows - width)
    h = smooth_predictor(Rz, y, max(lam0, _LEAST * float(past.y @ past.y) / past.rows))
    H = np.zeros((p, width))
    for i in range(p):
        # Prediction of y(t+i) from the past at t: h_(i+1) times z(t-1), and so on.
        H[i, : width - 2 * i] = h[2 * i :]
    U, s, _ = np.linalg.svd(H @ Rz.T, full_matrices=False)
    s = np.maximum(s, np.finfo(float).tiny)
    return np.asarray((U / np.sqrt(s)).T @ H)


def _realised(past: Past, T: Floats) -> Innovations:
    """The model whose state is T z, T (n, 2 p)."""
    n, x, after = len(T), past.z @ T.T, past.next @ T.T
    C = _least_squares(x, past.y)
    e = past.y - x @ C
    ABK = _least_squares(np.column_stack([x, past.u, e]), after).T
    return Innovations(
        _reflected(ABK[:, :n]), ABK[:, n], C, ABK[:, n + 1], float(e @ e) / (past.rows - 3 * n)
    )


def _reflected(A: Floats) -> Floats:
    """A with the eigenvalues on and outside the unit circle moved to 1/conj, just inside if on it."""
    values, vectors = np.linalg.eig(A)
    outside = np.abs(values) >= 1
    if not outside.any():
        return A
    inside = 1 / np.conj(values[outside])
    values = values.astype(np.complex128)
    values[outside] = inside * np.minimum(1.0, (1 - 1e-6) / np.abs(inside))
    return np.asarray(np.linalg.solve(vectors.T, (vectors * values).T).T.real)


def _least_squares(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(x, y)[0], dtype=np.float64)


# --- Impulse responses of a one-step predictor from few excited frequencies: a prior of smooth decay ------------------


# The predictor  y(t) = sum_k h_k' z(t-k) + e  has more lags than a band-limited torque tells apart: least squares
# leaves the response beyond the band to the noise.  As a Gaussian process whose increments have the variance c a^k (1
# - a), the tuned-correlated or first-order stable spline kernel c a^max(i, j), h is smooth and decays; c and a of
# each signal are those of the largest likelihood of the record (Pillonetto, Chiuso and De Nicolao, Automatica 47
# (2011)). With h = F D w, F sums from each lag on, D the diagonal of the increments' standard deviations, w white: -2
# log L = log det S - b' S^-1 b + const,     S = I + D M D / lam0,     M = F' Z' Z F,     b = D F' Z' y / lam0 d(-2
# log L) / d log D_k^2 = 1 - (S^-1)_kk - w_k^2,                 w = S^-1 b

_START = (np.log(0.05), 2.0, np.log(0.05), 2.0)
"""log c and logit a of torque and output; signals have the size 1."""
_BOUNDS = ((-25.0, 10.0), (-3.0, 9.0), (-25.0, 10.0), (-3.0, 9.0))
_ROUNDING = 1e-14


def smooth_predictor(Z: Floats, y: Floats, lam0: float) -> Floats:
    """h (2 p,) of the largest posterior, from rows Z (r, 2 p) as of ``Past``, of about the size 1, and y (r,)."""
    F = np.kron(np.triu(np.ones((Z.shape[1] // 2, Z.shape[1] // 2))), np.eye(2))
    ZF = Z @ F
    M, c = ZF.T @ ZF / lam0, ZF.T @ y / lam0
    # -2 log L to a tenth, while it is as large as y' y / lam0.
    options = {"maxiter": 40, "ftol": 0.1 * lam0 / float(y @ y)}
    found = minimize(prediction_cost, _START, (M, c), "L-BFGS-B", jac=True, bounds=_BOUNDS, options=options)  # type: ignore[call-overload]
    d = np.exp(_log_variance(found.x, Z.shape[1] // 2)[0] / 2)
    # Not by M, whose square root has half the digits only.
    rows = np.vstack([ZF * d, np.sqrt(lam0) * np.eye(d.size)])
    w = np.linalg.lstsq(rows, np.concatenate([y, np.zeros(d.size)]))[0]
    return np.asarray(F @ (d * w))


def prediction_cost(q: Floats, M: Floats, c: Floats) -> tuple[float, Floats]:
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
    # Compensates rounding of a smooth, almost noiseless output.
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
