"""Components as a user draws them: a name, the nodes of its flanges, and its parameters.

A parameter is a string (a name, or an expression such as "1/r" or "m*l^2") or a number; without one, its name is
"<component>.<role>".  The node "ground" does not turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from monitor_core.modeling.components import KINDS, Kind
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.wording import did_you_mean

Value: TypeAlias = str | float


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a drawing; ``parameters`` are the given ones, by role."""

    kind: Kind
    name: str
    nodes: tuple[str, ...]
    parameters: Mapping[str, Value]
    origin: Origin


def part(kind: str, name: str, *nodes: str, **parameters: Value) -> Part:
    """A component of a kind of component_kinds.py: ``part("spring", "belt", "shaft", "load", c="k")``.

    Raises:
        KeyError: there is no such kind.
    """
    return Part(KINDS[kind], name, nodes, parameters, Origin(name))


# --- Components from the tables of a configuration file ---------------------------------------------------------------


TYPES = tuple(name for name, kind in KINDS.items() if kind.flanges)


def parts_of(tables: Sequence[Mapping[str, object]], origins: Sequence[Origin]) -> Iterator[Part]:
    """One component for each table ``{type = "inertia", name = "motor", at = "shaft", J = "Jm"}``.

    Args:
        tables: keys ``type``, ``name``, ``at`` (a node, or a list of them), and the component's parameters.
        origins: place of each table.

    Raises:
        ModelError: a key is missing, unknown, or of the wrong type; the type is unknown.
    """
    for number, (table, origin) in enumerate(zip(tables, origins, strict=True), 1):
        named = replace(origin, component=f"component {number}")
        name = _text(table, "name", named)
        named = replace(origin, component=name)
        kind_name = _text(table, "type", named)
        if kind_name not in TYPES:
            raise ModelError(f"unknown type {kind_name!r}: {did_you_mean(kind_name, TYPES)}", named)
        kind = KINDS[kind_name]
        roles = {role.name for role in kind.roles}
        for key in table.keys() - roles - {"name", "type", "at"}:
            hint = did_you_mean(key, ["type", "name", "at", *sorted(roles)])
            raise ModelError(f"unknown key {key!r}: {hint}", named)
        given = {role: _value(table[role], role, named) for role in sorted(roles & table.keys())}
        yield Part(kind, name, _nodes(table, kind, named), given, named)


def _text(table: Mapping[str, object], key: str, origin: Origin) -> str:
    value = table.get(key)
    if not isinstance(value, str) or not value:
        example = {"name": "motor", "type": "inertia"}[key]
        problem = "is missing" if value is None else f"is {value!r}, not a word"
        raise ModelError(f'its {key} {problem}: write {key} = "{example}"', origin)
    return value


def _nodes(table: Mapping[str, object], kind: Kind, origin: Origin) -> tuple[str, ...]:
    at = table.get("at")
    nodes = [at] if isinstance(at, str) else at
    if isinstance(nodes, list | tuple) and all(isinstance(node, str) for node in nodes):
        return tuple(nodes)
    right = '"shaft"' if len(kind.flanges) == 1 or kind.name == "inertia" else '["shaft", "load"]'
    problem = "is missing" if at is None else f"is {at!r}"
    raise ModelError(f"at, where it is connected, {problem}: write at = {right}, in names of nodes", origin)


def _value(value: object, role: str, origin: Origin) -> Value:
    if isinstance(value, str | int | float) and not isinstance(value, bool):
        return value
    raise ModelError(
        f'its {role} is {value!r}: write a name ("Jm"), an expression ("m*l^2") or a number', origin
    )
