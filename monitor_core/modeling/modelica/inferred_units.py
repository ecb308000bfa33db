"""Units that the user's own equations tell: of variables and parameters declared without one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from monitor_core.modeling.components.unit_algebra import parse
from monitor_core.modeling.components.units import Use, infer
from monitor_core.modeling.flat import CONSTANT, FlatEquation, ModelError
from monitor_core.modeling.laurent import Laurent

_DER = "der"
"""Stands for d/dt in a product; as a keyword it is nobody's name."""

KNOWN = ("rad", "rad/s", "rad/s^2", "N m")


def own_units(equations: Iterable[FlatEquation], declared: Mapping[str, str]) -> dict[str, str]:
    """Units of variables and parameters: as declared, and as the terms of equations then require.

    An equation whose terms do not fit is passed over: numbers in it may have units of their own
    (``flange.tau = -0.1*der(flange.phi)``), and Modelica does not mind.
    """
    sums = [_sum(equation) for equation in equations]
    found = {_DER: "1/s", **{name: unit for name, unit in declared.items() if unit}}
    before = 0
    while len(found) > before:
        before = len(found)
        for use in sums:
            found.update(_learned(use, found))
    return found


def _sum(equation: FlatEquation) -> Use:
    value = Laurent()
    for (name, order), coefficient in equation.terms.items():
        factor = Laurent.number(1) if name == CONSTANT else Laurent.symbol(name)
        value = value + coefficient * factor * Laurent.symbol(_DER, order)
    return Use(value, "", equation.origin)


def _learned(use: Use, found: Mapping[str, str]) -> dict[str, str]:
    try:
        units = infer([use], {name: found[name] for name in use.value.names if name in found})
    except ModelError:
        return {}
    return {name: unit for name, unit in units.items() if unit and name not in found}


def variable_unit(text: str) -> str:
    """The same as one of KNOWN if it is one, radians left out or not; else ""."""
    dimension = parse(text) if text else None
    return next((unit for unit in KNOWN if unit == text or (unit != "rad" and parse(unit) == dimension)), "")
