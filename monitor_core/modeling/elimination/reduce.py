"""The steps of the elimination in order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from monitor_core.arrays import Ints
from monitor_core.drive.structure import Output
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.elimination.balances import balances_of
from monitor_core.modeling.elimination.minimal import Counts, Reduction
from monitor_core.modeling.elimination.operators import Operator, Row
from monitor_core.modeling.elimination.pruning import pruned
from monitor_core.modeling.elimination.rational import Field
from monitor_core.modeling.elimination.substitution import Line, System, distances, orders_of
from monitor_core.modeling.flat import FlatModel, FlatSensor, ModelError, Symbol
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modular import krylov_basis, null_space, points_of, residues
from monitor_core.modeling.statespace import StateSpace

MOST_RATIONAL = 120
"""Parameters of a drive that needs rational functions: beyond, sympy would take minutes."""
MOST_RATIONAL_EQUATIONS = 900
"""Flat equations, the same: some sixty masses."""


def eliminate(flat: FlatModel, output: Output | None = None) -> StateSpace:
    """The minimal state space of a drive; ``output`` replaces the drawn quantity of its sensors.

    Raises:
        ModelError: the drive has no torque, no sensor, no path between them, is locked, or its equations cannot be
            solved;
            the text names the component.
    """
    _check_complete(flat)
    try:
        ss = pruned(_reduce(flat, output, None))
    except NotLaurentError:
        ss = _with_rational_functions(flat, output)
    return replace(ss, notes=ss.notes + hidden(ss))


def _with_rational_functions(flat: FlatModel, output: Output | None) -> StateSpace:
    parameters, equations = len(flat.parameters), len(flat.equations)
    if parameters > MOST_RATIONAL or equations > MOST_RATIONAL_EQUATIONS:
        raise ModelError(
            f"flanges without inertia between springs or dampers, {parameters} parameters and {equations} equations: "
            f"that is solved for up to {MOST_RATIONAL} and {MOST_RATIONAL_EQUATIONS}; give each such flange an "
            "inertia, or leave parts out",
            flat.origin,
        )
    try:
        return pruned(_reduce(flat, output, Field(p.name for p in flat.parameters)))
    except NotLaurentError as error:
        raise ModelError(
            f"its equations cannot be written with sums of products of parameters: {error} would have to be divided "
            "by; give the flange without inertia an inertia of its own",
            flat.origin,
        ) from None


def _check_complete(flat: FlatModel) -> None:
    if not any(u.kind == TORQUE for u in flat.inputs):
        raise ModelError("no motor torque acts on the drive: draw a torque source", flat.origin)
    if not flat.sensors:
        raise ModelError("nothing is measured: draw a speed sensor or an angle sensor", flat.origin)


def _reduce(flat: FlatModel, output: Output | None, field: Field | None) -> Reduction:
    rows: list[Row] = [_row(equation.terms) for equation in flat.equations]
    stiff, differentiated = _stiff(flat, rows), _differentiated(rows)
    orders = orders_of(flat, rows)
    far = distances(rows, [u.name for u in flat.inputs if u.kind == TORQUE])
    keep, drawn = _keep(flat, far), tuple(p.name for p in flat.parameters)
    torques = _torques(flat)
    lines = [
        Line(row if field is None else field.row(row), equation.origin, torques.isdisjoint(row))
        for row, equation in zip(rows, flat.equations, strict=True)
    ]
    origins = {v.name: v.origin for v in flat.variables}
    inputs = frozenset(u.name for u in flat.inputs)
    system = System(lines, _watched(flat, field), orders, inputs, keep, drawn, origins=origins)
    balances = balances_of(system)
    sensors = tuple(FlatSensor(s.name, s.angle, output or s.quantity, s.origin) for s in flat.sensors)
    counts = Counts(len(flat.equations), len(flat.variables), differentiated, len(system.lines))
    return Reduction(flat, sensors, balances, stiff, far, field, counts, system.definitions)


def _row(terms: Mapping[Symbol, Laurent]) -> Row:
    row: dict[str, Operator] = {}
    for (name, power), c in terms.items():
        if c:
            row.setdefault(name, {})[power] = c
    return row


def _keep(flat: FlatModel, far: dict[str, int]) -> dict[str, tuple[int, ...]]:
    """Preference of variables to keep: angles of inertias, others, deflections; near the motor first; drawn first."""
    return {
        v.name: (v.prefer - v.relative, -far.get(v.name, len(far)), -k) for k, v in enumerate(flat.variables)
    }


def _torques(flat: FlatModel) -> set[str]:
    """All variables that are not a motion."""
    moving = {v.name for v in flat.variables if v.unit.startswith("rad")}
    return {v.name for v in flat.variables if v.name not in moving} | {u.name for u in flat.inputs}


def _watched(flat: FlatModel, field: Field | None) -> dict[str, Row]:
    """Deflections, the angles of sensors and those that inputs depend on: they must be known in the end."""
    unit = Laurent.number(1) if field is None else field.element(Laurent.number(1))
    names = [v.name for v in flat.variables if v.relative]
    names += [s.angle for s in flat.sensors] + [u.angle for u in flat.inputs if u.angle]
    return {name: {name: {0: unit}} for name in names}


def _stiff(flat: FlatModel, rows: list[Row]) -> tuple[str, ...]:
    """The relative angles that a torque depends on: those of springs."""
    torques = _torques(flat)
    relative = [v.name for v in flat.variables if v.relative]
    laws = [row for row in rows if not torques.isdisjoint(row)]
    return tuple(name for name in relative if any(0 in row.get(name, {}) for row in laws))


def _differentiated(rows: list[Row]) -> int:
    return len({name for row in rows for name, operator in row.items() if max(operator) > 0})


# --- What is left of the states that no input moves or no sensor sees, for whatever values of the parameters ----------


# An example: a part that is coupled to a grounded one by a damper only.  Its momentum and the angle that the damper
# has turned by add up to a constant, so an angle sensor there measures a state that no torque can change.

MOST_STATES = 60
"""The check takes time with the cube of the states."""

_SEED = 2439  # arbitrary: a wrong rank would need a coincidence modulo primes near 2^31


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
