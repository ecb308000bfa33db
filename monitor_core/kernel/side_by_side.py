"""One held interval, of the states and of many derivatives side by side, for the predictor at fixed theta.

What a short loop costs is its beginning.  Hence six addends in one, at places that are known when it is compiled, and
rows of zeros that make up the number.  No slices either: numba counts references to each, which takes as long.
"""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import aside


@aside
def room(size: int) -> int:
    """Rows for so many, some of them zero: the first six go in one pass, the rest by threes (force, carry)."""
    return max(6, (size + 2) // 3 * 3)


@aside
def width(p: int) -> int:
    """Columns for so many: without a remainder behind the vectors of a loop, which takes as long as all of them."""
    return (p + 7) // 8 * 8


@aside
def padded(X: Floats) -> Floats:
    """X (G, n, n + m) with room for more columns."""
    out = np.zeros((X.shape[0], X.shape[1], room(X.shape[2])))
    for g in range(X.shape[0]):
        for r in range(X.shape[1]):
            for c in range(X.shape[2]):
                out[g, r, c] = X[g, r, c]
    return out


@aside
def padded_slopes(dX: Floats, n: int, p: int) -> Floats:
    """dX (G, n + m, n q) as (G, n + m, n p) with room for more rows; zero for what has no derivative."""
    G, rows, q = dX.shape[0], dX.shape[1], dX.shape[2] // n
    out = np.zeros((G, room(rows), n * p))
    for g in range(G):
        for c in range(rows):
            for r in range(n):
                for i in range(q):
                    out[g, c, r * p + i] = dX[g, c, r * q + i]
    return out


@aside
def force(g: int, dX: Floats, w: Floats, a: int, flat: Floats) -> None:
    """Rows 0 .. n of Z_a become dX w; ``flat`` (2, rows p) is Z, all its elements side by side."""
    w0, w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4], w[5]
    for e in range(dX.shape[2]):
        some = dX[g, 0, e] * w0 + dX[g, 1, e] * w1 + dX[g, 2, e] * w2
        flat[a, e] = some + dX[g, 3, e] * w3 + dX[g, 4, e] * w4 + dX[g, 5, e] * w5
    for c in range(6, w.size, 3):
        w0, w1, w2 = w[c], w[c + 1], w[c + 2]
        for e in range(dX.shape[2]):
            flat[a, e] = flat[a, e] + dX[g, c, e] * w0 + dX[g, c + 1, e] * w1 + dX[g, c + 2, e] * w2


@aside
def carry(g: int, X: Floats, n: int, rows: int, b: int, Z: Floats) -> None:
    """Rows 0 .. n of the other Z += X Z_b, of whose rows the first ``rows`` count."""
    a, p = 1 - b, Z.shape[2]
    for r in range(n):
        x0, x1, x2, x3, x4, x5 = X[g, r, 0], X[g, r, 1], X[g, r, 2], X[g, r, 3], X[g, r, 4], X[g, r, 5]
        for i in range(p):
            some = Z[a, r, i] + x0 * Z[b, 0, i] + x1 * Z[b, 1, i] + x2 * Z[b, 2, i]
            Z[a, r, i] = some + x3 * Z[b, 3, i] + x4 * Z[b, 4, i] + x5 * Z[b, 5, i]
        for c in range(6, rows, 3):
            x0, x1, x2 = X[g, r, c], X[g, r, c + 1], X[g, r, c + 2]
            for i in range(p):
                Z[a, r, i] = Z[a, r, i] + x0 * Z[b, c, i] + x1 * Z[b, c + 1, i] + x2 * Z[b, c + 2, i]


@aside
def move(g: int, X: Floats, w: Floats, x: Floats) -> None:
    """X (x, u) into x."""
    for r in range(x.size):
        total = 0.0
        for c in range(w.size):
            total += X[g, r, c] * w[c]
        x[r] = total
