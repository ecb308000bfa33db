"""From the exact state space to the numeric model: the Laurent terms that the kernel takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from monitor_core.drive.structure import Definition, Drive, Matrix, Output, Parameter, Term
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.flat import FlatParameter, ModelError
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Entries, StateSpace


def drive_of(ss: StateSpace) -> Drive:
    """The drive in the form of the kernel: one torque, one sensor.

    Raises:
        ModelError: more than one motor torque or sensor; friction or gravity at a flange whose motion does not follow
            from
            the sensor.
    """
    _check_single(ss)
    _check_ratios(ss)
    (sensor,) = ss.sensors
    matrices: tuple[tuple[Matrix, Entries], ...] = (
        ("A", ss.A),
        ("B", ss.B),
        ("C", ss.C),
        ("rest", ss.rest),
        ("ratio", ss.ratio),
    )
    return Drive(
        name=ss.name,
        output=_output(sensor.quantity),
        states=ss.states,
        inputs=tuple(u.kind for u in ss.inputs),
        parameters=tuple(_parameter(p) for p in ss.parameters),
        terms=tuple(term for name, entries in matrices for term in _terms(name, entries)),
        speed_state=ss.speed_states[0],
        definitions=tuple(Definition(d.name, _numbers(d.value)) for d in ss.definitions),
        drawn=tuple(_parameter(p) for p in ss.drawn),
    )


def nominal_of(ss: StateSpace, values: Mapping[str, float] | None = None) -> dict[str, float]:
    """Nominal values of the drive's parameters, as far as they are known; ``values`` take precedence over drawn ones.

    Values may be given for the user's own parameters and for merged ones.
    """
    known = {p.name: p.value for p in ss.drawn if p.value is not None} | dict(values or {})
    for definition in ss.definitions:
        if definition.name not in known and definition.value.names <= known.keys():
            known[definition.name] = float(definition.value.value(known))
    return {p.name: known[p.name] for p in ss.parameters if p.name in known}


def _check_single(ss: StateSpace) -> None:
    torques = [u for u in ss.inputs if u.kind == TORQUE]
    if len(torques) != 1:
        names = ", ".join(u.name for u in torques)
        raise ModelError(
            f"an axis has one motor torque, this drive has {len(torques)}: {names}", torques[-1].origin
        )
    if len(ss.sensors) != 1:
        names = ", ".join(s.name for s in ss.sensors)
        raise ModelError(
            f"an axis has one sensor, this drive has {len(ss.sensors)}: {names}", ss.sensors[-1].origin
        )


def _check_ratios(ss: StateSpace) -> None:
    for k, u in enumerate(ss.inputs):
        if u.angle and (k, 0) not in ss.ratio:
            raise ModelError(
                f"the motion at {u.angle}, which {u.name} depends on, cannot be told from what the sensor measures: "
                "no springs or dampers join the two, or one of them is held",
                u.origin,
            )


def _output(quantity: str) -> Output:
    return "speed" if quantity == "speed" else "angle"


def _parameter(p: FlatParameter) -> Parameter:
    return Parameter(p.name, p.unit or "1", p.meaning or p.name, p.positive)


def _terms(matrix: Matrix, entries: Entries) -> Iterator[Term]:
    for (row, col), entry in sorted(entries.items()):
        for coefficient, powers in _numbers(entry):
            yield Term(matrix, row, col, coefficient, powers)


def _numbers(value: Laurent) -> tuple[tuple[float, tuple[tuple[str, int], ...]], ...]:
    return tuple((float(c), monomial) for monomial, c in value)
