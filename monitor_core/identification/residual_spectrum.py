"""The spectrum of prediction errors that are not white, by an autoregressive model, and what it does to a covariance.

    eps(t) + a_1 eps(t-1) + .. + a_k eps(t-k) = e(t),       Phi(omega) = var e / |1 + a_1 z^-1 + ..|^2

The order is Schwarz's: zero for white errors, which then change nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len, rfft

from monitor_core.arrays import Floats

MOST_ORDERS = 60


def scores_covariance(eps: Sequence[Floats], psi: Sequence[Floats]) -> tuple[Floats, int]:
    """Covariance (p, p) of sum psi(t) eps(t), for errors that do not depend on psi, and the order of the model.

    sum_ts psi(t) R(t - s) psi(s)' over records, R the errors' autocovariance: in frequency, so that no rounding can
    make it negative.  Missing errors are zero.
    """
    a, variance = autoregression(eps)
    p = psi[0].shape[1]
    if a.size == 1:
        return variance * np.sum([J.T @ J for J in psi], axis=0), 0
    out = np.zeros((p, p))
    for J in psi:
        size = next_fast_len(2 * len(J), real=True)
        Phi = variance / np.abs(rfft(a, size)) ** 2
        S = rfft(J, size, axis=0)
        weight = Phi / size
        weight[1 : (size + 1) // 2] *= 2  # Both signs of the frequency.
        out += np.real((S.conj() * weight[:, None]).T @ S)
    return out, a.size - 1


def autoregression(eps: Sequence[Floats]) -> tuple[Floats, float]:
    """1, a_1 .. a_k and the variance of e, by Levinson's recursion; order k by Schwarz's criterion."""
    N = sum(int(np.count_nonzero(part)) for part in eps)
    most = max(0, min(MOST_ORDERS, N // 10))
    R = np.array([sum(float(e[: e.size - l] @ e[l:]) for e in eps) for l in range(most + 1)]) / max(N, 1)
    a, variance = np.ones(1), R[0]
    best, least = (a, variance), math.inf
    for k in range(most + 1):
        criterion = math.log(max(variance, 1e-300)) + k * math.log(max(N, 2)) / max(N, 1)
        if criterion < least:
            best, least = (a, float(variance)), criterion
        if k == most or variance <= 1e-12 * R[0]:
            break
        reflection = -float(a @ R[k + 1 : 0 : -1]) / variance
        extended = np.append(a, 0.0)
        a = extended + reflection * extended[::-1]
        variance *= 1 - reflection**2
    return best
