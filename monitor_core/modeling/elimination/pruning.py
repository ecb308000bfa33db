"""The last step: removes parts that the torque does not move or the sensors do not observe, with a note."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from monitor_core.arrays import Ints
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.components.units import parse
from monitor_core.modeling.elimination.minimal import Angles, Dense, Reduction
from monitor_core.modeling.elimination.substitution import EquationSystem, needed
from monitor_core.modeling.flat import FlatParameter, ModelError
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modular import krylov_basis, null_space, points_of, residues
from monitor_core.modeling.statespace import Report, StateSpace, SymbolicDefinition


def pruned(reduction: Reduction, system: EquationSystem) -> StateSpace:
    """The state space of the part that the inputs move and the sensors observe.

    Raises:
        ModelError: the torque does not reach the sensors.
        NotLaurentError: what the first sensor measures would have to be divided by.
    """
    A, B = reduction.A_B()
    C, rigid = reduction.C(), rigid_angles(reduction)
    torques = [k for k, u in enumerate(reduction.inputs) if u.kind == TORQUE]
    seen = _reached({j for _, j in C}, {(j, i) for i, j in A})
    if not seen & _reached({i for i, k in B if k in torques}, set(A)):
        sensor = reduction.sensors[0]
        raise ModelError(
            f"no path leads from the motor torque to the sensor {sensor.name}: what it measures stands still, "
            "or is not connected",
            sensor.origin,
        )
    kept = sorted(seen & _reached({i for i, _ in B}, set(A)))
    acting = sorted({k for i, k in B if i in kept})
    every = range(max(len(reduction.sensors), 1))
    matrices = {
        "A": _cut(A, kept, kept),
        "B": _cut(B, kept, acting),
        "C": _cut(C, every, kept),
        "rest": _cut(rest(reduction, rigid), kept, every),
        "ratio": _cut(ratio(reduction, rigid), acting, every),
    }
    entries = [entry for matrix in matrices.values() for entry in matrix.values()]
    occurring = {name for entry in entries for name in entry.names}
    definitions = needed(system.definitions, entries)
    flat, quantities = reduction.flat, reduction.quantities()
    equations = len(system.lines) + len(reduction.sensors)
    return StateSpace(
        name=flat.name,
        states=tuple(quantities[k] for k in kept),
        inputs=tuple(reduction.inputs[k] for k in acting),
        sensors=reduction.sensors,
        **matrices,
        speed_states=tuple(_speed_state(reduction, sensor.angle, kept) for sensor in reduction.sensors),
        parameters=parameters_of(flat.parameters, definitions, occurring),
        drawn=flat.parameters,
        definitions=tuple(SymbolicDefinition(name, value) for name, value in definitions.items()),
        report=Report(len(flat.equations), system.flat_states, equations),
        notes=_notes(reduction, kept, acting, definitions, occurring),
    )


def _reached(start: Iterable[int], steps: Iterable[tuple[int, int]]) -> set[int]:
    """All states reached from some; a step (i, j) leads from j to i."""
    following: dict[int, set[int]] = {}
    for i, j in steps:
        following.setdefault(j, set()).add(i)
    found = set(start)
    front = list(found)
    while front:
        new = following.get(front.pop(), set()) - found
        found |= new
        front += new
    return found


def _cut(matrix: Dense, rows: Sequence[int], columns: Sequence[int]) -> Dense:
    """The entries in these rows and columns, numbered anew."""
    row, column = ({old: new for new, old in enumerate(kept)} for kept in (rows, columns))
    return {(row[i], column[j]): c for (i, j), c in matrix.items() if i in row and j in column}


def _speed_state(reduction: Reduction, angle: str, kept: list[int]) -> int:
    """The state that is the speed of this angle up to a factor, -1 if there is none."""
    columns = [reduction.columns.get(name) for name in reduction.angle_of(angle)]
    return kept.index(columns[0]) if len(columns) == 1 and columns[0] in kept else -1


def _notes(
    reduction: Reduction,
    kept: list[int],
    acting: list[int],
    definitions: Mapping[str, Laurent],
    occurring: set[str],
) -> tuple[str, ...]:
    seen = occurring | {name for value in definitions.values() for name in value.names}
    left_out = [state.name for k, state in enumerate(reduction.quantities()) if k not in kept]
    lines = {
        "left out, since no sensor observes it or no input moves it": left_out,
        "has no effect on any sensor": [u.name for k, u in enumerate(reduction.inputs) if k not in acting],
        "has no influence on what is measured": [p.name for p in reduction.flat.parameters if p.name not in seen],
        "merged, since its parts cannot be distinguished": [name for name in definitions if name in occurring],
    }
    return tuple(f"{what}: {', '.join(names)}" for what, names in lines.items() if names)


# --- The parameters of a state space: the user's own that occur, and merged ones with unit, meaning and value ---------


_TOGETHER = "taken together: "


def parameters_of(
    drawn: Sequence[FlatParameter], definitions: Mapping[str, Laurent], occurring: Collection[str]
) -> tuple[FlatParameter, ...]:
    """The occurring parameters in the order of drawing; a merged one takes the place of its first part."""
    known = {p.name: p for p in drawn}
    rank = {p.name: k for k, p in enumerate(drawn)}
    for name, value in definitions.items():
        known[name] = _merged(name, value, known)
        rank[name] = min(rank[part] for part in value.names)
    return tuple(known[name] for name in sorted(occurring, key=lambda name: (rank[name], name)))


def _merged(name: str, value: Laurent, known: Mapping[str, FlatParameter]) -> FlatParameter:
    parts = [p for p in known.values() if p.name in value.names]
    meanings = [(p.meaning or p.name).removeprefix(_TOGETHER) for p in parts]
    shown = dict.fromkeys(meaning for listed in meanings for meaning in listed.split(", "))
    numbers = {p.name: p.value for p in parts if p.value is not None}
    return FlatParameter(
        name=name,
        unit=_unit(value, known),
        meaning=_TOGETHER + ", ".join(shown),
        value=float(value.value(numbers)) if len(numbers) == len(parts) else None,
        positive=all(p.positive for p in parts) and all(c > 0 for _, c in value),
        nonnegative=all(p.positive or p.nonnegative for p in parts) and all(c > 0 for _, c in value),
        origin=parts[0].origin,
    )


def _unit(value: Laurent, known: Mapping[str, FlatParameter]) -> str:
    """The unit of the first term; that all terms agree is checked when the drive is read."""
    monomial, _ = next(iter(value))
    total = parse("1")
    for name, power in monomial:
        if not known[name].unit:
            return ""
        total = total * parse(known[name].unit) ** power
    return str(total)


# --- Rigid motion: all angles while the angle of the first sensor is 1 and no spring is deflected ---------------------


def rigid_angles(reduction: Reduction) -> Angles:
    """Values by angle; angles that are not joined to the sensor by springs or dampers are missing."""
    sensor = reduction.angle_of(reduction.sensors[0].angle)
    if len(sensor) != 1:
        return {}
    ((name, c),) = sensor.items()
    found: Angles = {name: Laurent.number(1) / c}
    links = [reduction.angle_of(v.name) for v in reduction.flat.variables if v.relative]
    pairs = [pair for link in links if len(link) == 2 for pair in (tuple(link.items()), tuple(link.items())[::-1])]
    before = 0
    while len(found) > before:
        before = len(found)
        for (near, a), (far, b) in pairs:
            if near in found and far not in found:
                with suppress(NotLaurentError):  # of a sum of stiffnesses: something holds the part
                    found[far] = -(found[near] * a / b)
    return found


def _total(angles: Angles, rigid: Angles) -> Laurent | None:
    """A combination of angles in rigid motion; None where that is zero or not known."""
    terms = [c * rigid[name] for name, c in angles.items() if name in rigid]
    if len(terms) < len(angles) or not terms:
        return None
    return sum(terms[1:], start=terms[0]) or None


def rest(reduction: Reduction, rigid: Angles) -> Dense:
    """The state (n, 1) at rest at angle 1, or moving at speed 1, as the first sensor measures it."""
    if reduction.sensors[0].quantity == "speed":
        values = {column: rigid.get(name) for name, column in reduction.columns.items()}
    else:
        rows = enumerate(reduction.positions.rows)
        values = {reduction.position_state(k): _total(row, rigid) for k, row in rows}
    return {(state, 0): c for state, c in values.items() if c}


def ratio(reduction: Reduction, rigid: Angles) -> Dense:
    """The angle (m, 1) at the flange of each input that depends on the motion."""
    values = {k: _total(reduction.angle_of(u.angle), rigid) for k, u in enumerate(reduction.inputs) if u.angle}
    return {(k, 0): c for k, c in values.items() if c}


# --- Remaining states that no input moves or no sensor observes, for any values of the parameters ---------------------


# An example: a part that is coupled to a grounded one by a damper only.  Its momentum and the angle that the damper
# has turned by add up to a constant, so an angle sensor there measures a state that no torque can change.

MOST_STATES = 60
"""Largest number of states for this check, whose time grows with their cube."""

_SEED = 2439  # arbitrary: a wrong rank would need a coincidence modulo primes near 2^31


def hidden(ss: StateSpace) -> tuple[str, ...]:
    """One sentence for each kind of defect, naming the states that take part in it; none if the form is minimal."""
    if len(ss.states) > MOST_STATES:
        return (f"more than {MOST_STATES} states: controllability and observability were not checked",)
    point = next(points_of(ss, _SEED))
    A, B, C = residues(ss, point)
    unmoved = null_space(krylov_basis(A, B, point.prime), point.prime)
    unseen = null_space(krylov_basis(A.T, C.T, point.prime), point.prime)
    found = (("no input changes", unmoved), ("no sensor observes", unseen))
    return tuple(
        f"{what} a certain combination of the states {_names(ss, vectors)}" for what, vectors in found if len(vectors)
    )


def _names(ss: StateSpace, vectors: Ints) -> str:
    taking_part = (vectors != 0).any(axis=0)
    return ", ".join(state.name for state, part in zip(ss.states, taking_part, strict=True) if part)
