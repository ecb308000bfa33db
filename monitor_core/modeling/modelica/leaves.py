"""The components of the library: their parameters, and what they bring to the flat model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from monitor_core.modeling.components import KINDS, fragment
from monitor_core.modeling.components.connections import End, Joint
from monitor_core.modeling.components.fragments import Fragment
from monitor_core.modeling.components.units import Use
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica.component_conditions import truth
from monitor_core.modeling.modelica.friction import coulomb_and_viscous
from monitor_core.modeling.modelica.instances import Instance
from monitor_core.modeling.modelica.standard_library import BEARING, REFUSED, SIGNAL_SOURCE
from monitor_core.modeling.modelica.values import Values


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a kind of components.py, with its parameters by role.

    ``uses``: the same for the check of units.  ``at``: its flanges by the names of those that are drawn.
    """

    name: str
    kind: str
    parameters: Mapping[str, Laurent]
    origin: Origin
    uses: tuple[Use, ...]
    at: tuple[str, ...]

    def fragment(self) -> Fragment:
        """Its variables and equations."""
        return fragment(KINDS[self.kind], self.name, self.parameters, self.origin)


def parts(leaf: Instance, values: Values) -> Iterator[Part]:
    """What a library component consists of: itself, except for friction by a table.

    Raises:
        ModelError: a parameter has a value that is not supported.
    """
    assert leaf.leaf is not None
    _check_refused(leaf, values)
    if leaf.leaf.kind == BEARING:
        yield from _bearing(leaf, values)
    elif leaf.leaf.kind != SIGNAL_SOURCE:
        yield _part(leaf, values)


def _part(leaf: Instance, values: Values) -> Part:
    assert leaf.leaf is not None
    kind = KINDS[leaf.leaf.kind]
    written = {role: leaf.members[name] for role, name in leaf.leaf.roles.items()}
    parameters = {role: values.parameter(p) for role, p in written.items()}
    uses = tuple(
        Use(parameters[role], kind.role(role).unit, _written_at(p, leaf), role, kind.role(role).meaning)
        for role, p in written.items()
    )
    fixed = {role: Laurent.number(value) for role, value in leaf.leaf.fixed.items()}
    flanges = tuple(leaf.inside(name) for name in kind.flanges)
    return Part(leaf.path, kind.name, {**parameters, **fixed}, leaf.origin, uses, flanges)


def _written_at(parameter: Instance, leaf: Instance) -> Origin:
    """The line of the parameter's value, under the component's name."""
    where = parameter.binding.origin if parameter.binding is not None else leaf.origin
    return replace(where, component=leaf.path) if where.file else leaf.origin


def _bearing(leaf: Instance, values: Values) -> Iterator[Part]:
    coulomb, viscous = coulomb_and_viscous(leaf, values)
    at, origin = (leaf.inside("flange_a"),), _written_at(leaf.members["tau_pos"], leaf)
    for name, kind, role, found in (
        (leaf.path, "viscous-friction", "d", viscous),
        (leaf.inside("coulomb"), "coulomb-friction", "fc", coulomb),
    ):
        if found.value:
            about = KINDS[kind].role(role)
            use = Use(found.value, about.unit if found.has_unit else "", origin, role, about.meaning)
            yield Part(name, kind, {role: found.value}, leaf.origin, (use,), at)


def bearing_joint(leaf: Instance, found: list[Part]) -> Joint:
    """Both flanges of a bearing are one shaft, on which its friction acts."""
    shaft = (End(leaf.inside("flange_a"), outside=True), End(leaf.inside("flange_b"), outside=True))
    return Joint(leaf.path, (*shaft, *(End(f"{part.name}.flange") for part in found)), leaf.origin)


def _check_refused(leaf: Instance, values: Values) -> None:
    for name, reason in REFUSED.items():
        parameter = leaf.members.get(name)
        if parameter is None or parameter.binding is None:
            continue
        origin = _written_at(parameter, leaf)
        if parameter.base == "Boolean" and truth(parameter.binding, values):
            raise ModelError(f"{name} = true: {reason}", origin)
        if parameter.base == "Real":
            value = values.constant(parameter.binding.expression, parameter.binding.scope)
            if value != Laurent.number(1):
                raise ModelError(f"{name} = {value}: {reason}", origin)
