"""What is left of the states that no input moves or no sensor sees, for whatever values of the parameters.

An example: a part that is coupled to a grounded one by a damper only.  Its momentum and the angle that the damper
has turned by add up to a constant, so an angle sensor there measures a state that no torque can change.
"""

from __future__ import annotations

from monitor_core.arrays import Ints
from monitor_core.modeling.modular import krylov_basis, null_space, points_of, residues
from monitor_core.modeling.statespace import StateSpace

MOST_STATES = 60
"""The check takes time with the cube of the states."""

_SEED = 2439  # any will do: a wrong rank needs a coincidence modulo primes near 2^31


def hidden(ss: StateSpace) -> tuple[str, ...]:
    """One sentence for each kind of defect, naming the states that take part in it; none if the form is minimal."""
    if len(ss.states) > MOST_STATES:
        return (f"more than {MOST_STATES} states: not checked whether all of them are moved and seen",)
    n, m, q = len(ss.states), len(ss.inputs), len(ss.sensors)
    point = next(points_of(ss, _SEED))
    A, B, C = (residues(e, s, point) for e, s in ((ss.A, (n, n)), (ss.B, (n, m)), (ss.C, (q, n))))
    unmoved = null_space(krylov_basis(A, B, point.prime), point.prime)
    unseen = null_space(krylov_basis(A.T, C.T, point.prime), point.prime)
    found = (("no input changes", unmoved), ("no sensor sees", unseen))
    return tuple(
        f"{what} a certain combination of the states {_names(ss, vectors)}"
        for what, vectors in found
        if len(vectors)
    )


def _names(ss: StateSpace, vectors: Ints) -> str:
    taking_part = (vectors != 0).any(axis=0)
    return ", ".join(state.name for state, part in zip(ss.states, taking_part, strict=True) if part)
