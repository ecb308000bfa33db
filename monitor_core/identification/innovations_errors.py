"""Prediction errors of an innovations model and their derivatives along given directions (compiled).

    eps = y - C x - v,                   x+ = A x + B (u + d) + K eps
    psi_i = C w_i + dC_i x,              w_i+ = A w_i + dA_i x + dB_i (u + d) + dK_i eps - K psi_i

psi_i is the derivative of the prediction.  Where y was not measured there is no eps and no correction.
"""

from __future__ import annotations

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.record import Bools
from monitor_core.kernel.compile import entry, kernel


@entry
def residuals(
    A: Floats, B: Floats, C: Floats, K: Floats, x0: Floats, u: Floats, y: Floats, known: Bools, yhat: Floats
) -> float:
    """Sum of squares of eps; yhat (N,) is filled."""
    n = A.shape[0]
    x, after = x0.copy(), np.empty(n)
    total = 0.0
    for t in range(u.size):
        yhat[t] = 0.0
        for i in range(n):
            yhat[t] += C[i] * x[i]
        e = y[t] - yhat[t] if known[t] else 0.0
        total += e * e
        for i in range(n):
            s = B[i] * u[t] + K[i] * e
            for j in range(n):
                s += A[i, j] * x[j]
            after[i] = s
        x, after = after, x
    return total


@entry
def slopes(
    A: Floats,
    B: Floats,
    C: Floats,
    K: Floats,
    x0: Floats,
    dA: Floats,
    dB: Floats,
    dC: Floats,
    dK: Floats,
    u: Floats,
    y: Floats,
    known: Bools,
    psi: Floats,
    eps: Floats,
) -> None:
    """eps (N,) and psi (N, r + n + 1): along r directions, then x0 (n,), then a constant d on the torque.

    Args:
        A: (n, n).
        B: (n,).
        C: (n,).
        K: (n,) predictor gain.
        x0: (n,) state at the first sample.
        dA: (r, n, n) directions.
        dB: (r, n).
        dC: (r, n).
        dK: (r, n).
        u: (N,) torque, with its offset.
        y: (N,) output.
        known: (N,) where it was measured.
        psi: (N, r + n + 1) to be filled; rows where y is not known are 0.
        eps: (N,) to be filled.
    """
    n, r = A.shape[0], dA.shape[0]
    q = r + n + 1
    # One column for each direction, so that the innermost loops run over all of them.
    W, G, now = np.zeros((n, q)), np.empty((n, q)), np.empty(q)
    DA = np.ascontiguousarray(dA.transpose(1, 2, 0))
    DB, DC, DK = np.ascontiguousarray(dB.T), np.ascontiguousarray(dC.T), np.ascontiguousarray(dK.T)
    for i in range(n):
        W[i, r + i] = 1.0
    x, after = x0.copy(), np.empty(n)
    for t in range(u.size):
        e = _innovation(C, DC, x, W, y[t], now) if known[t] else _nothing(now)
        eps[t] = e
        for k in range(q):
            psi[t, k] = now[k]
        _move(A, B, K, DA, DB, DK, x, W, now, u[t], e, after, G)
        x, after = after, x
        W, G = G, W


@kernel
def _innovation(C: Floats, DC: Floats, x: Floats, W: Floats, y: float, psi: Floats) -> float:
    """eps = y - C x; psi_i = C w_i + dC_i x is filled."""
    e = y
    _nothing(psi)
    for i in range(x.size):
        e -= C[i] * x[i]
        for k in range(psi.size):
            psi[k] += C[i] * W[i, k]
        for k in range(DC.shape[1]):
            psi[k] += DC[i, k] * x[i]
    return e


@kernel
def _nothing(psi: Floats) -> float:
    """No measurement: neither an error nor what it depends on."""
    for k in range(psi.size):
        psi[k] = 0.0
    return 0.0


@kernel
def _move(
    A: Floats,
    B: Floats,
    K: Floats,
    DA: Floats,
    DB: Floats,
    DK: Floats,
    x: Floats,
    W: Floats,
    psi: Floats,
    u: float,
    e: float,
    after: Floats,
    G: Floats,
) -> None:
    """x+ into ``after``, w_i+ into the columns of ``G``; the last column is that of d, which acts as the torque."""
    n, q, r = x.size, psi.size, DB.shape[1]
    for i in range(n):
        s = B[i] * u + K[i] * e
        for k in range(q):
            G[i, k] = -K[i] * psi[k]
        for k in range(r):
            G[i, k] += DB[i, k] * u + DK[i, k] * e
        G[i, q - 1] += B[i]
        for j in range(n):
            s += A[i, j] * x[j]
            for k in range(q):
                G[i, k] += A[i, j] * W[j, k]
            for k in range(r):
                G[i, k] += DA[i, j, k] * x[j]
        after[i] = s
