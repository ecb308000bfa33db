"""The parameters of the flat model: those that the user named and that still occur."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from monitor_core.modeling.components.units import parse
from monitor_core.modeling.components.uses import DriveComponent, Use, first_use, impossible, infer, sign_of
from monitor_core.modeling.flat import CONSTANT, FlatEquation, FlatParameter, ModelError, Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica.parsing import is_parameter
from monitor_core.modeling.modelica.values import ExpressionValues, plain


def flat_parameters(
    values: ExpressionValues,
    comments: Mapping[str, str],
    parts: Sequence[DriveComponent],
    equations: Iterable[FlatEquation],
    known: Mapping[str, str],
) -> tuple[FlatParameter, ...]:
    """All parameters that occur in the equations, in the order of their declaration.

    ``comments``: by path, in the user's words.  ``known``: units that are declared, or that the user's own equations
    determine.
    """
    occurring = {name for e in equations for c in e.terms.values() for name in c.names}
    written = [n for n in values.places if n in occurring and is_parameter(values.symbols[n])]
    declared = {name: known.get(name, "") for name in written}
    for name, unit in declared.items():
        if unit:
            parse(unit, values.place(name))  # refused where it is written
    every = [use for part in parts for use in part.uses]
    units = infer(every, declared)
    for use, role, number, problem in impossible(every, values.nominal):
        raise ModelError(f"its {role.name} ({role.meaning}) is {number:g}: it {problem}", use.origin)
    of_tables = sorted(occurring - set(written))  # of bearings
    return tuple(_parameter(n, values, comments.get(n, ""), units.get(n, ""), every) for n in (*written, *of_tables))


def _parameter(name: str, values: ExpressionValues, meaning: str, unit: str, every: Sequence[Use]) -> FlatParameter:
    symbol, value = values.symbols.get(name), values.nominal.get(name)
    uses = [use for use in every if name in use.value.names]
    if uses and not meaning:
        first = first_use(uses)
        meaning = first.meaning(first.origin.component)
    least = plain(symbol.min) if symbol is not None else None
    positive, nonnegative = sign_of(name, uses, value, least if isinstance(least, int | float) else -math.inf)
    owner = values.places[name.rpartition(".")[0]] if symbol is None else Origin()
    place = values.place(name) if symbol is not None else replace(owner, component=name)
    return FlatParameter(name, unit, meaning, value, positive, nonnegative, place)


# --- Units that follow from the user's equations, of variables and parameters declared without one --------------------


_DER = "der"
"""Stands for d/dt in a product; being a keyword it is the name of no parameter."""

KNOWN = ("rad", "rad/s", "rad/s^2", "N m")


def own_units(equations: Iterable[FlatEquation], declared: Mapping[str, str]) -> dict[str, str]:
    """Units of variables and parameters: declared ones, and those that the terms of equations then require.

    An equation whose terms contradict each other is ignored: numbers in it may have units (``flange.tau =
    -0.1*der(flange.phi)``), which Modelica allows.
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
    """The unit as one of KNOWN if it equals one, apart from radians; otherwise ""."""
    dimension = parse(text) if text else None
    return next((unit for unit in KNOWN if unit == text or (unit != "rad" and parse(unit) == dimension)), "")
