"""A, B, C and their derivatives at the current theta: sums of Laurent terms."""

from typing import Any

from monitor_core.kernel.compile import kernel
from monitor_core.kernel.tables import Floats, Ints


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
    term: Floats,
) -> None:
    """V = V0 + sum of coef * prod theta_i^e_i, for every slot that has a monitored parameter.

    ``V`` (slots + 1, W) must hold V0 in all other slots; ``term`` (W,) is scratch.
    """
    for j in range(slot.size):
        for a in range(len(lanes)):
            V[slot[j], a] = V0[slot[j], a]
    for j in range(slot.size):
        for a in range(len(lanes)):
            term[a] = coef[j, a]
        for f in range(factor_start[j], factor_start[j + 1]):
            i = factor_par[f]
            for _ in range(factor_exp[f]):
                for a in range(len(lanes)):
                    term[a] *= theta[i, a]
            for _ in range(-factor_exp[f]):
                for a in range(len(lanes)):
                    term[a] /= theta[i, a]
        for a in range(len(lanes)):
            V[slot[j], a] += term[a]
