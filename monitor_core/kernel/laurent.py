"""A, B, C and their derivatives at the current theta: sums of Laurent terms."""

from typing import Any

from numba import njit

from monitor_core.kernel.tables import Constants, Floats, Tables


@njit(cache=True, nogil=True)
def evaluate(lanes: Any, tables: Tables, con: Constants, theta: Floats, V: Floats, term: Floats) -> None:
    """V = V0 + sum of coef * prod theta_i^e_i, for every slot that has a monitored parameter.

    ``V`` (slots, W) must hold V0 in all other slots; ``term`` (W,) is scratch.
    """
    for j in range(tables.term_slot.size):
        s = tables.term_slot[j]
        for a in range(len(lanes)):
            V[s, a] = con.V0[s, a]
    for j in range(tables.term_slot.size):
        s = tables.term_slot[j]
        for a in range(len(lanes)):
            term[a] = con.coef[j, a]
        for f in range(tables.factor_start[j], tables.factor_start[j + 1]):
            i, e = tables.factor_par[f], tables.factor_exp[f]
            for _ in range(e):
                for a in range(len(lanes)):
                    term[a] *= theta[i, a]
            for _ in range(-e):
                for a in range(len(lanes)):
                    term[a] /= theta[i, a]
        for a in range(len(lanes)):
            V[s, a] += term[a]
