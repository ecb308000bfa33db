"""Innovations models without iteration over the samples: predictor-based subspace identification (PBSIDopt).

Chiuso, Automatica 43 (2007): the one-step predictor of p lags has the Markov parameters h; their Hankel matrix times
the past z is the future as far as the past tells it, and the largest directions of that are the state; A, B, C and K
then follow by least squares.  It is consistent in closed loop, too, since nothing is projected along future inputs.
h is estimated with a prior of smooth decay: by plain least squares it fails with a band-limited torque,
because the shifted h then no longer cancel beyond the band.  All of it comes from one small matrix that the
samples are boiled down to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
import scipy.linalg as sla
from scipy.optimize import minimize

from monitor_core.arrays import Floats
from monitor_core.identification.innovations import Innovations, reflected
from monitor_core.identification.innovations_errors import residuals
from monitor_core.identification.least_squares import ONES, Criterion, Lags, factor
from monitor_core.identification.record import Record
from monitor_core.identification.uniform_grid import Regular, of_size_one, on_grid

Rule = Criterion | Literal["singular-values"]
_LONGEST = 80
"""Lags of the past, at most."""
_HIGHEST = 15
"""Order that a rule may choose."""
_LEAST = 1e-12
"""Of the variance of y: noise below that is rounding."""
_MISSES = 4.0
"""Variance of a model's errors over that of an ARX model's: it leaves out what the record tells."""


class Past(NamedTuple):
    """All samples boiled down to as many rows as there are columns, without the constant part.

    Least squares on these rows are least squares on all.
    """

    z: Floats  # (r, 2 p) the past: u(t-1), y(t-1), .. u(t-p), y(t-p); upper triangular
    next: Floats  # (r, 2 p) the past one sample later: u(t), y(t), ..
    u: Floats  # (r,) u(t)
    y: Floats  # (r,) y(t)
    rows: int  # samples behind them


class Directions(NamedTuple):
    """Of the past that the future depends on, the most important first."""

    T: Floats  # (p, 2 p): x = T z, each of the variance of its singular value
    singular_values: Floats  # (p,)
    noise: float  # what noise alone stays below
    lam0: float  # variance of the errors of an ARX model of p lags


def fit_subspace(
    records: Sequence[Record] | Sequence[Regular],
    order: int | Rule = "singular-values",
    *,
    past: int | None = None,
) -> Innovations:
    """The innovations model of one or several records, without covariance.

    Args:
        records: with one interval; rows that need a missing sample are left out.
        order: n, or what chooses it: the number of singular values above those of noise, or the variance of the
            prediction errors with a price on 3 n parameters.
        past: lags of the past; default: 80, or a tenth of the samples.

    Raises:
        ValueError: an order that the past cannot hold, irregular samples, or a record that is too short.
    """
    series, su, sy = of_size_one(on_grid(records))
    return subspace_of(series, order, past).in_units(su, sy)


def subspace_of(series: Sequence[Regular], order: int | Rule, past: int | None) -> Innovations:
    """The same for records of size one."""
    boiled = boil_down(series, past)
    p = boiled.z.shape[1] // 2
    if isinstance(order, int) and not 0 < order <= p:
        raise ValueError(f"order {order}: a past of {p} samples can hold orders from 1 to {p}")
    found = _directions(boiled)
    h = series[0].interval_s
    if isinstance(order, int):
        return _realised(boiled, found, order, h)
    if order == "singular-values":
        above = np.count_nonzero(found.singular_values > found.noise)
        return _realised(boiled, found, int(np.clip(above, 1, _HIGHEST)), h)
    models = [_realised(boiled, found, n, h) for n in range(1, min(_HIGHEST, p) + 1)]
    return min(models, key=lambda model: _price(model, found.T[: model.order], series, order))


def boil_down(series: Sequence[Regular], past: int | None) -> Past:
    """The triangular factor of past and present.

    Raises:
        ValueError: too few rows.
    """
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


def _directions(past: Past) -> Directions:
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
    # The rows of H repeat each other, so the largest value of independent noise is exceeded; not by that much.
    noise = 2.5 * np.sqrt(lam0) * (np.sqrt(p) + np.sqrt(width))
    return Directions((U / np.sqrt(s)).T @ H, s, float(noise), lam0)


def _price(model: Innovations, T: Floats, series: Sequence[Regular], rule: Criterion) -> float:
    """N log(lam0) + 3 n (2 or log N), from the prediction errors of the records, each after its first p samples."""
    cost, N, p = 0.0, 0, T.shape[1] // 2
    matrices = model.A, model.B, model.C, model.K
    for record in series:
        first = np.column_stack([record.u[:p], record.y[:p]])[::-1].ravel()
        u, y, known = record.u[p:], record.y[p:], record.y_known[p:]
        cost += residuals(*matrices, T @ first, u, y, known, np.empty(u.size))
        N += int(known.sum())
    parameters = 3 * model.order * (2.0 if rule == "aic" else np.log(N))
    return float(N * np.log(cost) + parameters) if np.isfinite(cost) else np.inf


def _realised(past: Past, found: Directions, n: int, interval_s: float) -> Innovations:
    T = found.T[:n]
    x, after = past.z @ T.T, past.next @ T.T
    C = _least_squares(x, past.y)
    e = past.y - x @ C
    ABK = _least_squares(np.column_stack([x, past.u, e]), after).T
    A, B, K = ABK[:, :n], ABK[:, n], ABK[:, n + 1]
    lam0 = float(e @ e) / (past.rows - 3 * n)
    words = [_misses(n, past, lam0 / found.lam0)] if lam0 > _MISSES * found.lam0 else []
    if np.abs(np.linalg.eigvals(A)).max() >= 1:
        A = reflected(A)
        words.append("Poles on or outside the unit circle were reflected into it.")
    if np.abs(np.linalg.eigvals(A - np.outer(K, C))).max() >= 1:
        w = after - x @ A.T - np.outer(past.u, B)
        K = _filter_gain(A, C, w / np.sqrt(past.rows), e / np.sqrt(past.rows))
        words.append("The predictor came out unstable; its gain is that of a Kalman filter instead.")
    none = np.empty((n * n + 3 * n, 0))
    return Innovations(interval_s, A, B, C, K, lam0, past.rows, none, found.singular_values, tuple(words))


def _filter_gain(A: Floats, C: Floats, w: Floats, e: Floats) -> Floats:
    """Predictor gain of the steady-state Kalman filter for the noises w (r, n) and e (r,); 0 if there is none."""
    Q, S, R = w.T @ w, w.T @ e, float(e @ e)
    try:
        P = sla.solve_discrete_are(A.T, C[:, None], Q, np.array([[R]]), s=S[:, None])
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros(len(A))
    return np.asarray((A @ P @ C + S) / (C @ P @ C + R))


def _least_squares(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(x, y)[0], dtype=np.float64)


def _misses(n: int, past: Past, ratio: float) -> str:
    p = past.z.shape[1] // 2
    return (
        f"With {n} states the prediction errors are {np.sqrt(ratio):.2g} times those of an ARX model of {p} lags: the"
        " order is too low, or the samples are too dense for the axis; then resample to a longer interval."
    )


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
