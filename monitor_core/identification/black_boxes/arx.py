"""ARX models of high order: the reference for the grey box (paper, section 4), and where starting values come from.

    y(t) + a_1 y(t-1) + .. + a_n y(t-n) = b_1 u(t-1) + .. + b_n u(t-n) + c + e(t)

c is an offset of each record.  Least squares over the rows without missing values (Ljung, System Identification, 2nd
ed., 4.2 and 7.3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.black_boxes.frequency_response import (
    Complexes,
    FrequencyResponse,
    by_gradient,
    on_circle,
)
from monitor_core.identification.records.record import Bools, Record
from monitor_core.identification.records.uniform_grid import Regular, on_grid, stretches
from monitor_core.kernel.compile import entry

_LARGEST = 200
"""Order up to which AIC is looked at, unless told."""


@dataclass(frozen=True, eq=False)
class Arx:
    """An ARX model of order n."""

    interval_s: float
    a: Floats  # (n,) a_1 .. a_n
    b: Floats  # (n,) b_1 .. b_n
    offset: Floats  # (records,) c, in units of y
    root: (
        Floats  # (2 n, r) with lam0 root root' the covariance of (a, b); r: how many numbers the records tell
    )
    lam0: float  # variance of e
    rows: int  # equations behind it

    def response(self, frequency_hz: ArrayLike, name: str = "") -> FrequencyResponse:
        """G = B / A with its variance by the delta method:  dG/da_i = -z^-i G / A,  dG/db_i = z^-i / A.

        Raises:
            ValueError: a frequency beyond half the sampling frequency.
        """
        f, z = on_circle(frequency_hz, self.interval_s)
        past: Complexes = z[:, None] ** -np.arange(1.0, self.a.size + 1)
        A = 1 + past @ self.a
        G: Complexes = (past @ self.b) / A
        dG: Complexes = np.hstack([-past * G[:, None], past]) / A[:, None]
        return by_gradient(f, G, dG, np.sqrt(self.lam0) * self.root, name or f"ARX, order {self.a.size}")


def fit_arx(
    records: Sequence[Record] | Sequence[Regular],
    order: int | None = None,
    *,
    largest: int | None = None,
) -> Arx:
    """The ARX model of one or several records.

    Args:
        records: with one interval; where a sample is missing, the rows that need it are left out.
        order: n; None: that of least AIC.
        largest: order up to which AIC is looked at; default 200 or a tenth of the samples.

    Raises:
        ValueError: an order below 1, irregular samples, or fewer rows than parameters.
    """
    series = on_grid(records)
    known = sum(int(record.known.sum()) for record in series)
    n = (largest or max(1, min(_LARGEST, known // 10))) if order is None else order
    if n < 1:
        raise ValueError(f"order {n}: need 1 at least")
    constants = len(series)
    blocks = [Lags(0, 0, n), Lags(1, 1, n), *(Lags(ONES + k, 0, 0) for k in range(constants))]
    # c, y(t-1), u(t-1), y(t-2), .., y(t): then the factor contains those of all lower orders, too.
    pairs = [column for lag in range(1, n + 1) for column in (lag, n + lag)]
    columns = np.array([*range(2 * n + 1, 2 * n + 1 + constants), *pairs, 0], dtype=np.int64)
    found = factor(series, blocks, columns)
    if found.rows <= columns.size:
        raise ValueError(
            f"{found.rows} rows without a missing sample for {columns.size - 1} parameters of an ARX model of order"
            f" {n}: a longer record, fewer gaps or a lower order is needed"
        )
    if order is None and (best := least_order(found.R, found.rows, constants)) < n:
        return fit_arx(series, best)
    return _model(found, columns, n, series[0].interval_s)


def _model(found: Factor, columns: Ints, n: int, interval_s: float) -> Arx:
    R, N = found
    p = R.shape[0] - 1
    theta, root = solve(R, p)
    rss = float(np.sum((R[:, -1] - R[:, :p] @ theta) ** 2))
    place = np.argsort(columns[:-1])
    theta, root = theta[place], root[place]
    root[:n] *= -1
    a, b, c = np.split(theta, [n, 2 * n])
    return Arx(interval_s, -a, b, c, root[: 2 * n], rss / (N - root.shape[1]), N)


# --- Least squares over many rows: the triangular factor of all rows, from the Gram matrix or, if needed, by QR -------


_WORST = 1e-10
"""Reciprocal condition of the Gram matrix below which its square root has too few digits."""
_HIDDEN = 1e-12
"""Of the largest singular value: a direction in which the columns, scaled to length one, do not extend."""
_AT_ONCE = 4096
"""Rows of the tall matrix in memory."""

ONES = 2
"""Signal 2 + k is 1 in record k and 0 in the others; 0 and 1 are y and u."""


class Factor(NamedTuple):
    """R (c, c), upper triangular, with R' R the Gram matrix of all rows; how many there were."""

    R: Floats
    rows: int


class Solution(NamedTuple):
    """theta (p,) of least norm, and root (p, r) with root root' = (Phi' Phi)^+; r is the rank."""

    theta: Floats
    root: Floats


def factor(records: Sequence[Regular], blocks: Sequence[Lags], order: Ints) -> Factor:
    """The triangular factor of the rows of all records without missing values.

    ``blocks`` are columns of y (0), u (1) and the constants of the records (2, 3, ..), taken in the ``order`` (c,).
    """
    c = sum(block.width for block in blocks)
    G, N = np.zeros((c, c)), 0
    for z, a, b in _parts(records, blocks):
        G += gram(z, blocks, a, b)
        N += b - a
    R = _root(G[np.ix_(order, order)])
    return Factor(_by_qr(records, blocks, order) if R is None else R, N)


def solve(R: Floats, p: int) -> Solution:
    """Least squares of the last column of R on the first p."""
    scale = np.linalg.norm(R[:p, :p], axis=0)
    scale[scale == 0] = 1.0
    T = R[:p, :p] / scale
    if _reciprocal_condition(T) > np.sqrt(_WORST):
        inverse = sla.solve_triangular(T, np.eye(p))
        return Solution(sla.solve_triangular(T, R[:p, -1]) / scale, inverse / scale[:, None])
    U, s, Vt = np.linalg.svd(T)
    seen = s > _HIDDEN * s.max(initial=0.0)
    root = (Vt[seen].T / s[seen]) / scale[:, None]
    return Solution(root @ (U[:, seen].T @ R[:p, -1]), root)


def least_order(R: Floats, N: int, before: int) -> int:
    """The order n of least  N log(RSS / N) + 2 p  (Akaike), RSS of every order read off the last column of R (c, c).

    Its columns are those ``before``, which every order has, two for each order, and the right-hand side; N rows.
    """
    below = np.cumsum(R[::-1, -1] ** 2)[::-1]
    orders = np.arange(1, (R.shape[0] - 1 - before) // 2 + 1)
    p = 2 * orders + before
    # A record without noise: the residual is rounding, and more parameters would fit only that.
    rss = np.maximum(below[p], 1e-20 * below[0])
    return int(orders[np.argmin(N * np.log(rss / N) + p * 2.0)])


def _parts(records: Sequence[Regular], blocks: Sequence[Lags]) -> Iterator[tuple[Floats, int, int]]:
    """The signals (2 + records, N) of each record with each range of rows in it."""
    own = np.eye(len(records))
    for k, record in enumerate(records):
        constants = np.repeat(own[k][:, None], record.y.size, axis=1)
        z = np.vstack([record.y, record.u, constants])
        known = [record.y_known, record.u_known, *np.ones_like(constants, dtype=np.bool_)]
        for a, b in rows(known, blocks):
            yield z, a, b


def _root(G: Floats) -> Floats | None:
    """R with R' R = G, or None where that would lose digits."""
    d = np.sqrt(np.diag(G))
    if not (d > 0).all():
        return None
    scaled = G / np.outer(d, d)
    try:
        R = sla.cholesky(scaled)
    except np.linalg.LinAlgError:
        return None
    rcond, _ = sla.lapack.dpocon(R, np.abs(scaled).sum(axis=0).max())
    return R * d if rcond > _WORST else None


def _by_qr(records: Sequence[Regular], blocks: Sequence[Lags], order: Ints) -> Floats:
    R = np.zeros((order.size, order.size))
    for z, a, b in _parts(records, blocks):
        for k in range(a, b, _AT_ONCE):
            part = regressors(z, blocks, k, min(k + _AT_ONCE, b))[:, order]
            R = np.asarray(np.linalg.qr(np.vstack([R, part]), mode="r"))
    return R


def _reciprocal_condition(T: Floats) -> float:
    if not np.diag(T).all():
        return 0.0
    trcon: Callable[[Floats], tuple[float, int]] = sla.lapack.dtrcon
    return float(trcon(T)[0])


# --- Gram matrices of lagged signals, exactly, without the tall matrix of the regressors ------------------------------


# With rows t = a .. b-1 and columns z_i(t - l) the matrix  G = sum_t phi(t) phi(t)'  has along each diagonal
# G[i l+1, j m+1] = G[i l, j m] + z_i(a-1-l) z_j(a-1-m) - z_i(b-1-l) z_j(b-1-m)
# so only its first rows need sums over the record (Morf and Kailath's displacement structure of covariance lattices).


class Lags(NamedTuple):
    """Columns z(t - first) .. z(t - last) of a signal."""

    signal: int
    first: int
    last: int

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.last - self.first + 1


def rows(known: Sequence[Bools], blocks: Sequence[Lags]) -> list[tuple[int, int]]:
    """Ranges (a, b) of t in which every z(t - lag) of every column is known; ``known`` (N,) for each signal."""
    N = known[0].size
    good = np.ones(N, np.bool_)
    for block in blocks:
        unknown = np.concatenate([[0], np.cumsum(~known[block.signal])])
        t = np.arange(N)
        low, high = t - block.last, t - block.first
        good &= low >= 0
        good &= unknown[np.minimum(high, N - 1) + 1] == unknown[np.maximum(low, 0)]
    return stretches(good)


def gram(signals: Floats, blocks: Sequence[Lags], a: int, b: int) -> Floats:
    """G (c, c) of the rows t = a .. b-1 of signals (s, N), a at least the largest lag; columns as in the blocks."""
    table = np.array([[block.signal, block.first, block.width] for block in blocks], dtype=np.int64)
    c = int(table[:, 2].sum())
    G = np.zeros((c, c))
    _gram(np.ascontiguousarray(signals, dtype=np.float64), table, a, b, G)
    return G


def regressors(signals: Floats, blocks: Sequence[Lags], a: int, b: int) -> Floats:
    """The tall matrix itself (b - a, c), for cases where its square would lose too many digits."""
    out = [signals[z, a - lag : b - lag] for z, first, last in blocks for lag in range(first, last + 1)]
    return np.array(out).T


@entry
def _gram(z: Floats, blocks: Ints, a: int, b: int, G: Floats) -> None:
    row = 0
    for p in range(blocks.shape[0]):
        column = row
        for q in range(p, blocks.shape[0]):
            _block(z[blocks[p, 0]], blocks[p, 1], blocks[p, 2], z[blocks[q, 0]], blocks[q, 1], blocks[q, 2],
                   a, b, G[row : row + blocks[p, 2], column : column + blocks[q, 2]])  # fmt: skip
            column += blocks[q, 2]
        row += blocks[p, 2]
    for i in range(G.shape[0]):
        for j in range(i):
            G[i, j] = G[j, i]


@entry
def _block(x: Floats, k0: int, k: int, y: Floats, l0: int, l: int, a: int, b: int, G: Floats) -> None:
    """Lags k0 .. k0+k-1 of x by lags l0 .. l0+l-1 of y."""
    first = x[a - k0 : b - k0]
    for j in range(l):
        G[0, j] = np.dot(first, y[a - l0 - j : b - l0 - j])
    first = y[a - l0 : b - l0]
    for i in range(1, k):
        G[i, 0] = np.dot(x[a - k0 - i : b - k0 - i], first)
    for i in range(1, k):
        for j in range(1, l):
            m, n = k0 + i, l0 + j
            G[i, j] = G[i - 1, j - 1] + x[a - m] * y[a - n] - x[b - m] * y[b - n]
