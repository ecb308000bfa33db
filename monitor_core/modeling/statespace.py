"""The minimal state space of a drive: exact and in symbols, and as Laurent terms for the kernel."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from monitor_core.drive import structure
from monitor_core.drive.structure import Drive, Matrix, MatrixTerm, Parameter, Quantity
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.flat import FlatInput, FlatParameter, FlatSensor, ModelError
from monitor_core.modeling.laurent import Laurent

Entries = Mapping[tuple[int, int], Laurent]
"""A matrix by its entries that are not zero: (row, column) -> Laurent."""


@dataclass(frozen=True, slots=True)
class SymbolicDefinition:
    """``name`` = the sum of Laurent terms ``value`` in parameters and in names defined before."""

    name: str
    value: Laurent


@dataclass(frozen=True, slots=True)
class Report:
    """Counts of the elimination.

    ``flat_states``: variables whose derivative occurs in the flat equations.  ``remaining_equations``: equations that
    are left, outputs included, after all substitutions.
    """

    flat_equations: int
    flat_states: int
    remaining_equations: int


@dataclass(frozen=True, slots=True)
class StateSpace:
    """x' = A x + B u,  y = C x, with n states, m inputs and as many outputs as ``sensors``.

    ``parameters`` are those that occur in A, B, C: the user's own, and merged ones, whose ``definitions`` in terms of
    the user's ("Jm + r^2*Jg") are to be evaluated in order; ``drawn`` are all of the user's own. ``rest`` (n, 1) is the
    state of the drive moving rigidly at output 1; ``ratio`` (m, 1) the angle at the flange of each input that depends
    on the motion, while the first sensor's angle is 1.  ``speed_states``: for each sensor, the state that is the speed
    there up to a factor, -1 if there is none. ``notes`` are sentences on what was left out and why.
    """

    name: str
    states: tuple[Quantity, ...]
    inputs: tuple[FlatInput, ...]
    sensors: tuple[FlatSensor, ...]
    A: Entries
    B: Entries
    C: Entries
    rest: Entries
    ratio: Entries
    speed_states: tuple[int, ...]
    parameters: tuple[FlatParameter, ...]
    drawn: tuple[FlatParameter, ...]
    definitions: tuple[SymbolicDefinition, ...]
    report: Report
    notes: tuple[str, ...]

    @property
    def shapes(self) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
        """Rows and columns of A, B, C."""
        n, m, outputs = len(self.states), len(self.inputs), len(self.sensors)
        return (n, n), (n, m), (outputs, n)


# --- The numeric model ------------------------------------------------------------------------------------------------


def drive_of(ss: StateSpace) -> Drive:
    """The drive in the form of the kernel: one torque, one sensor.

    Raises:
        ModelError: more than one motor torque or sensor; friction or gravity at a flange whose motion does not follow
            from the sensor.
    """
    _check_single(ss)
    _check_ratios(ss)
    matrices: dict[Matrix, Entries] = {"A": ss.A, "B": ss.B, "C": ss.C, "rest": ss.rest, "ratio": ss.ratio}
    return Drive(
        name=ss.name,
        output="speed" if ss.sensors[0].quantity == "speed" else "angle",
        states=ss.states,
        inputs=tuple(u.kind for u in ss.inputs),
        parameters=tuple(_parameter(p) for p in ss.parameters),
        terms=tuple(term for name, entries in matrices.items() for term in _terms(name, entries)),
        speed_state=ss.speed_states[0],
        definitions=tuple(structure.Definition(d.name, _numbers(d.value)) for d in ss.definitions),
        drawn=tuple(_parameter(p) for p in ss.drawn),
    )


def nominal_of(ss: StateSpace, values: Mapping[str, float] | None = None) -> dict[str, float]:
    """The known nominal values of the drive's parameters; ``values`` take precedence over drawn ones.

    Values may be given for the user's own parameters and for merged ones.
    """
    known = {p.name: p.value for p in ss.drawn if p.value is not None} | dict(values or {})
    for definition in ss.definitions:
        if definition.name not in known and definition.value.names <= known.keys():
            known[definition.name] = float(definition.value.value(known))
    return {p.name: known[p.name] for p in ss.parameters if p.name in known}


def _check_single(ss: StateSpace) -> None:
    torques = tuple(u for u in ss.inputs if u.kind == TORQUE)
    every: dict[str, tuple[FlatInput | FlatSensor, ...]] = {"motor torque": torques, "sensor": ss.sensors}
    for what, found in every.items():
        if len(found) != 1:
            names = ", ".join(each.name for each in found)
            raise ModelError(f"an axis has one {what}, this drive has {len(found)}: {names}", found[-1].origin)


def _check_ratios(ss: StateSpace) -> None:
    for k, u in enumerate(ss.inputs):
        if u.angle and (k, 0) not in ss.ratio:
            raise ModelError(
                f"the motion at {u.angle}, which {u.name} depends on, does not follow from what the sensor measures: "
                "no springs or dampers join the two, or one of them is held",
                u.origin,
            )


def _parameter(p: FlatParameter) -> Parameter:
    return Parameter(p.name, p.unit or "1", p.meaning or p.name, p.positive, p.nonnegative)


def _terms(matrix: Matrix, entries: Entries) -> Iterator[MatrixTerm]:
    for (row, col), entry in sorted(entries.items()):
        for coefficient, powers in _numbers(entry):
            yield MatrixTerm(matrix, row, col, coefficient, powers)


def _numbers(value: Laurent) -> tuple[tuple[float, tuple[tuple[str, int], ...]], ...]:
    return tuple((float(c), monomial) for monomial, c in value)
