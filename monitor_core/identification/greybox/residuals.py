"""Tests whether prediction errors are white and independent of the input (Ljung, 16.6); covariance of the estimates."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.special import chdtrc, chdtri, ndtri  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats, Ints
from monitor_core.excitation.accuracy import Accuracy

_LAGS = 25
LEVEL = 0.99
"""Level of confidence limits"""
_WITHIN = float(ndtri((1 + LEVEL) / 2))
"""Standard deviations within which this share of a normal distribution lies"""
_SEEN = 1e-8


class Correlation(NamedTuple):
    """A correlation function with its limit under the hypothesis, and the test of all lags together."""

    lags: Floats  # (L,)
    values: Floats  # (L,)
    limit: float  # 99 % of single values stay within +- this
    p_value: float  # probability of at least this sum of squares if the hypothesis is true


def whiteness(eps: Sequence[Floats]) -> Correlation:
    """Autocorrelation of the errors of records at lags 1 .. L; Ljung and Box's test.  Missing errors are zero."""
    N, r, lags = _count(eps), _correlation(eps, eps), np.arange(1.0, _LAGS + 1)
    if r[_LAGS] == 0:  # a signal that repeats itself is explained in every digit
        return Correlation(lags, 0 * r[_LAGS + 1 :], 0.0, 1.0)
    r = r[_LAGS + 1 :] / r[_LAGS]
    Q = N * (N + 2) * float(np.sum(r**2 / (N - lags)))
    return Correlation(lags, r, _WITHIN / math.sqrt(N), float(chdtrc(_LAGS, Q)))


def independence(u: Sequence[Floats], eps: Sequence[Floats]) -> Correlation:
    """Correlation of eps(t) with u(t - l) for lags -L .. L.

    Negative lags show feedback.  The test takes 1 .. L together; it allows for an input that is not white,
    whose neighbouring values are correlated, and for errors that are not (``scores_covariance``).
    """
    u = [part - part.mean() for part in u]
    r, lags = _correlation(eps, u), np.arange(-_LAGS, _LAGS + 1.0)
    size = math.sqrt(_power(u) * _power(eps))
    if size == 0:
        return Correlation(lags, 0 * r, 0.0, 1.0)
    covariance, _ = scores_covariance(eps, [_past(part) for part in u])
    limit = _WITHIN * math.sqrt(float(np.mean(np.diag(covariance)))) / size
    return Correlation(lags, r / size, limit, _p_value(r[_LAGS + 1 :], covariance))


def _p_value(r: Floats, covariance: Floats) -> float:
    """Chi-square test of r = 0.  Of a band-limited input, some combinations of its past values are always zero."""
    values, vectors = np.linalg.eigh(covariance)
    seen = values > _SEEN * values[-1]
    Q = float(np.sum((vectors[:, seen].T @ r) ** 2 / values[seen]))
    return float(chdtrc(int(seen.sum()), Q))


def _past(u: Floats) -> Floats:
    """u(t - 1) .. u(t - L), zero before the record (N, L)."""
    padded = np.concatenate([np.zeros(_LAGS), u[:-1]])
    return np.lib.stride_tricks.sliding_window_view(padded, _LAGS)[:, ::-1]  # no copy: it would be 25 times u


def _power(parts: Sequence[Floats]) -> float:
    return sum(float(part @ part) for part in parts)


def _count(eps: Sequence[Floats]) -> int:
    return sum(int(np.count_nonzero(part)) for part in eps)


def _correlation(left: Sequence[Floats], right: Sequence[Floats]) -> Floats:
    """sum_t left(t) right(t - l) over all records, l = -L .. L."""
    total = np.zeros(2 * _LAGS + 1)
    for a, b in zip(left, right, strict=True):
        most = min(_LAGS, a.size - 1)
        for l in range(-most, most + 1):
            total[_LAGS + l] += float(a[max(l, 0) : a.size + min(l, 0)] @ b[max(-l, 0) : b.size - max(l, 0)])
    return total


# --- Spectrum of coloured prediction errors, by an autoregressive model -----------------------------------------------


# eps(t) + a_1 eps(t-1) + .. + a_k eps(t-k) = e(t),       Phi(omega) = var e / |1 + a_1 z^-1 + ..|^2
# The order is Schwarz's: zero for white errors, which then change nothing.

MOST_ORDERS = 60
_AT_ONCE = 16_384
"""Samples that are worked on at once: of an hour of them, single intermediate results would take half a gigabyte"""
_RUNG_OUT = 1e-9
"""Share of its largest value below which the rest of a filtered signal does not matter"""


def scores_covariance(eps: Sequence[Floats], psi: Sequence[Floats]) -> tuple[Floats, int]:
    """Covariance (p, p) of sum psi(t) eps(t), for errors that do not depend on psi, and the order of the model.

        sum_ts psi(t) R(t - s) psi(s)' = var e sum_t phi(t) phi(t)',     phi(t) + a_1 phi(t-1) + .. = psi(t)

    over records, R the errors' autocovariance: as a sum of squares, so that no rounding can make it negative.  Missing
    errors are zero.
    """
    a, variance = autoregression(eps)
    p = psi[0].shape[1]
    out = np.zeros((p, p))
    for J in psi:
        for phi in _filtered(J, a):
            out += phi.T @ phi
    return variance * out, a.size - 1


def _filtered(J: Floats, a: Floats) -> Iterator[Floats]:
    """The columns (N, p) filtered by 1 / a, block by block, with what follows until it has rung out: N at most."""
    state, largest = np.zeros((a.size - 1, J.shape[1])), 0.0
    for block in _blocks(len(J)):
        phi, state = lfilter([1.0], a, J[block], axis=0, zi=state)
        largest = max(largest, float(np.abs(phi).max()))
        yield phi
    for block in _blocks(len(J)):
        if not float(np.abs(state).max(initial=0.0)) > _RUNG_OUT * largest:
            return
        phi, state = lfilter([1.0], a, np.zeros((block.stop - block.start, J.shape[1])), axis=0, zi=state)
        yield phi


def _blocks(count: int) -> Iterator[slice]:
    """Slices of at most ``_AT_ONCE`` of so many samples."""
    return (slice(at, min(at + _AT_ONCE, count)) for at in range(0, count, _AT_ONCE))


def autoregression(eps: Sequence[Floats]) -> tuple[Floats, float]:
    """1, a_1 .. a_k and the variance of e, by Levinson's recursion; order k by Schwarz's criterion."""
    N = _count(eps)
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


# --- Covariance of the estimates, without initial states, valid also for coloured prediction errors -------------------


_EXPLAINED = 1e-12
_FEWEST_CELLS = 4
"""With fewer cells that matter, nothing can be said of their differences."""
_BY_CHANCE = 1e-3
"""Probability that a standard deviation is increased although the errors do not depend on the cell"""


class Information(NamedTuple):
    """Information on the parameters in the records."""

    accuracy: Accuracy  # relative to the sizes, with the directions that are not determined
    covariance: Floats  # (p, p) of the estimates; infinite variance and NaN where they cannot be determined
    white: Floats  # (p, p) covariance for white errors of the same variance
    order: int  # of the errors' autoregressive model; 0: white
    excess: Floats  # (p,) ratios to these standard deviations, with errors that come back with the motion; at least 1


def information(
    names: Sequence[str],
    sizes: Floats,
    gradients: Sequence[Floats],
    starts: Sequence[Floats],
    eps: Sequence[Floats],
    variance: float,
    cells: Sequence[Ints] = (),
) -> Information:
    """Covariance of estimates by prediction errors.

        cov = (J'J)^-1 S (J'J)^-1,     S = sum_ts psi(t) R(t - s) psi(s)'

    which for white errors is lambda_0 (J'J)^-1, J being what the initial states cannot explain of the gradients.  R has
    the errors of neighbouring samples alone.  With ``cells`` it is found, too, how much larger the standard deviations
    are because errors of samples far apart are alike.

    Args:
        names: of the p parameters.
        sizes: (p,) units in which they are compared: their own size, for most.
        gradients: (N, p) psi of each record.
        starts: (N, n) gradient by the record's initial state; n may be 0.
        eps: (N,) errors, of each record, zero where missing.
        variance: of the errors, lambda_0.
        cells: (N,) of each record, the cell of the motion of each sample (``motion_cells``).
    """
    scaled = [_unexplained(psi, start, sizes) for psi, start in zip(gradients, starts, strict=True)]
    R = _triangular(scaled)
    accuracy = Accuracy(tuple(names), R, np.sqrt(variance) if variance > 0 else 1e-300)
    S, order = scores_covariance(eps, scaled)
    white = accuracy.covariance * np.outer(sizes, sizes)
    inverse = accuracy.inverse_information(1.0)
    known = np.isfinite(np.diag(accuracy.covariance))
    covariance, excess = accuracy.covariance.copy(), np.ones(len(names))
    if order:
        covariance[np.ix_(known, known)] = (inverse @ S @ inverse)[np.ix_(known, known)]
    if cells and known.any():
        excess[known] = _excess(scaled, inverse[:, known], eps, cells, np.diag(covariance)[known])
    if not order:
        return Information(accuracy, white, white, 0, excess)
    with np.errstate(invalid="ignore"):
        coloured = covariance * np.outer(sizes, sizes)
        return Information(_consistent(accuracy, covariance), coloured, white, order, excess)


def _triangular(psi: Sequence[Floats]) -> Floats:
    """R (p, p) of the QR factors of all records together, block by block: the factors of a part replace it."""
    R = np.zeros((0, psi[0].shape[1]))
    for J in psi:
        for block in _blocks(len(J)):
            R = np.asarray(np.linalg.qr(np.concatenate([R, J[block]]), mode="r"))
    return R


def _excess(
    psi: Sequence[Floats], inverse: Floats, eps: Sequence[Floats], cells: Sequence[Ints], variances: Floats
) -> Floats:
    """Ratios (k,) of standard deviations to those expected, where errors depend on the cell; 1: no such excess shows.

        variance = sum_c s_c^2 K / (K - 1),     s_c = sum_(t in c) change(t) eps(t),     K = (sum_c w_c)^2 / sum_c w_c^2

    K being the number of cells that matter, w_c their sums of change^2.  Errors that do not depend on the cell give the
    expected variance, with K - 1 degrees of freedom (Satterthwaite's): an excess must be beyond chance.

    Args:
        psi: (N, p) gradients of each record.
        inverse: (p, k) with which they give the change of each estimate per unit of the error.
        eps: (N,) errors of each record.
        cells: (N,) cell of each sample.
        variances: (k,) of the estimates, expected.
    """
    count = 1 + max(int(cell.max()) for cell in cells)
    scores, weights = np.zeros((2, count, inverse.shape[1]))
    for J, e, cell in zip(psi, eps, cells, strict=True):
        for block in _blocks(len(J)):
            change = J[block] @ inverse
            scores += _sums(change * e[block, np.newaxis], cell[block], count)
            weights += _sums(change**2, cell[block], count)
    with np.errstate(invalid="ignore", divide="ignore"):
        freedom = weights.sum(axis=0) ** 2 / (weights**2).sum(axis=0) - 1
        ratio = (scores**2).sum(axis=0) * (freedom + 1) / freedom / variances
        beyond = (freedom > _FEWEST_CELLS - 1) & (ratio * freedom > chdtri(freedom, _BY_CHANCE))
    return np.sqrt(np.where(beyond, ratio, 1.0))


def _sums(values: Floats, cell: Ints, count: int) -> Floats:
    """Sums (count, k) of values (N, k) in each cell."""
    return np.stack([np.bincount(cell, weights=column, minlength=count) for column in values.T], axis=1)


def _consistent(accuracy: Accuracy, covariance: Floats) -> Accuracy:
    """The accuracy with this covariance, as if the errors were white; unchanged if a variance is infinite."""
    if not np.isfinite(covariance).all():
        return accuracy
    sd = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    if values[0] <= 0:
        return accuracy
    root = (vectors / np.sqrt(values)).T / sd
    return Accuracy(accuracy.names, root * accuracy.noise, accuracy.noise)


def _unexplained(psi: Floats, start: Floats, sizes: Floats) -> Floats:
    """The part of the columns of psi that those of ``start`` do not explain, times ``sizes``."""
    if not start.shape[1]:
        return psi * sizes
    lengths = np.linalg.norm(start, axis=0)
    left, values, _ = np.linalg.svd(start / np.where(lengths > 0, lengths, 1.0), full_matrices=False)
    left = left[:, values > _EXPLAINED * values.max(initial=0.0)]
    out, along = np.empty_like(psi), left.T @ psi
    for block in _blocks(len(psi)):
        out[block] = (psi[block] - left[block] @ along) * sizes
    return out
