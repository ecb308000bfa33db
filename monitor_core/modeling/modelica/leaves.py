"""The components of the library: their parameters, and their part of the flat model."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from pymoca import ast

from monitor_core.modeling.components import COMPONENT_KINDS
from monitor_core.modeling.components.fragments import End, Joint
from monitor_core.modeling.components.uses import DriveComponent, Use
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modelica.library import BEARING, REFUSED, SIGNAL_SOURCE, Leaf
from monitor_core.modeling.modelica.values import ExpressionValues, is_given, number_of, plain


@dataclass(frozen=True, slots=True)
class Placed:
    """A component of the library in the model: its path, and where it is declared."""

    path: str
    leaf: Leaf
    origin: Origin

    def inside(self, name: str) -> str:
        """The path of a member."""
        return f"{self.path}.{name}"


def parts(placed: Placed, values: ExpressionValues) -> Iterator[DriveComponent]:
    """The parts of a library component: itself, except for friction by a table."""
    _check_refused(placed, values)
    if placed.leaf.kind == BEARING:
        yield from _bearing(placed, values)
    elif placed.leaf.kind != SIGNAL_SOURCE:
        yield _part(placed, values)


def _part(placed: Placed, values: ExpressionValues) -> DriveComponent:
    kind, leaf = COMPONENT_KINDS[placed.leaf.kind], placed.leaf
    parameters = {role: values.parameter(placed.inside(name)) for role, name in leaf.roles.items()}
    uses = tuple(
        Use(value, kind.role(role).unit, _written_at(leaf.roles[role], placed, values), kind.role(role))
        for role, value in parameters.items()
    )
    fixed = {role: Laurent.number(value) for role, value in leaf.fixed.items()}
    flanges = tuple(placed.inside(name) for name in kind.flanges)
    return DriveComponent(kind, placed.path, {**parameters, **fixed}, placed.origin, uses, flanges)


def _written_at(name: str, placed: Placed, values: ExpressionValues) -> Origin:
    """The line of the parameter's value, under the component's name."""
    return replace(values.place(placed.inside(name)), component=placed.path)


def _bearing(placed: Placed, values: ExpressionValues) -> Iterator[DriveComponent]:
    coulomb, viscous = coulomb_and_viscous(placed, values)
    at, origin = (placed.inside("flange_a"),), _written_at("tau_pos", placed, values)
    for name, kind, role, found in (
        (placed.path, "viscous-friction", "d", viscous),
        (placed.inside("coulomb"), "coulomb-friction", "fc", coulomb),
    ):
        if found.value:
            about = COMPONENT_KINDS[kind].role(role)
            use = Use(found.value, about.unit if found.has_unit else "", origin, about)
            yield DriveComponent(COMPONENT_KINDS[kind], name, {role: found.value}, placed.origin, (use,), at)


def bearing_joint(placed: Placed, found: list[DriveComponent]) -> Joint:
    """Both flanges of a bearing are one shaft, on which its friction acts."""
    shaft = (End(placed.inside("flange_a"), outside=True), End(placed.inside("flange_b"), outside=True))
    return Joint(placed.path, (*shaft, *(End(f"{part.name}.flange") for part in found)), placed.origin)


def _check_refused(placed: Placed, values: ExpressionValues) -> None:
    for name, (right, reason) in REFUSED.items():
        symbol = values.symbols.get(placed.inside(name))
        if symbol is not None and is_given(symbol.value) and plain(symbol.value) != right:
            given = plain(symbol.value)
            shown = str(given).lower() if given is not None else "an expression"
            raise ModelError(f"{name} = {shown}: {reason}", _written_at(name, placed, values))


# --- Bearing friction given as a table of speeds and torques: Coulomb friction and a viscous part ---------------------


_FORM = "[0, fc; 1, fc + fm]: friction at standstill, and at a speed of 1 rad/s"


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A friction coefficient.  ``has_unit``: its unit determines those of the parameters in it.

    Speeds are mostly plain numbers, whose unit is not visible: fm in [0, fc; 1, fc + fm], tau1 in [0, 0; 1, tau1].
    """

    value: Laurent
    has_unit: bool


def coulomb_and_viscous(bearing: Placed, values: ExpressionValues) -> tuple[Coefficient, Coefficient]:
    """Intercept [N m] and slope [N m s/rad] of the line through the points of ``tau_pos``.

    A number becomes a parameter "<bearing>.fc" or "<bearing>.d" with that nominal value.
    """
    table = values.symbols[bearing.inside("tau_pos")].value
    if not is_given(table):
        raise ModelError(f"tau_pos is not given; write tau_pos = {_FORM}", bearing.origin)
    origin = _written_at("tau_pos", bearing, values)
    (w1, tau1), *more = _points(table, values, origin)
    slope = _slope((w1, tau1), more[0], origin) if more else Laurent()
    fc = _named(bearing.inside("fc"), tau1 - slope * w1, values, origin)
    d = _named(bearing.inside("d"), slope, values, origin)
    return Coefficient(fc, has_unit=not w1), Coefficient(d, has_unit=_is_viscous(d, values))


FrictionPoint = tuple[Laurent, Laurent]


def _slope(first: FrictionPoint, second: FrictionPoint, origin: Origin) -> Laurent:
    try:
        return (second[1] - first[1]) / (second[0] - first[0])
    except NotLaurentError:
        raise ModelError("the speeds of tau_pos must differ, by a number or one parameter", origin) from None


def _is_viscous(slope: Laurent, values: ExpressionValues) -> bool:
    """A single name that is not declared to be a torque."""
    (name, *others) = slope.names or ("",)
    if others or slope != Laurent.symbol(name):
        return False
    declared = values.symbols.get(name)
    return declared is None or plain(declared.unit) not in ("N.m", "N m")


def _points(table: object, values: ExpressionValues, origin: Origin) -> list[FrictionPoint]:
    if not isinstance(table, ast.Array):
        raise ModelError(f"tau_pos must be a table: {_FORM}", origin)
    rows = table.values if table.values and isinstance(table.values[0], ast.Array) else (table,)
    if len(rows) > 2:
        raise ModelError(f"tau_pos has {len(rows)} points (a Stribeck curve); only two are supported: {_FORM}", origin)
    points = []
    for row in rows:
        if not isinstance(row, ast.Array) or len(row.values) != 2:
            raise ModelError(f"each row of tau_pos is a speed and a torque: {_FORM}", origin)
        speed, torque = (values.constant(value, origin) for value in row.values)
        points.append((speed, torque))
    return points


def _named(name: str, value: Laurent, values: ExpressionValues, origin: Origin) -> Laurent:
    if not value or not value.is_number:
        return value
    values.nominal[name] = number_of(value, origin)
    return Laurent.symbol(name)
