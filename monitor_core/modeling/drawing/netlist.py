"""From components at nodes to flat equations."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from monitor_core.modeling.components import KINDS, Fragment, fragment, join
from monitor_core.modeling.components.fragments import End, Joint, connect
from monitor_core.modeling.components.uses import Use
from monitor_core.modeling.drawing.drawn_components import Part, parts_of
from monitor_core.modeling.drawing.parameter_table import parameters, uses_of
from monitor_core.modeling.flat import FlatComponent, FlatModel, ModelError, Origin

GROUND = "ground"
"""The node that does not turn."""

_NAME = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True)
class Drawing:
    """A drive.

    ``nominal``: values of parameters (SI).  ``meanings``: parameters in the user's words, in the order of lists; the
    others follow as they occur.
    """

    name: str
    components: Sequence[Part]
    nominal: Mapping[str, float] = field(default_factory=dict)
    meanings: Mapping[str, str] = field(default_factory=dict)
    origin: Origin = field(default_factory=Origin)

    def flat(self) -> FlatModel:
        """All equations of the drive, and its parameters with units, values and meanings.

        Raises:
            ModelError: a name is used twice or is invalid; a component cannot be connected like this; an expression,
                value or unit of a parameter is wrong; ``nominal`` or ``meanings`` name no parameter.
        """
        parts = self._grounded()
        _check(parts, self.origin)
        read = {part.name: uses_of(part) for part in parts}
        joined = join(_fragment(part, read[part.name]) for part in parts)
        uses = [use for roles in read.values() for use in roles.values()]
        flanges = [f"{part.name}.{flange}" for part in parts for flange in part.kind.flanges]
        return FlatModel(
            name=self.name,
            parameters=parameters(uses, self.nominal, self.meanings, self.origin),
            variables=joined.variables,
            inputs=joined.inputs,
            sensors=joined.sensors,
            equations=joined.equations + connect(_joints(parts), flanges),
            components=tuple(
                FlatComponent(
                    p.name, p.kind.name, p.nodes, {role: use.value for role, use in read[p.name].items()}
                )
                for p in parts
            ),
            origin=self.origin,
        )

    def _grounded(self) -> list[Part]:
        """The components, and a fixed one at the node "ground" if that is used."""
        used = any(GROUND in part.nodes for part in self.components)
        fixed = any(part.kind.name == "fixed" and GROUND in part.nodes for part in self.components)
        ground = Part(KINDS["fixed"], GROUND, (GROUND,), {}, Origin(GROUND))
        return [*self.components, ground] if used and not fixed else list(self.components)


def from_tables(
    name: str, tables: Sequence[Mapping[str, object]], origins: Sequence[Origin] | None = None
) -> Drawing:
    """A drawing from the list of components of a configuration file.

    Args:
        name: of the drive.
        tables: one for each component, ``{type = "inertia", name = "motor", at = "shaft", J = "Jm"}``; ``at`` is a list
            of two nodes where a component has two flanges.
        origins: place of each table, for messages.

    Raises:
        ModelError: a table does not describe a component.
    """
    return Drawing(name, tuple(parts_of(tables, origins or [Origin()] * len(tables))))


def _check(parts: Sequence[Part], origin: Origin) -> None:
    if not parts:
        raise ModelError("the drive has no components", origin)
    for name, count in Counter(part.name for part in parts).items():
        if count > 1:
            (*_, last) = (part for part in parts if part.name == name)
            raise ModelError(
                f"{count} components are called {name!r}: each needs a name of its own", last.origin
            )
    for part in parts:
        if not _NAME.fullmatch(part.name):
            raise ModelError(f"the name {part.name!r} is not made of letters, digits and _", part.origin)
        _check_nodes(part)
    fixed = Counter(node for part in parts if part.kind.name == "fixed" for node in part.nodes)
    for part in parts:
        if part.kind.name == "fixed" and fixed[part.nodes[0]] > 1:
            raise ModelError(f"the node {part.nodes[0]!r} is fixed already", part.origin)


def _check_nodes(part: Part) -> None:
    need, kind = len(part.kind.flanges), part.kind.name
    fits = len(part.nodes) == need or (kind == "inertia" and len(part.nodes) == 1)
    if not fits:
        right = "one node or two" if kind == "inertia" else "one node" if need == 1 else "two nodes"
        given = ", ".join(part.nodes) or "none"
        raise ModelError(f"it is at {given}, but the type {kind} is at {right}", part.origin)
    if "" in part.nodes:
        raise ModelError("a node has an empty name", part.origin)
    if kind != "inertia" and len(set(part.nodes)) < need:
        raise ModelError(
            f"both ends are at the node {part.nodes[0]!r}: it joins two different nodes", part.origin
        )


def _fragment(part: Part, uses: Mapping[str, Use]) -> Fragment:
    """Equations of a component; a torque is the measured one, as drawings have no signals."""
    new = fragment(part.kind, part.name, {role: use.value for role, use in uses.items()}, part.origin)
    for signal in part.kind.signals_in:
        new = new.measured(f"{part.name}.{signal}")
    return new


def _joints(parts: Sequence[Part]) -> Iterator[Joint]:
    """A connection set for each node.  The second flange of an inertia at one node stays free: it is rigid."""
    ends: dict[str, list[End]] = {}
    for part in parts:
        for node, flange in zip(dict.fromkeys(part.nodes), part.kind.flanges, strict=False):
            ends.setdefault(node, []).append(End(f"{part.name}.{flange}"))
    for node, at in ends.items():
        yield Joint(node, tuple(at), Origin(f"node {node}"))
