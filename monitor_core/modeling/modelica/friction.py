"""Bearing friction given as a table of speeds and torques: Coulomb friction and a viscous part."""

from __future__ import annotations

from dataclasses import dataclass

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modelica.arithmetic import number_of
from monitor_core.modeling.modelica.changes import Bound
from monitor_core.modeling.modelica.instances import Instance, unit_of
from monitor_core.modeling.modelica.mistakes import about
from monitor_core.modeling.modelica.syntax import Array
from monitor_core.modeling.modelica.values import Values

_FORM = "[0, fc; 1, fc + fm]: friction at standstill, and at a speed of 1 rad/s"


@dataclass(frozen=True, slots=True)
class Coefficient:
    """Of friction.  ``has_unit``: its unit tells those of the parameters in it.

    Speeds are mostly numbers, whose unit does not show: fm in [0, fc; 1, fc + fm], tau1 in [0, 0; 1, tau1].
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
