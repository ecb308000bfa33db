"""Flat equations: sums of variables, the part of a component and the builder for it, and connections."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.flat import FlatEquation, FlatInput, FlatSensor, FlatVariable, Origin, Symbol
from monitor_core.modeling.laurent import Laurent


class LinearForm:
    """An immutable sum of coefficient * d^k variable / dt^k; terms of coefficient zero are left out."""

    def __init__(self, terms: Mapping[Symbol, Laurent]) -> None:
        self.terms: dict[Symbol, Laurent] = {symbol: c for symbol, c in terms.items() if c}

    @classmethod
    def variable(cls, name: str) -> LinearForm:
        """The variable itself."""
        return cls({(name, 0): Laurent.number(1)})

    def __neg__(self) -> LinearForm:
        return LinearForm({symbol: -c for symbol, c in self.terms.items()})

    def __add__(self, other: LinearForm) -> LinearForm:
        terms = dict(self.terms)
        for symbol, c in other.terms.items():
            terms[symbol] = terms.get(symbol, Laurent()) + c
        return LinearForm(terms)

    def __sub__(self, other: LinearForm) -> LinearForm:
        return self + -other

    def __mul__(self, factor: Laurent) -> LinearForm:
        return LinearForm({symbol: c * factor for symbol, c in self.terms.items()})


def der(quantity: LinearForm) -> LinearForm:
    """The derivative with respect to time; parameters are constant."""
    return LinearForm({(name, order + 1): c for (name, order), c in quantity.terms.items()})


# --- The part of a component in the flat model ------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Fragment:
    """Part of a flat model, of one component or several."""

    variables: tuple[FlatVariable, ...] = ()
    equations: tuple[FlatEquation, ...] = ()
    inputs: tuple[FlatInput, ...] = ()
    sensors: tuple[FlatSensor, ...] = ()

    def measured(self, variable: str) -> Fragment:
        """The fragment with one variable turned into an input: the measured motor torque."""
        (signal,) = (v for v in self.variables if v.name == variable)
        variables = tuple(v for v in self.variables if v is not signal)
        inputs = (*self.inputs, FlatInput(variable, TORQUE, origin=signal.origin))
        return replace(self, variables=variables, inputs=inputs)


def join(fragments: Iterable[Fragment]) -> Fragment:
    """All fragments together; a shared input (the constant 1) is included once."""
    parts = tuple(fragments)
    inputs: dict[str, FlatInput] = {}
    for part in parts:
        for new in part.inputs:
            inputs.setdefault(new.name, new)
    return Fragment(
        variables=tuple(v for part in parts for v in part.variables),
        equations=tuple(e for part in parts for e in part.equations),
        inputs=tuple(inputs.values()),
        sensors=tuple(s for part in parts for s in part.sensors),
    )


@dataclass(frozen=True, slots=True)
class Flange:
    """Angle, and the torque that acts on the component."""

    phi: LinearForm
    tau: LinearForm


class Builder:
    """The interface of ``physics``: each call adds to the fragment and returns the quantity."""

    def __init__(self, name: str, parameters: Mapping[str, Laurent], origin: Origin) -> None:
        self.name, self.parameters, self.origin = name, parameters, origin
        self.fragment = Fragment()

    def __getitem__(self, role: str) -> Laurent:
        return self.parameters[role]

    def variable(self, name: str, unit: str, prefer: bool = False, relative: bool = False) -> LinearForm:
        """A new unknown, "<component>.<name>"."""
        new = FlatVariable(f"{self.name}.{name}", unit, prefer, relative, self.origin)
        self._add(Fragment(variables=(new,)))
        return LinearForm.variable(new.name)

    def flange(self, name: str) -> Flange:
        """A new flange: two unknowns, "<component>.<name>.phi" and ".tau"."""
        return Flange(self.variable(f"{name}.phi", "rad"), self.variable(f"{name}.tau", "N m"))

    def input(self, name: str, kind: int, angle: str = "") -> LinearForm:
        """A known signal of a kind of monitor_core.kernel.tables; ``angle`` is an unknown of this component."""
        new = FlatInput(name, kind, angle and f"{self.name}.{angle}", self.origin)
        self._add(Fragment(inputs=(new,)))
        return LinearForm.variable(name)

    def sensor(self, angle: str, quantity: str) -> None:
        """Make the component a sensor of "speed" or "angle" for its unknown ``angle``."""
        new = FlatSensor(self.name, f"{self.name}.{angle}", quantity, self.origin)
        self._add(Fragment(sensors=(new,)))

    def equal(self, left: LinearForm, right: LinearForm) -> None:
        """Add the equation left = right."""
        new = FlatEquation((left - right).terms, self.origin)
        self._add(Fragment(equations=(new,)))

    def _add(self, new: Fragment) -> None:
        self.fragment = join((self.fragment, new))


# --- Connections: connected flanges have the same angle, and their torques add up to zero -----------------------------


@dataclass(frozen=True, slots=True)
class End:
    """A flange ("motor.flange_a") as seen from a connection.

    ``outside``: the connection is inside the component that the flange belongs to (Modelica's hierarchical models); the
    flow then has the other sign.
    """

    flange: str
    outside: bool = False


@dataclass(frozen=True, slots=True)
class Joint:
    """A connection set: connected flanges, the name of the set (of a node), and where it was drawn."""

    name: str
    ends: tuple[End, ...]
    origin: Origin = field(default_factory=Origin)


def connect(joints: Iterable[Joint], flanges: Iterable[str] = ()) -> tuple[FlatEquation, ...]:
    """The equations of all connections; joints that share a flange are one.

    Args:
        joints: connection sets.
        flanges: all flanges of the drive; no torque acts on one without a connection from outside of its component.
    """
    sets = merged(joints)
    connected = {end.flange for joint in sets for end in joint.ends if not end.outside}
    free = [Joint(name, (End(name),), Origin(name)) for name in flanges if name not in connected]
    return tuple(equation for joint in (*sets, *free) for equation in _equations(joint))


def merged(joints: Iterable[Joint]) -> list[Joint]:
    """Connection sets without common flanges: those with one are merged, under the name and origin of the first."""
    sets: dict[int, Joint] = {}
    home: dict[End, int] = {}
    for number, new in enumerate(joints):
        overlapping = sorted({home[end] for end in new.ends if end in home})
        parts = [*(sets.pop(key) for key in overlapping), new]
        ends = tuple(dict.fromkeys(end for part in parts for end in part.ends))
        key = min([*overlapping, number])
        sets[key] = Joint(parts[0].name, ends, parts[0].origin)
        home.update(dict.fromkeys(ends, key))
    return [sets[key] for key in sorted(sets)]


def _equations(joint: Joint) -> Iterator[FlatEquation]:
    """n - 1 equalities of angles and one sum of torques."""
    first, *others = joint.ends
    for end in others:
        equal = LinearForm.variable(f"{first.flange}.phi") - LinearForm.variable(f"{end.flange}.phi")
        yield FlatEquation(equal.terms, joint.origin)
    torques = LinearForm({})
    for end in joint.ends:
        tau = LinearForm.variable(f"{end.flange}.tau")
        torques = torques - tau if end.outside else torques + tau
    yield FlatEquation(torques.terms, joint.origin)
