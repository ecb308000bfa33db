"""Gram matrices of lagged signals, exactly, without the tall matrix of the regressors.

With rows t = a .. b-1 and columns z_i(t - l) the matrix  G = sum_t phi(t) phi(t)'  has along each diagonal

    G[i l+1, j m+1] = G[i l, j m] + z_i(a-1-l) z_j(a-1-m) - z_i(b-1-l) z_j(b-1-m)

so only its first rows need sums over the record (Morf and Kailath's displacement structure of covariance lattices).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.record import Bools
from monitor_core.kernel.compile import entry


class Lags(NamedTuple):
    """Columns z(t - first) .. z(t - last) of a signal."""

    signal: int
    first: int
    last: int

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.last - self.first + 1


def rows(known: Sequence[Bools], blocks: Sequence[Lags]) -> Iterator[tuple[int, int]]:
    """Ranges (a, b) of t in which every z(t - lag) of every column is known.

    Args:
        known: (N,) for each signal, where it is.
        blocks: the columns.
    """
    N = known[0].size
    good = np.ones(N, np.bool_)
    for block in blocks:
        unknown = np.concatenate([[0], np.cumsum(~known[block.signal])])
        t = np.arange(N)
        low, high = t - block.last, t - block.first
        good &= low >= 0
        good &= unknown[np.minimum(high, N - 1) + 1] == unknown[np.maximum(low, 0)]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.view(np.int8), [0]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def gram(signals: Floats, blocks: Sequence[Lags], a: int, b: int) -> Floats:
    """G (c, c) of the rows t = a .. b-1, columns in the order of the blocks.

    Args:
        signals: (s, N) the signals.
        blocks: the columns, c in all.
        a: first row; a is at least the largest lag.
        b: one after the last row.
    """
    table = np.array([[block.signal, block.first, block.width] for block in blocks], dtype=np.int64)
    c = int(table[:, 2].sum())
    G = np.zeros((c, c))
    _gram(np.ascontiguousarray(signals, dtype=np.float64), table, a, b, G)
    return G


def regressors(signals: Floats, blocks: Sequence[Lags], a: int, b: int) -> Floats:
    """The tall matrix itself (b - a, c), for where its square would lose too many digits."""
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
