"""The polynomial of taylor_series.py for eight lanes at a time; the numbers that A multiplies stay in registers."""

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.llvm_vectors import EIGHT, FOUR, fused, load8, spread8, store, where_at_least
from monitor_core.kernel.tables import Product
from monitor_core.kernel.taylor_series import INVERSE

_ZERO, _ONE, _TWO, _EIGHT = (np.uint64(k) for k in (0, 1, 2, EIGHT))
_GROUP = np.uint64(FOUR * EIGHT)


@kernel
def _times_eight(
    lane: int, lanes: int, F: Product, V: Floats, base: int, t: int, out: int, scale: Floats, work: Floats
) -> None:
    """As _times_one, for eight lanes from ``lane`` on."""
    start, col, part_start, part_place, part_col, part_slot = (
        F.A_start, F.A_at, F.part_start, F.part_place, F.part_at, F.part_slot
    )  # fmt: skip
    a, W, n, wide = np.uint64(lane), np.uint64(lanes), np.uint64(F.n), np.uint64(F.blocks * EIGHT)
    s, group = load8(scale, _ZERO), _ZERO
    while group < wide:
        r, q, v = _ZERO, _ZERO, a
        b, o, c = np.uint64(base) + group, np.uint64(out) + group, np.uint64(t) + group
        while r < n:
            r += _ONE
            last = start[r]
            t0 = t1 = t2 = t3 = spread8(0.0)
            if (last - q) & _ONE:
                w, d = load8(V, v), c + col[q]
                t0, t1 = w * load8(work, d), w * load8(work, d + np.uint64(8))
                t2, t3 = w * load8(work, d + np.uint64(16)), w * load8(work, d + np.uint64(24))
                q += _ONE
                v += W
            while q < last:
                w, u = load8(V, v), load8(V, v + W)
                d, f = c + col[q], c + col[q + _ONE]
                t0 = t0 + fused(u, load8(work, f), w * load8(work, d))
                t1 = t1 + fused(u, load8(work, f + np.uint64(8)), w * load8(work, d + np.uint64(8)))
                t2 = t2 + fused(u, load8(work, f + np.uint64(16)), w * load8(work, d + np.uint64(16)))
                t3 = t3 + fused(u, load8(work, f + np.uint64(24)), w * load8(work, d + np.uint64(24)))
                q += _TWO
                v += W + W
            store(work, o, fused(s, t0, load8(work, b)))
            store(work, o + np.uint64(8), fused(s, t1, load8(work, b + np.uint64(8))))
            store(work, o + np.uint64(16), fused(s, t2, load8(work, b + np.uint64(16))))
            store(work, o + np.uint64(24), fused(s, t3, load8(work, b + np.uint64(24))))
            b += wide
            o += wide
        group += _GROUP
    x, q, m = np.uint64(t) + wide - _EIGHT, _ZERO, _ZERO
    while q < part_place.size:
        place = np.uint64(out) + part_place[q]
        q += _ONE
        last = part_start[q]
        total = spread8(0.0)
        while m < last:
            total = fused(load8(V, part_slot[m] + a), load8(work, x + part_col[m]), total)
            m += _ONE
        store(work, place, fused(s, total, load8(work, place)))


@outlined
def advance_eight(
    a: int,
    W: int,
    F: Product,
    V: Floats,
    G: Floats,
    h: Floats,
    steps: Ints,
    terms: Ints,
    X: Floats,
    work: Floats,
    scratch: Floats,
) -> None:
    """Propagate lanes a .. a + 7 of W."""
    n, p, blocks = F.n, F.p, F.blocks
    size = n * blocks * EIGHT
    most_steps, most_terms = 0, 0
    for e in range(EIGHT):
        most_steps, most_terms = max(most_steps, steps[a + e]), max(most_terms, terms[a + e])
        scratch[EIGHT + e] = h[a + e] / max(1, steps[a + e])
        scratch[2 * EIGHT + e] = steps[a + e]
        scratch[3 * EIGHT + e] = terms[a + e]
    zero = spread8(0.0)
    for j in range(p + 1):
        to = j if j < p else blocks - 1
        for r in range(n):
            store(work, (r * blocks + to) * EIGHT, load8(X, (j * n + r) * W + a) + zero)
            store(work, size + (r * blocks + to) * EIGHT, load8(G, (j * n + r) * W + a) + zero)
    of_steps, of_terms = load8(scratch, 2 * EIGHT), load8(scratch, 3 * EIGHT)
    for step in range(1, most_steps + 1):
        part = where_at_least(of_steps, spread8(float(step)), load8(scratch, EIGHT))
        base, t, out = size, 0 * size, 2 * size  # not the literal 0 (block.py)
        store(scratch, 0, spread8(1.0))
        for k in range(most_terms, 0, -1):
            _times_eight(a, W, F, V, base, t, out, scratch, work)
            store(scratch, 0, where_at_least(of_terms, spread8(float(k)), part * spread8(INVERSE[k])))
            base, t = 2 * size, out
            out = (4 if out == 3 * size else 3) * size
        for e in range(n * blocks):
            store(work, e * EIGHT, load8(work, e * EIGHT) + part * load8(work, t + e * EIGHT))
    for j in range(p + 1):
        to = j if j < p else blocks - 1
        for r in range(n):
            store(X, (j * n + r) * W + a, load8(work, (r * blocks + to) * EIGHT))
