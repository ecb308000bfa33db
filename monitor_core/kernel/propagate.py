"""Exact zero-order hold over one interval: the action of exp(F h) on (z, x, u) without forming the matrix.

With inputs held, the extended system of the paper (eq. 18-19)

    x'   = A x + B u
    z_i' = A z_i + A_i x + B_i u + B u_i          A_i = dA/dtheta_i,  u_i = du/dtheta_i

is X' = F X + G, and X(h) = X + sum_k t_k with t_1 = h (F X + G), t_k = (h/k) F t_(k-1).  The series converges at the
rate of r = h ||D^-1 A D||, where D is the balancing diagonal.  D itself is not applied: its entries are powers of two,
so the balanced series has exactly the same digits.  D only gives a sharper r.  Intervals with r > 1 are split.
"""

import math
from typing import Any

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, part
from monitor_core.kernel.llvm_vectors import EIGHT, larger, load8, magnitude, spread8, store
from monitor_core.kernel.tables import InputTerms, LaurentTerms, Product
from monitor_core.kernel.taylor_series import advance_one
from monitor_core.kernel.taylor_series_lanes import advance_eight

_TAIL = 1e-13
_RATES = np.array([0.0] + [(_TAIL * math.factorial(k)) ** (1 / k) for k in range(1, 18)])
"""Largest r for which r^k / k!, the first omitted term of the derivative after k + 1 terms, is below _TAIL."""

MOST_STEPS = 1000
"""Largest number of substeps, more than any interval below the gap limit needs; beyond it (or for NaN) the lane
diverges."""


@kernel
def _norms(lanes: Any, A_row: Ints, weight: Floats, V: Floats, norm: Floats) -> None:
    """||D^-1 A D|| (W,), the largest row sum of magnitudes."""
    W = len(lanes)
    if len(lanes) == 1:
        most = total = 0.0
        for e in range(A_row.size):
            if e > 0 and A_row[e] != A_row[e - 1]:
                most, total = max(most, total), 0.0
            total += abs(V[e, 0]) * weight[e, 0]
        norm[0] = max(most, total)
    else:
        for a in range(0, W, EIGHT):
            mosts = totals = spread8(0.0)
            for e in range(A_row.size):
                if e > 0 and A_row[e] != A_row[e - 1]:
                    mosts, totals = larger(mosts, totals), spread8(0.0)
                totals = totals + magnitude(load8(V, e * W + a)) * load8(weight, e * W + a)
            store(norm, a, larger(mosts, totals))


@kernel
def choose_substeps(
    lanes: Any, A_row: Ints, weight: Floats, V: Floats, h: Floats, steps: Ints, terms: Ints, norm: Floats
) -> None:
    """Number of substeps and of Taylor terms that each lane needs for its interval h (W,) in s.

    ``norm`` (W,) is scratch.  On entry ``terms`` contains the numbers of the last interval, which usually do not
    change.
    """
    _norms(lanes, A_row, weight, V, norm)
    for a in range(len(lanes)):
        r = norm[a] * h[a]
        steps[a] = math.ceil(r) if r < MOST_STEPS else MOST_STEPS
        r /= max(1, steps[a])
        k = max(1, terms[a] - 1)
        while k > 1 and _RATES[k - 1] >= r:
            k -= 1
        while k < _RATES.size - 1 and _RATES[k] < r:
            k += 1
        terms[a] = k + 1


@kernel
def evaluate_inputs(lanes: Any, inputs: InputTerms, V: Floats, u: Floats, du: Floats, G: Floats) -> None:
    """G ((p + 1) n, W): B u for x, B_i u + B u_i for z_i."""
    row, slot, col, par = inputs.row, inputs.slot, inputs.col, inputs.par
    m, W = u.shape
    for r in range(G.shape[0]):
        for a in range(W):
            G[r, a] = 0.0
    for q in range(row.size):
        r, s, c, i = row[q], slot[q], col[q], par[q]
        if len(lanes) == 1:
            G[r, 0] += V[s, 0] * (u[c, 0] if i < 0 else du[i, c, 0])
        else:
            for a in range(0, len(lanes), EIGHT):
                held = load8(u, c * W + a) if i < 0 else load8(du, (i * m + c) * W + a)
                store(G, r * W + a, load8(G, r * W + a) + load8(V, s * W + a) * held)


@part
def propagate(
    lanes: Any,
    F: Product,
    V: Floats,
    G: Floats,
    h: Floats,
    steps: Ints,
    terms: Ints,
    X: Floats,
    work: Floats,
    more: Floats,
) -> None:
    """Propagate X = (z_1 .. z_p, x) over h (W,).  A lane with h = 0 stays as it is.  V, G, X are flat here."""
    if len(lanes) == 1:
        advance_one(F, V, G, h[0], steps[0], terms[0], X, work, more)
    else:
        for a in range(0, len(lanes), EIGHT):
            advance_eight(a, len(lanes), F, V, G, h, steps, terms, X, work, more)


# --- A, B, C and their derivatives at the current theta: sums of Laurent terms ----------------------------------------


@kernel
def evaluate_coefficients(lanes: Any, terms: LaurentTerms, V0: Floats, coef: Floats, theta: Floats, V: Floats) -> None:
    """V = V0 + sum of coef * prod theta_i^e_i, for each slot with a monitored parameter.

    ``V`` (slots + 1, W) must contain V0 in all other slots.
    """
    slot, factor_start, factor_par, factor_exp = terms.slot, terms.start, terms.par, terms.exp
    W = len(lanes)
    for j in range(slot.size):
        s = slot[j]
        begins = j == 0 or slot[j - 1] != s
        if len(lanes) == 1:
            term = coef[j, 0]
            for f in range(factor_start[j], factor_start[j + 1]):
                i = factor_par[f]
                for _ in range(factor_exp[f]):
                    term *= theta[i, 0]
                for _ in range(-factor_exp[f]):
                    term /= theta[i, 0]
            V[s, 0] = (V0[s, 0] if begins else V[s, 0]) + term
        else:
            for a in range(0, W, EIGHT):
                total = load8(coef, j * W + a)
                for f in range(factor_start[j], factor_start[j + 1]):
                    base = load8(theta, factor_par[f] * W + a)
                    for _ in range(factor_exp[f]):
                        total = total * base
                    for _ in range(-factor_exp[f]):
                        total = total / base
                store(V, s * W + a, (load8(V0, s * W + a) if begins else load8(V, s * W + a)) + total)
