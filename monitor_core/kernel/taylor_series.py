"""X(h) of propagate.py as a polynomial, by Horner's scheme, with the vectors z_1 .. z_p, x side by side.

    X(h) = X + h w_1,   w_K = b,   w_(k-1) = b + (h / k) F w_k,   b = F X + G

In F = [A A_i; 0 A] all of z_1 .. z_p, x are multiplied by the same A.  So here X is n rows of ``blocks`` numbers:
z_1 .. z_p, zeros up to a multiple of four, and x last.  An entry of A is loaded once and multiplies them all.  One axis
is computed four of these numbers at a time, many axes eight lanes at a time (taylor_series_lanes.py).  Both sum in the
same order, with the A_i (which multiply x only) last.

Lanes that need fewer terms or substeps than others get terms that are exactly zero, so the result of a lane does not
depend on its neighbours.  0.0 is added to the first addend of each sum, so that no sum is -0.0 and the sign of those
zeros has no effect.
"""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.llvm_vectors import FOUR, fused, load4, spread4, store
from monitor_core.kernel.tables import Product

MOST_TERMS = 19
INVERSE = np.array([0.0] + [1.0 / k for k in range(1, MOST_TERMS + 1)])

SECTIONS = 5
"""Number of sections of the work array: X, G, b and two for w."""

_ZERO, _ONE, _TWO, _FOUR = (np.uint64(k) for k in (0, 1, 2, FOUR))


@kernel
def _times_one(F: Product, V: Floats, more: Floats, base: int, t: int, out: int, scale: float, work: Floats) -> None:
    """Out = base + scale F t, where each is a section of ``work``."""
    start, col, more_start, more_col = F.A_start, F.A_at, F.more_start, F.more_at
    n, wide, group, x = np.uint64(F.n), np.uint64(F.blocks), _ZERO, np.uint64(t + F.blocks - 1)
    s = spread4(scale)
    while group < wide:
        r, q, m = _ZERO, _ZERO, _ZERO
        b, o, c = np.uint64(base) + group, np.uint64(out) + group, np.uint64(t) + group
        while r < n:
            r += _ONE
            last = start[r]
            total = spread4(0.0)
            if (last - q) & _ONE:
                total = spread4(V[q]) * load4(work, c + col[q])
                q += _ONE
            while q < last:
                product = spread4(V[q]) * load4(work, c + col[q])
                total = total + fused(spread4(V[q + _ONE]), load4(work, c + col[q + _ONE]), product)
                q += _TWO
            total = fused(s, total, load4(work, b))
            last = more_start[r]
            if m < last:
                extra = spread4(0.0)
                while m < last:
                    extra = fused(load4(more, m * wide + group), spread4(work[x + more_col[m]]), extra)
                    m += _ONE
                total = fused(s, extra, total)
            store(work, o, total)
            b += wide
            o += wide
        group += _FOUR


@outlined
def advance_one(
    F: Product, V: Floats, G: Floats, h: float, steps: int, terms: int, X: Floats, work: Floats, more: Floats
) -> None:
    """Propagate X of one axis over h, in ``steps`` substeps with ``terms`` terms; ``work`` and ``more`` are scratch."""
    n, p, blocks, more_slot = F.n, F.p, F.blocks, F.more_slot
    size = n * blocks
    for e in range(more_slot.size):
        more[e] = V[more_slot[e]]
    for j in range(p + 1):
        to = j if j < p else blocks - 1
        for r in range(n):
            work[r * blocks + to] = X[j * n + r] + 0.0
            work[size + r * blocks + to] = G[j * n + r] + 0.0
    part = h / max(1, steps)
    for _ in range(steps):
        base, t, out, scale = size, 0 * size, 2 * size, 1.0  # not the literal 0 (block.py)
        for k in range(terms, 0, -1):
            _times_one(F, V, more, base, t, out, scale, work)
            scale = part * INVERSE[k]
            base, t = 2 * size, out
            out = (4 if out == 3 * size else 3) * size
        for e in range(size):
            work[e] += part * work[t + e]
    for j in range(p + 1):
        to = j if j < p else blocks - 1
        for r in range(n):
            X[j * n + r] = work[r * blocks + to]
