"""A, B, C and their derivatives at the current theta: sums of Laurent terms."""

from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel
from monitor_core.kernel.vector import EIGHT, load8, store


@kernel
def evaluate(
    lanes: Any,
    slot: Ints,
    factor_start: Ints,
    factor_par: Ints,
    factor_exp: Ints,
    V0: Floats,
    coef: Floats,
    theta: Floats,
    V: Floats,
) -> None:
    """V = V0 + sum of coef * prod theta_i^e_i, for every slot that has a monitored parameter.

    ``slot`` is in order.  ``V`` (slots + 1, W) must hold V0 in all other slots.
    """
    W = len(lanes)
    for j in range(slot.size):
        s = slot[j]
        begins = j == 0 or slot[j - 1] != s
        if isinstance(lanes, tuple):
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
                terms = load8(coef, j * W + a)
                for f in range(factor_start[j], factor_start[j + 1]):
                    base = load8(theta, factor_par[f] * W + a)
                    for _ in range(factor_exp[f]):
                        terms = terms * base
                    for _ in range(-factor_exp[f]):
                        terms = terms / base
                store(V, s * W + a, (load8(V0, s * W + a) if begins else load8(V, s * W + a)) + terms)
