"""The last step: parts that the torque does not move or the sensors do not observe are left out, with a note."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.components.units import parse
from monitor_core.modeling.elimination.minimal import Dense, Reduction
from monitor_core.modeling.elimination.operators import Coefficient
from monitor_core.modeling.elimination.rational import merge, needed
from monitor_core.modeling.elimination.states import Angles
from monitor_core.modeling.flat import FlatParameter, ModelError
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Definition, Entries, Report, StateSpace

_MATRICES = ("A", "B", "C", "rest", "ratio")


def pruned(reduction: Reduction) -> StateSpace:
    """The state space of the part that the inputs move and the sensors observe.

    Raises:
        ModelError: the torque does not reach the sensors.
        NotLaurentError: an entry cannot be written as a sum of Laurent terms.
    """
    A, B = reduction.A_B()
    C, rigid = reduction.C(), rigid_angles(reduction)
    torques = [k for k, u in enumerate(reduction.inputs) if u.kind == TORQUE]
    seen = _reached({j for _, j in C}, {(j, i) for i, j in A})
    _check_path(reduction, seen & _reached({i for i, k in B if k in torques}, set(A)))
    kept = sorted(seen & _reached({i for i, _ in B}, set(A)))
    acting = sorted({k for i, k in B if i in kept})
    states, inputs = _renumbered(kept), _renumbered(acting)
    matrices = {
        "A": _cut(A, states, states),
        "B": _cut(B, states, inputs),
        "C": _cut(C, None, states),
        "rest": _cut(rest(reduction, rigid), states, None),
        "ratio": _cut(ratio(reduction, rigid), inputs, None),
    }
    return _state_space(reduction, matrices, kept, acting)


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


def _check_path(reduction: Reduction, moved: set[int]) -> None:
    if not moved:
        sensor = reduction.sensors[0]
        raise ModelError(
            f"no path leads from the motor torque to the sensor {sensor.name}: what it measures stands still, "
            "or is not connected",
            sensor.origin,
        )


def _renumbered(kept: list[int]) -> dict[int, int]:
    return {old: new for new, old in enumerate(kept)}


def _cut(matrix: Dense, rows: Mapping[int, int] | None, columns: Mapping[int, int] | None) -> Dense:
    return {
        (i if rows is None else rows[i], j if columns is None else columns[j]): c
        for (i, j), c in matrix.items()
        if (rows is None or i in rows) and (columns is None or j in columns)
    }


def _state_space(
    reduction: Reduction, matrices: dict[str, Dense], kept: list[int], acting: list[int]
) -> StateSpace:
    flat, counts = reduction.flat, reduction.counts
    exact, definitions = _laurent(reduction, matrices)
    quantities = reduction.quantities()
    occurring = {name for entries in exact.values() for entry in entries.values() for name in entry.names}
    parameters = parameters_of(flat.parameters, definitions, occurring)
    return StateSpace(
        name=flat.name,
        states=tuple(quantities[k] for k in kept),
        inputs=tuple(reduction.inputs[k] for k in acting),
        sensors=reduction.sensors,
        **exact,
        speed_states=tuple(_speed_state(reduction, k, kept) for k in range(len(reduction.sensors))),
        parameters=parameters,
        drawn=flat.parameters,
        definitions=tuple(Definition(name, value) for name, value in definitions.items()),
        report=Report(
            counts.equations, counts.variables, counts.states, counts.left + len(reduction.sensors)
        ),
        notes=_notes(reduction, kept, acting, definitions, occurring),
    )


def _laurent(
    reduction: Reduction, matrices: dict[str, Dense]
) -> tuple[dict[str, Entries], dict[str, Laurent]]:
    """The matrices in Laurent sums, and the definitions of merged parameters in them."""
    if reduction.field is None:
        entries = [c for matrix in matrices.values() for c in matrix.values()]
        return dict(matrices), needed(reduction.definitions, entries)
    places = [(name, place) for name in _MATRICES for place in matrices[name]]
    merging = merge(reduction.field, [matrices[name][place] for name, place in places])
    exact: dict[str, dict[tuple[int, int], Laurent]] = {name: {} for name in _MATRICES}
    for (name, place), entry in zip(places, merging.entries, strict=True):
        exact[name][place] = entry
    return dict(exact), needed(merging.definitions, merging.entries)


def _speed_state(reduction: Reduction, sensor: int, kept: list[int]) -> int:
    angle = reduction.angle_of(reduction.sensors[sensor].angle)
    if len(angle) != 1 or next(iter(angle)) not in reduction.columns:
        return -1
    column = reduction.columns[next(iter(angle))]
    return kept.index(column) if column in kept else -1


def _notes(
    reduction: Reduction,
    kept: list[int],
    acting: list[int],
    definitions: Mapping[str, Laurent],
    occurring: set[str],
) -> tuple[str, ...]:
    quantities = reduction.quantities()
    left_out = [quantities[k].name for k in range(reduction.size) if k not in kept]
    silent = [u.name for k, u in enumerate(reduction.inputs) if k not in acting]
    seen = occurring | {name for value in definitions.values() for name in value.names}
    idle = [p.name for p in reduction.flat.parameters if p.name not in seen]
    lines = [
        ("left out, since no sensor sees it or nothing moves it", left_out),
        ("acts on nothing that is seen", silent),
        ("has no influence on what is measured", idle),
        ("merged, since its parts cannot be told apart", [name for name in definitions if name in occurring]),
    ]
    return tuple(f"{what}: {', '.join(names)}" for what, names in lines if names)


# --- The parameters of a state space: the user's own that occur, and merged ones with unit, meaning and value ---------


_TOGETHER = "taken together: "


def parameters_of(
    drawn: Sequence[FlatParameter], definitions: Mapping[str, Laurent], occurring: Collection[str]
) -> tuple[FlatParameter, ...]:
    """The occurring parameters in the order in which they were drawn, a merged one where its first part stood."""
    known = {p.name: p for p in drawn}
    for name, value in definitions.items():
        known[name] = _merged(name, value, known)
    rank = {p.name: k for k, p in enumerate(drawn)}
    for name, value in definitions.items():
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
        origin=parts[0].origin,
    )


def _unit(value: Laurent, known: Mapping[str, FlatParameter]) -> str:
    """The unit of the first term; that all terms agree is checked when the drive is read."""
    monomial, _ = next(iter(value))
    units = [known[name].unit for name, _ in monomial]
    if not all(units):
        return ""
    total = parse("1")
    for unit, (_, power) in zip(units, monomial, strict=True):
        total = total * parse(unit) ** power
    return str(total)


# --- The drive moving rigidly: what every angle is while the first sensor's angle is 1 and no spring is deflected -----


def rigid_angles(reduction: Reduction) -> Angles:
    """Angle -> its value; what is not joined to the sensor by springs or dampers is missing."""
    sensor = reduction.angle_of(reduction.sensors[0].angle)
    if len(sensor) != 1:
        return {}
    ((name, c),) = sensor.items()
    found: Angles = {name: reduction.unit / c}
    links = [reduction.angle_of(v.name) for v in reduction.flat.variables if v.relative]
    return _spread(found, [link for link in links if len(link) == 2])


def _spread(found: Angles, links: Sequence[Angles]) -> Angles:
    changed = True
    while changed:
        changed = False
        for link in links:
            for near, far in (tuple(link), tuple(link)[::-1]):
                if near in found and far not in found:
                    found[far] = -(found[near] * link[near] / link[far])
                    changed = True
    return found


def total(angles: Angles, rigid: Angles) -> Coefficient | None:
    """A combination of angles in rigid motion; None where that is zero or not known."""
    terms = [c * rigid[name] for name, c in angles.items() if name in rigid]
    if len(terms) < len(angles) or not terms:
        return None
    value = sum(terms[1:], start=terms[0])
    return value or None


def rest(reduction: Reduction, rigid: Angles) -> Dense:
    """The state (n, 1) at rest at angle 1, or moving at speed 1, as the first sensor measures it."""
    if reduction.sensors[0].quantity == "speed":
        values = {column: rigid.get(name) for name, column in reduction.columns.items()}
    else:
        rows = enumerate(reduction.positions.rows)
        values = {reduction.position_state(k): total(row, rigid) for k, row in rows}
    return {(state, 0): c for state, c in values.items() if c}


def ratio(reduction: Reduction, rigid: Angles) -> Dense:
    """The angle (m, 1) at the flange of each input that depends on the motion."""
    values = {k: total(reduction.angle_of(u.angle), rigid) for k, u in enumerate(reduction.inputs) if u.angle}
    return {(k, 0): c for k, c in values.items() if c}
