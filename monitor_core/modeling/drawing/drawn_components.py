"""Components as a user draws them: a name, the nodes that its flanges are at, and what its parameters are.

A parameter is a string (a name, or an expression such as "1/r" or "m*l^2") or a number; left out, it is called
"<component>.<role>".  The node "ground" does not turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from monitor_core.modeling.components import KINDS, Kind
from monitor_core.modeling.flat import Origin

Value: TypeAlias = str | float


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a drawing; ``parameters`` are those that were given, by role."""

    kind: Kind
    name: str
    nodes: tuple[str, ...]
    parameters: Mapping[str, Value]
    origin: Origin = field(default_factory=Origin)


def Inertia(name: str, node: str, other: str | None = None, *, J: Value | None = None) -> Part:
    """A mass of inertia J [kg m^2]; with two nodes, it joins them rigidly."""
    return _part("inertia", name, (node, other), J=J)


def Fixed(name: str, node: str) -> Part:
    """The node does not turn, like "ground"."""
    return _part("fixed", name, (node,))


def Spring(name: str, node_a: str, node_b: str, *, c: Value | None = None) -> Part:
    """A spring of stiffness c [N m/rad]."""
    return _part("spring", name, (node_a, node_b), c=c)


def Damper(name: str, node_a: str, node_b: str, *, d: Value | None = None) -> Part:
    """A damper between two nodes, d [N m s/rad]."""
    return _part("damper", name, (node_a, node_b), d=d)


def SpringDamper(
    name: str, node_a: str, node_b: str, *, c: Value | None = None, d: Value | None = None
) -> Part:
    """A spring of stiffness c [N m/rad] and beside it a damper d [N m s/rad]."""
    return _part("spring-damper", name, (node_a, node_b), c=c, d=d)


def IdealGear(name: str, node_a: str, node_b: str, *, ratio: Value | None = None) -> Part:
    """A gear without losses: the angle at node_a is ratio [1] times the angle at node_b."""
    return _part("ideal-gear", name, (node_a, node_b), ratio=ratio)


def ViscousFriction(name: str, node: str, *, d: Value | None = None) -> Part:
    """Friction against ground, d [N m s/rad] times the speed."""
    return _part("viscous-friction", name, (node,), d=d)


def CoulombFriction(name: str, node: str, *, fc: Value | None = None) -> Part:
    """Friction fc [N m] against the direction of motion."""
    return _part("coulomb-friction", name, (node,), fc=fc)


def Gravity(name: str, node: str, *, gc: Value | None = None, gs: Value | None = None) -> Part:
    """Gravity brakes with gc cos(angle) + gs sin(angle) [N m]."""
    return _part("gravity", name, (node,), gc=gc, gs=gs)


def TorqueOffset(name: str, node: str, *, tau0: Value | None = None) -> Part:
    """A constant torque tau0 [N m] that drives."""
    return _part("torque-offset", name, (node,), tau0=tau0)


def Torque(name: str, node: str, *, kT: Value | None = None) -> Part:
    """The measured motor torque, times the torque constant kT [1] relative to what the controller reckons with."""
    return _part("torque", name, (node,), kT=kT)


def SpeedSensor(name: str, node: str) -> Part:
    """The speed of the node is measured."""
    return _part("speed-sensor", name, (node,))


def AngleSensor(name: str, node: str) -> Part:
    """The angle of the node is measured."""
    return _part("angle-sensor", name, (node,))


def _part(kind: str, name: str, nodes: tuple[str | None, ...], **parameters: Value | None) -> Part:
    given = {role: value for role, value in parameters.items() if value is not None}
    return Part(KINDS[kind], name, tuple(node for node in nodes if node is not None), given, Origin(name))
