"""Exact zero-order hold over one interval: the action of exp(F h) on (z, x, u), never the matrix.

With inputs held, the extended system of the paper (eq. 18-19)

    x'   = A x + B u
    z_i' = A z_i + A_i x + B_i u + B u_i          A_i = dA/dtheta_i,  u_i = du/dtheta_i

has the Taylor series  x(h) = x + sum_k t_k,  t_1 = h x',  t_k = (h/k) A t_(k-1), and alike for z.  It converges
at the rate of r = h ||D^-1 A D||, D the balancing diagonal.  D itself need not be applied: its entries are powers
of two, so the balanced series has the very same digits; it only sharpens r.  Intervals with r > 1 are split.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from monitor_core.kernel.tables import Constants, Floats, Ints, Tables

_TAIL = 1e-16
_RATES = np.array([0.0] + [(_TAIL * math.factorial(k)) ** (1 / k) for k in range(1, 20)])
"""Largest r for which r^k / k!, the first term of the derivative left out after k + 1 terms, is below _TAIL."""


@njit(cache=True, nogil=True)
def split(lanes: Any, tables: Tables, con: Constants, V: Floats, h: Floats, steps: Ints, order: Ints) -> None:
    """Number of substeps and of Taylor terms that each lane needs for its interval h (W,) in s."""
    for a in range(len(lanes)):
        norm = 0.0
        total = 0.0
        for e in range(tables.ends[0]):
            if e > 0 and tables.row[e] != tables.row[e - 1]:
                norm = max(norm, total)
                total = 0.0
            total += abs(V[e, a]) * con.weight[e, a]
        r = max(norm, total) * h[a]
        steps[a] = math.ceil(r)
        r /= max(1, steps[a])
        k = 1
        while k < _RATES.size - 1 and _RATES[k] < r:
            k += 1
        order[a] = k + 1


@njit(cache=True, nogil=True)
def _slope(
    lanes: Any, tables: Tables, V: Floats, u: Floats, du: Floats, scale: Floats, t: Floats, out: Floats
) -> None:
    """The first term: out = scale (A t + B u) for x and scale (A t_i + A_i t_x + B_i u + B u_i) for z_i."""
    n, p, m = tables.n, tables.p, tables.m
    _times_A(lanes, tables, V, scale, t, out)
    for s in range(tables.ends[0], tables.ends[1]):
        r, c = tables.row[s], tables.col[s]
        for a in range(len(lanes)):
            out[p, r, a] += scale[a] * V[s, a] * u[c, a]
        if tables.filtered_speed:
            for i in range(p):
                for a in range(len(lanes)):
                    out[i, r, a] += scale[a] * V[s, a] * du[i, c, a]
    for s in range(tables.ends[3], tables.ends[4]):
        i, r, c = tables.par[s], tables.row[s], tables.col[s]
        for a in range(len(lanes)):
            out[i, r, a] += scale[a] * V[s, a] * u[c, a]


@njit(cache=True, nogil=True)
def _times_A(lanes: Any, tables: Tables, V: Floats, scale: Floats, t: Floats, out: Floats) -> None:
    """out = scale (A t) for x and scale (A t_i + A_i t_x) for z_i; x is the last of the p + 1 vectors."""
    n, p = tables.n, tables.p
    for j in range(p + 1):
        for r in range(n):
            for a in range(len(lanes)):
                out[j, r, a] = 0.0
        for s in range(tables.ends[0]):
            r, c = tables.row[s], tables.col[s]
            for a in range(len(lanes)):
                out[j, r, a] += V[s, a] * t[j, c, a]
    for s in range(tables.ends[2], tables.ends[3]):
        i, r, c = tables.par[s], tables.row[s], tables.col[s]
        for a in range(len(lanes)):
            out[i, r, a] += V[s, a] * t[p, c, a]
    for j in range(p + 1):
        for r in range(n):
            for a in range(len(lanes)):
                out[j, r, a] *= scale[a]


@njit(cache=True, nogil=True)
def propagate(
    lanes: Any,
    tables: Tables,
    V: Floats,
    u: Floats,
    du: Floats,
    h: Floats,
    steps: Ints,
    order: Ints,
    X: Floats,
    t: Floats,
    t_next: Floats,
    scale: Floats,
) -> None:
    """Move X (p + 1, n, W) = (z_1 .. z_p, x) over h (W,) with u, du held.  A lane with h = 0 stays as it is.

    Lanes that need fewer substeps or terms than others get terms that are exactly zero, so a lane's result does
    not depend on its neighbours.  ``t``, ``t_next`` (as X) and ``scale`` (W,) are scratch.
    """
    n, p = tables.n, tables.p
    most_steps = 0
    most_terms = 0
    for a in range(len(lanes)):
        most_steps = max(most_steps, steps[a])
        most_terms = max(most_terms, order[a])
    for step in range(most_steps):
        for a in range(len(lanes)):
            scale[a] = h[a] / steps[a] if step < steps[a] else 0.0
        _slope(lanes, tables, V, u, du, scale, X, t)
        for k in range(2, most_terms + 2):
            for j in range(p + 1):
                for r in range(n):
                    for a in range(len(lanes)):
                        X[j, r, a] += t[j, r, a]
            if k > most_terms:
                break
            for a in range(len(lanes)):
                scale[a] = h[a] / (steps[a] * k) if step < steps[a] and k <= order[a] else 0.0
            _times_A(lanes, tables, V, scale, t, t_next)
            t, t_next = t_next, t
