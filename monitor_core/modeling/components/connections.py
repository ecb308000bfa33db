"""Connections: connected flanges have the same angle, and their torques add up to zero."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from monitor_core.modeling.components.linear import Linear
from monitor_core.modeling.flat import FlatEquation, Origin


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
        equal = Linear.variable(f"{first.flange}.phi") - Linear.variable(f"{end.flange}.phi")
        yield FlatEquation(equal.terms, joint.origin)
    torques = Linear({})
    for end in joint.ends:
        tau = Linear.variable(f"{end.flange}.tau")
        torques = torques - tau if end.outside else torques + tau
    yield FlatEquation(torques.terms, joint.origin)
