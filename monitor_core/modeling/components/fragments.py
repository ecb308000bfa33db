"""The part of a component in the flat model, and the builder for its equations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.components.linear import Linear
from monitor_core.modeling.flat import FlatEquation, FlatInput, FlatSensor, FlatVariable, Origin
from monitor_core.modeling.laurent import Laurent


@dataclass(frozen=True, slots=True)
class Fragment:
    """Part of a flat model, of one component or several."""

    variables: tuple[FlatVariable, ...] = ()
    equations: tuple[FlatEquation, ...] = ()
    inputs: tuple[FlatInput, ...] = ()
    sensors: tuple[FlatSensor, ...] = ()

    def measured(self, variable: str) -> Fragment:
        """The same with one variable turned into an input: the measured motor torque."""
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

    phi: Linear
    tau: Linear


class Builder:
    """The interface of ``physics``: each call adds to the fragment and returns the quantity."""

    def __init__(self, name: str, parameters: Mapping[str, Laurent], origin: Origin) -> None:
        self.name, self.parameters, self.origin = name, parameters, origin
        self.fragment = Fragment()

    def __getitem__(self, role: str) -> Laurent:
        return self.parameters[role]

    def variable(self, name: str, unit: str, prefer: bool = False, relative: bool = False) -> Linear:
        """A new unknown, "<component>.<name>"."""
        new = FlatVariable(f"{self.name}.{name}", unit, prefer, relative, self.origin)
        self.fragment = replace(self.fragment, variables=(*self.fragment.variables, new))
        return Linear.variable(new.name)

    def flange(self, name: str) -> Flange:
        """A new flange: two unknowns, "<component>.<name>.phi" and ".tau"."""
        return Flange(self.variable(f"{name}.phi", "rad"), self.variable(f"{name}.tau", "N m"))

    def input(self, name: str, kind: int, angle: str = "") -> Linear:
        """A known signal of a kind of monitor_core.kernel.tables; ``angle`` is an unknown of this component."""
        new = FlatInput(name, kind, angle and f"{self.name}.{angle}", self.origin)
        self.fragment = replace(self.fragment, inputs=(*self.fragment.inputs, new))
        return Linear.variable(name)

    def sensor(self, angle: str, quantity: str) -> None:
        """The component is a sensor of "speed" or "angle" where its unknown ``angle`` is."""
        new = FlatSensor(self.name, f"{self.name}.{angle}", quantity, self.origin)
        self.fragment = replace(self.fragment, sensors=(*self.fragment.sensors, new))

    def equal(self, left: Linear, right: Linear) -> None:
        """An equation."""
        new = FlatEquation((left - right).terms, self.origin)
        self.fragment = replace(self.fragment, equations=(*self.fragment.equations, new))
