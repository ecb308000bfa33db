"""Tests of the prediction errors: are they white, are they independent of the input (Ljung, 16.6)?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import fftconvolve
from scipy.special import chdtrc, ndtri  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats
from monitor_core.identification.residual_spectrum import scores_covariance

LAGS = 25
LEVEL = 0.99
"""Of confidence limits."""

_SEEN = 1e-8


class Correlation(NamedTuple):
    """A correlation function with its limit under the hypothesis, and the test of all lags together."""

    lags: Floats  # (L,)
    values: Floats  # (L,)
    limit: float  # 99 % of single values stay within +- this
    p_value: float  # of a sum of squares as large as this one or larger, were the hypothesis true


def whiteness(eps: Sequence[Floats], lags: int = LAGS) -> Correlation:
    """Autocorrelation of the errors of records at lags 1 .. L; Ljung and Box's test.  Missing ones are zero."""
    N, r = _counts(eps), _correlation(eps, eps, lags)
    r = r[lags + 1 :] / r[lags]
    Q = N * (N + 2) * float(np.sum(r**2 / (N - np.arange(1, lags + 1))))
    limit = float(ndtri((1 + LEVEL) / 2)) / math.sqrt(N)
    return Correlation(np.arange(1.0, lags + 1), r, limit, float(chdtrc(lags, Q)))


def independence(u: Sequence[Floats], eps: Sequence[Floats], lags: int = LAGS) -> Correlation:
    """Correlation of eps(t) with u(t - l) for lags -L .. L.

    Negative lags show feedback.  The test takes 1 .. L together; it knows that neighbouring values go together where
    the input is not white, and that eps need not be white (colour.py).
    """
    u = [part - part.mean() for part in u]
    r = _correlation(eps, u, lags)
    size = math.sqrt(_power(u) * _power(eps))
    if size == 0:
        return Correlation(np.arange(-lags, lags + 1.0), 0 * r, 0.0, 1.0)
    covariance, _ = scores_covariance(eps, [_past(part, lags) for part in u])
    limit = float(ndtri((1 + LEVEL) / 2)) * math.sqrt(float(np.mean(np.diag(covariance)))) / size
    return Correlation(np.arange(-lags, lags + 1.0), r / size, limit, _p_value(r[lags + 1 :], covariance))


def _p_value(r: Floats, covariance: Floats) -> float:
    """Chi-square test of r = 0.  Of a band-limited input, some combinations of its past values are always zero."""
    values, vectors = np.linalg.eigh(covariance)
    seen = values > _SEEN * values[-1]
    Q = float(np.sum((vectors[:, seen].T @ r) ** 2 / values[seen]))
    return float(chdtrc(int(seen.sum()), Q))


def _past(u: Floats, lags: int) -> Floats:
    """u(t - 1) .. u(t - L), zero before the record (N, L)."""
    padded = np.concatenate([np.zeros(lags), u])
    return np.stack([padded[lags - l : padded.size - l] for l in range(1, lags + 1)], axis=1)


def _power(parts: Sequence[Floats]) -> float:
    return sum(float(part @ part) for part in parts)


def _counts(eps: Sequence[Floats]) -> int:
    return sum(int(np.count_nonzero(part)) for part in eps)


def _correlation(left: Sequence[Floats], right: Sequence[Floats], lags: int) -> Floats:
    """sum_t left(t) right(t - l) over all records, l = -L .. L."""
    total = np.zeros(2 * lags + 1)
    for a, b in zip(left, right, strict=True):
        most = min(lags, a.size - 1)
        full = fftconvolve(a, b[::-1])
        middle = b.size - 1
        total[lags - most : lags + most + 1] += full[middle - most : middle + most + 1]
    return total
