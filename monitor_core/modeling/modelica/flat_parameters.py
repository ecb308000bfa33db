"""The parameters of the flat model: those that the user named and that still occur."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from monitor_core.modeling.components import KINDS, Role
from monitor_core.modeling.components.units import Use, infer, parse
from monitor_core.modeling.drawing.parameter_table import is_positive
from monitor_core.modeling.flat import CONSTANT, FlatEquation, FlatParameter, ModelError, Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica.leaves import Part
from monitor_core.modeling.modelica.parsing import is_parameter
from monitor_core.modeling.modelica.values import Values, plain


@dataclass(frozen=True, slots=True)
class Entry:
    """A place where parameters occur: the role that an expression in them fills in a component."""

    role: Role
    value: Laurent
    part: Part

    @property
    def place(self) -> str:
        """For example: inertia of the motor."""
        return f"{self.role.meaning} of the {self.part.origin.component}"


def flat_parameters(
    values: Values,
    comments: Mapping[str, str],
    parts: Sequence[Part],
    equations: Iterable[FlatEquation],
    known: Mapping[str, str],
) -> tuple[FlatParameter, ...]:
    """All parameters that occur in the equations, in the order of their declaration.

    ``comments``: by path, in the user's words.  ``known``: units that are declared, or that the user's own equations
    determine.

    Raises:
        ModelError: contradicting units; a value that makes no sense (an inertia of zero).
    """
    occurring = {name for e in equations for c in e.terms.values() for name in c.names}
    written = [n for n in values.places if n in occurring and is_parameter(values.symbols[n])]
    declared = {name: known.get(name, "") for name in written}
    for name, unit in declared.items():
        if unit:
            parse(unit, values.place(name))  # refused where it is written
    units = infer([use for part in parts for use in part.uses], declared)
    _check_values(parts, values)
    entries = _entries(parts)
    of_tables = sorted(occurring - set(written))  # of bearings
    return tuple(
        _parameter(n, values, comments.get(n, ""), units.get(n, ""), entries.get(n, []))
        for n in (*written, *of_tables)
    )


def _entries(parts: Iterable[Part]) -> dict[str, list[Entry]]:
    """Parameter -> where it occurs; first where it stands alone."""
    found: dict[str, list[Entry]] = {}
    for part in parts:
        for use in part.uses:
            for name in use.value.names:
                found.setdefault(name, []).append(Entry(KINDS[part.kind].role(use.role), use.value, part))
    return {name: sorted(all_, key=lambda e: e.value != Laurent.symbol(name)) for name, all_ in found.items()}


def _parameter(name: str, values: Values, meaning: str, unit: str, entries: Sequence[Entry]) -> FlatParameter:
    symbol, value = values.symbols.get(name), values.nominal.get(name)
    if entries and not meaning:
        alone = entries[0].value == Laurent.symbol(name)
        meaning = entries[0].place if alone else f"in the {entries[0].place}: {entries[0].value}"
    least = plain(symbol.min) if symbol is not None else None
    positive = (isinstance(least, int | float) and least > 0) or is_positive(
        name, ((e.role, e.value) for e in entries), value
    )
    origin = entries[0].part.origin if symbol is None and entries else Origin()
    place = values.place(name) if symbol is not None else replace(origin, component=name)
    return FlatParameter(name, unit, meaning, value, positive, place)


def _check_values(parts: Iterable[Part], values: Values) -> None:
    for part in parts:
        for use in part.uses:
            if use.value.names <= values.nominal.keys():
                value = _value(use.value, values.nominal)
                if problem := KINDS[part.kind].role(use.role).problem(value):
                    raise ModelError(f"its {use.role} ({use.meaning}) is {value:g}: it {problem}", use.origin)


def _value(expression: Laurent, nominal: Mapping[str, float]) -> float:
    """Infinite where it has none."""
    try:
        return float(expression.value(nominal))
    except (ZeroDivisionError, OverflowError):
        return float("inf")


# --- Units that the user's own equations tell: of variables and parameters declared without one -----------------------


_DER = "der"
"""Stands for d/dt in a product; as a keyword it is nobody's name."""

KNOWN = ("rad", "rad/s", "rad/s^2", "N m")


def own_units(equations: Iterable[FlatEquation], declared: Mapping[str, str]) -> dict[str, str]:
    """Units of variables and parameters: as declared, and as the terms of equations then require.

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
