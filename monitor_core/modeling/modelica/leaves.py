"""The components of the library: their parameters, and their part of the flat model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from monitor_core.modeling.components import KINDS, fragment
from monitor_core.modeling.components.connections import End, Joint
from monitor_core.modeling.components.fragments import Fragment
from monitor_core.modeling.components.units import Use
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modelica.arithmetic import number_of
from monitor_core.modeling.modelica.component_conditions import truth
from monitor_core.modeling.modelica.instances import Bound, Instance, about, unit_of
from monitor_core.modeling.modelica.standard_library import BEARING, REFUSED, SIGNAL_SOURCE
from monitor_core.modeling.modelica.syntax import Array
from monitor_core.modeling.modelica.values import Values


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a kind of component_kinds.py, with its parameters by role.

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
    """The parts of a library component: itself, except for friction by a table.

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


# --- Bearing friction given as a table of speeds and torques: Coulomb friction and a viscous part ---------------------


_FORM = "[0, fc; 1, fc + fm]: friction at standstill, and at a speed of 1 rad/s"


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A friction coefficient.  ``has_unit``: its unit determines those of the parameters in it.

    Speeds are mostly plain numbers, whose unit is not visible: fm in [0, fc; 1, fc + fm], tau1 in [0, 0; 1, tau1].
    """

    value: Laurent
    has_unit: bool


def coulomb_and_viscous(bearing: Instance, values: Values) -> tuple[Coefficient, Coefficient]:
    """Intercept [N m] and slope [N m s/rad] of the line through the points of ``tau_pos``.

    A number becomes a parameter "<bearing>.fc" or "<bearing>.d" with that nominal value.

    Raises:
        ModelError: no table, more than two points, a speed that cannot be divided by.
    """
    table = bearing.members["tau_pos"]
    if table.binding is None:
        raise ModelError(f"tau_pos is not given; write tau_pos = {_FORM}", bearing.origin)
    origin = Origin(bearing.path, table.binding.origin.file, table.binding.origin.line)
    with about(bearing.path):
        (w1, tau1), *more = _points(table.binding, values, origin)
    slope = _slope((w1, tau1), more[0], origin) if more else Laurent()
    fc = _named(bearing.inside("fc"), tau1 - slope * w1, values, origin)
    d = _named(bearing.inside("d"), slope, values, origin)
    return Coefficient(fc, has_unit=not w1), Coefficient(d, has_unit=_is_viscous(d, bearing))


Point = tuple[Laurent, Laurent]


def _slope(first: Point, second: Point, origin: Origin) -> Laurent:
    try:
        return (second[1] - first[1]) / (second[0] - first[0])
    except NotLaurentError:
        raise ModelError("the speeds of tau_pos must differ, by a number or one parameter", origin) from None


def _is_viscous(slope: Laurent, bearing: Instance) -> bool:
    """A single name that is not declared to be a torque."""
    (name, *others) = slope.names or ("",)
    if others or slope != Laurent.symbol(name):
        return False
    model = bearing
    while model.parent is not None:
        model = model.parent
    declared = next((unit_of(i) for i in model.tree() if i.path == name), "")
    return declared != "N m"


def _points(bound: Bound, values: Values, origin: Origin) -> list[Point]:
    table = bound.expression
    if not isinstance(table, Array):
        raise ModelError(f"tau_pos must be a table: {_FORM}", origin)
    rows = table.values if table.values and isinstance(table.values[0], Array) else (table,)
    if len(rows) > 2:
        raise ModelError(
            f"tau_pos has {len(rows)} points (a Stribeck curve); only two are supported: {_FORM}", origin
        )
    points = []
    for row in rows:
        if not isinstance(row, Array) or len(row.values) != 2:
            raise ModelError(f"each row of tau_pos is a speed and a torque: {_FORM}", origin)
        speed, torque = (values.constant(value, bound.scope) for value in row.values)
        points.append((speed, torque))
    return points


def _named(name: str, value: Laurent, values: Values, origin: Origin) -> Laurent:
    if not value or not value.is_number:
        return value
    values.nominal[name] = number_of(value, origin)
    return Laurent.symbol(name)
