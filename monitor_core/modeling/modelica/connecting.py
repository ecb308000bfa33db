"""connect(a, b): finds the connectors, and connects flanges to flanges and signals to signals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from monitor_core.modeling.components.connections import End, Joint
from monitor_core.modeling.components.linear import Linear
from monitor_core.modeling.flat import FlatEquation, ModelError, Origin
from monitor_core.modeling.modelica.instances import Instance, Scope
from monitor_core.modeling.modelica.names import did_you_mean, listed, similar
from monitor_core.modeling.modelica.syntax import Connect, Name


@dataclass
class Groups:
    """Disjoint sets that are merged (union-find)."""

    leader: dict[str, str] = field(default_factory=dict)

    def root(self, name: str) -> str:
        """The representative of the set of an element."""
        top = name
        while (above := self.leader.get(top, top)) != top:
            top = above
        self.leader[name] = top
        return top

    def join(self, a: str, b: str) -> bool:
        """Merge two sets; false if they were one already."""
        first, second = self.root(a), self.root(b)
        self.leader[second] = first
        return first != second

    def members(self, names: Iterable[str]) -> dict[str, list[str]]:
        """The sets among these names, by representative."""
        sets: dict[str, list[str]] = {}
        for name in names:
            sets.setdefault(self.root(name), []).append(name)
        return sets


@dataclass
class Wiring:
    """All connections of a model."""

    joints: list[Joint] = field(default_factory=list)
    nodes: Groups = field(default_factory=Groups)
    signals: Groups = field(default_factory=Groups)
    equalities: list[FlatEquation] = field(default_factory=list)

    def add(self, connect: Connect, scope: Scope) -> None:
        """One connection.

        Raises:
            ModelError: no such connector; a flange with a signal.
        """
        left, right = _connector(connect.left, scope), _connector(connect.right, scope)
        if left is None or right is None:  # a component switched off takes its connections with it
            return
        origin = scope.origin(connect.line)
        if left.is_flange != right.is_flange:
            kinds = [f"{c.path} is a {'flange' if c.is_flange else 'signal'}" for c in (left, right)]
            raise ModelError(f"{' and '.join(kinds)}: they cannot be connected", origin)
        if left.is_flange:
            ends = tuple(End(c.path, outside=c.parent is scope.instance) for c in (left, right))
            self.joints.append(Joint(left.path, ends, origin))
            self.nodes.join(left.path, right.path)
        elif self.signals.join(left.path, right.path):
            equal = Linear.variable(left.path) - Linear.variable(right.path)
            self.equalities.append(FlatEquation(equal.terms, origin))


def _connector(name: Name, scope: Scope) -> Instance | None:
    """The connector; None if it is switched off."""
    origin, where = scope.origin(name.line), scope.instance
    for part in name.parts:
        if part in where.absent:
            return None
        if part not in where.members:
            raise ModelError(_no_such(name, where, part), origin)
        where = where.members[part]
    if name.subscripts and not _is_source(where):
        raise ModelError(f"{name}: arrays are not supported", origin)
    _check_connector(name, where, origin)
    return where


def _no_such(name: Name, where: Instance, part: str) -> str:
    ends = [m for m, i in where.members.items() if i.is_connector or not (i.base or name.parts[-1] == part)]
    near = did_you_mean(similar(part, ends))
    known = listed(ends, "; there is")
    return f"{name} cannot be connected: {where.name} has no {part}{near}{known}"


def _is_source(instance: Instance) -> bool:
    return instance.parent is not None and instance.parent.leaf is not None and "y" in instance.parent.members


def _check_connector(name: Name, found: Instance, origin: Origin) -> None:
    if not found.is_connector and not (found.base == "Real" and found.causality):
        inside = [f"{name}.{m}" for m, instance in found.members.items() if instance.is_connector]
        instead = f": connect {' or '.join(inside)}" if inside else ""
        kind = "a parameter" if found.is_parameter else f"of class {found.cls.name}"
        raise ModelError(f"{name} is {kind}, not a connector{instead}", origin)
    if found.is_flange and not _is_angle_and_torque(found):
        problem = f"{found.cls.name} is not a flange: it must have an angle phi and a flow tau"
        raise ModelError(f"{name} cannot be connected: {problem}", origin)
    if len(name.parts) > 2 or (
        len(name.parts) == 2 and found.parent is not None and found.parent.is_connector
    ):
        raise ModelError(f"{name} is too deep inside: connect a connector of {name.parts[0]} itself", origin)


def _is_angle_and_torque(flange: Instance) -> bool:
    flows = {m: i.declaration is not None and i.declaration.flow for m, i in flange.members.items()}
    return flows == {"phi": False, "tau": True}
