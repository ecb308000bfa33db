"""The parameters of a drawing: a table with units, values and meanings from the expressions in its components."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from monitor_core.modeling.components import Role
from monitor_core.modeling.components.uses import Use, first_use, impossible, infer, sign_of
from monitor_core.modeling.drawing.drawn_components import Part
from monitor_core.modeling.drawing.expressions import parse
from monitor_core.modeling.flat import FlatParameter, ModelError, Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.wording import did_you_mean


def uses_of(part: Part) -> dict[str, Use]:
    """The expressions of the parameters of a component, by role.

    Raises:
        ModelError: a role that the component does not have; an invalid expression or number.
    """
    known = {role.name: role for role in part.kind.roles}
    for name in part.parameters:
        if name not in known:
            raise ModelError(
                f"{part.kind.name} has no parameter {name!r}: {did_you_mean(name, known)}", part.origin
            )
    return {name: _use(part, role) for name, role in known.items()}


def _use(part: Part, role: Role) -> Use:
    given, number = part.parameters.get(role.name), role.default
    if given is not None:
        value = parse(given, part.origin) if isinstance(given, str) else None
        if value is not None and not value.is_number:
            return Use(value, role.unit, part.origin, role)
        number = float(given) if value is None else float(value.value({}))
        if problem := role.problem(number):
            raise ModelError(f"its {role.name} ({role.meaning}) is {number:g}: it {problem}", part.origin)
    return Use(Laurent.symbol(f"{part.name}.{role.name}"), role.unit, part.origin, role, number)


def parameters(
    uses: Sequence[Use], nominal: Mapping[str, float], meanings: Mapping[str, str], origin: Origin
) -> tuple[FlatParameter, ...]:
    """Every parameter once, in the order of ``meanings``, then as they occur.

    Raises:
        ModelError: contradicting units of the uses of a parameter; a value that is not finite, or not positive where it
            must be; a name in ``nominal`` or ``meanings`` that does not occur.
    """
    names = dict.fromkeys(name for use in uses for name in sorted(use.value.names))
    for what, given in {"nominal value": nominal, "meaning": meanings}.items():
        for name in given:
            if name not in names:
                raise ModelError(
                    f"{what} of {name!r}, which is no parameter: {did_you_mean(name, names)}", origin
                )
    found = infer(uses)
    table = {name: _parameter(name, found[name], uses, nominal, meanings) for name in names}
    values = {name: p.value for name, p in table.items() if p.value is not None}
    for use, role, number, problem in impossible(uses, values):
        what = f"its {role.name} ({role.meaning}) = {use.value}"
        raise ModelError(f"{what} is {number:g} at the nominal values: it {problem}", use.origin)
    return tuple(table[name] for name in dict.fromkeys([*meanings, *names]))


def _parameter(
    name: str, unit: str, every: Sequence[Use], nominal: Mapping[str, float], meanings: Mapping[str, str]
) -> FlatParameter:
    uses = [use for use in every if name in use.value.names]
    first = first_use(uses)
    meaning = meanings.get(name) or first.meaning(first.origin.component.replace("_", " "))
    value = nominal.get(name, first.number)
    subject = f"nominal value of {name} ({meaning}) is"
    if value is not None and not (isinstance(value, int | float) and math.isfinite(value)):
        raise ModelError(f"{subject} {value!r}: it must be finite", first.origin)
    positive, nonnegative = sign_of(name, uses, value)
    if positive and value is not None and value <= 0:
        raise ModelError(f"{subject} {value:g}: it must be greater than zero", first.origin)
    return FlatParameter(name, unit, meaning, value, positive, nonnegative, first.origin)
