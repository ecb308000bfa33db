"""Exact zero-order hold over one interval: the action of exp(F h) on (z, x, u), never the matrix.

With inputs held, the extended system of the paper (eq. 18-19)

    x'   = A x + B u
    z_i' = A z_i + A_i x + B_i u + B u_i          A_i = dA/dtheta_i,  u_i = du/dtheta_i

is X' = F X + G, and X(h) = X + sum_k t_k with t_1 = h (F X + G), t_k = (h/k) F t_(k-1).  The series converges at the
rate of r = h ||D^-1 A D||, D the balancing diagonal.  D itself need not be applied: its entries are powers of two, so
the balanced series has the very same digits; it only sharpens r.  Intervals with r > 1 are split.
"""

import math
from typing import Any

import numpy as np

from monitor_core.kernel.compile import kernel
from monitor_core.kernel.tables import Floats, Indices, Ints

_TAIL = 1e-13
_RATES = np.array([0.0] + [(_TAIL * math.factorial(k)) ** (1 / k) for k in range(1, 18)])
"""Largest r for which r^k / k!, the first term of the derivative left out after k + 1 terms, is below _TAIL."""

MOST_STEPS = 1000
"""More substeps than any interval below the gap limit needs; a norm beyond that (or NaN) makes the lane diverge."""


@kernel
def split(lanes: Any, A_row: Ints, weight: Floats, V: Floats, h: Floats, steps: Ints, terms: Ints) -> None:
    """Number of substeps and of Taylor terms that each lane needs for its interval h (W,) in s."""
    for a in range(len(lanes)):
        norm = 0.0
        total = 0.0
        for e in range(A_row.size):
            if e > 0 and A_row[e] != A_row[e - 1]:
                norm = max(norm, total)
                total = 0.0
            total += abs(V[e, a]) * weight[e, a]
        r = max(norm, total) * h[a]
        steps[a] = math.ceil(r) if r < MOST_STEPS else MOST_STEPS
        r /= max(1, steps[a])
        k = 1
        while k < _RATES.size - 1 and _RATES[k] < r:
            k += 1
        terms[a] = k + 1


@kernel
def drive(
    lanes: Any,
    row: Ints,
    slot: Ints,
    col: Ints,
    par: Ints,
    V: Floats,
    u: Floats,
    du: Floats,
    G: Floats,
) -> None:
    """G ((p + 1) n, W): B u for x, B_i u + B u_i for z_i."""
    for r in range(G.shape[0]):
        for a in range(len(lanes)):
            G[r, a] = 0.0
    for q in range(row.size):
        r, s, c, i = row[q], slot[q], col[q], par[q]
        if i < 0:
            for a in range(len(lanes)):
                G[r, a] += V[s, a] * u[c, a]
        else:
            for a in range(len(lanes)):
                G[r, a] += V[s, a] * du[i, c, a]


@kernel
def propagate(
    lanes: Any,
    start: Indices,
    src: Indices,
    slot: Indices,
    V: Floats,
    G: Floats,
    h: Floats,
    steps: Ints,
    terms: Ints,
    X: Floats,
    t: Floats,
    t_next: Floats,
    scale: Floats,
) -> None:
    """Move X = (z_1 .. z_p, x) over h (W,).  A lane with h = 0 stays as it is.

    The innermost loops of the kernel: V, G, X are flat here, ``src`` and ``slot`` already multiplied by W, and every
    index is unsigned, which is what lets the compiler leave out all that is not arithmetic.  Products come in pairs:
    half the traffic of the sums, in the same order.  Lanes that need fewer substeps or terms than others get terms
    that are exactly zero, so a lane's result does not depend on its neighbours.
    ``t``, ``t_next`` (as X) and ``scale`` (W,) are scratch.
    """
    W, one, two = np.uint64(len(lanes)), np.uint64(1), np.uint64(2)
    most_steps = 0
    most_terms = 0
    for a in range(len(lanes)):
        most_steps = max(most_steps, steps[a])
        most_terms = max(most_terms, terms[a])
    for step in range(most_steps):
        for e in range(X.size):
            t[e] = X[e]
        for k in range(1, most_terms + 1):
            for a in range(len(lanes)):
                scale[a] = h[a] / (steps[a] * k) if step < steps[a] and k <= terms[a] else 0.0
            q = start[0]
            for r in range(np.uint64(start.size) - one):
                o = r * W
                s0, c0, s1, c1 = slot[q], src[q], slot[q + one], src[q + one]
                for a in range(W):
                    t_next[o + a] = V[s0 + a] * t[c0 + a] + V[s1 + a] * t[c1 + a]
                q += two
                while q < start[r + one]:
                    s0, c0, s1, c1 = slot[q], src[q], slot[q + one], src[q + one]
                    for a in range(W):
                        t_next[o + a] = (t_next[o + a] + V[s0 + a] * t[c0 + a]) + V[s1 + a] * t[c1 + a]
                    q += two
                if k == 1:
                    for a in range(W):
                        t_next[o + a] += G[o + a]
                for a in range(W):
                    t_next[o + a] *= scale[a]
                    X[o + a] += t_next[o + a]
            t, t_next = t_next, t
