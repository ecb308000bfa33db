"""The parameters of the flat model: those that the user named and that still occur."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from monitor_core.modeling.components import KINDS, Role
from monitor_core.modeling.flat import FlatEquation, FlatParameter, ModelError, Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica.instances import Instance
from monitor_core.modeling.modelica.leaves import Part
from monitor_core.modeling.modelica.syntax import Literal, Number
from monitor_core.modeling.modelica.values import Values
from monitor_core.modeling.parameters import is_positive
from monitor_core.modeling.units import infer, parse


def flat_parameters(
    model: Instance, parts: Sequence[Part], equations: Iterable[FlatEquation], values: Values
) -> tuple[FlatParameter, ...]:
    """All parameters that occur in the equations, in the order in which they are declared.

    Raises:
        ModelError: units that do not fit; a value that makes no sense (an inertia of zero).
    """
    occurring = {name for e in equations for c in e.terms.values() for name in c.names}
    written = {i.path: i for i in model.tree() if i.base == "Real" and i.is_parameter}
    declared = {path: unit_of(i) for path, i in written.items() if path in occurring}
    units = infer([use for part in parts for use in part.uses], declared)
    _check_values(parts, values)
    roles = _roles(parts)
    uses = _uses(parts)
    tables = [name for name in sorted(occurring) if name not in written]  # of bearings
    return tuple(
        _parameter(name, written.get(name), units.get(name, ""), values, roles, uses)
        for name in [*(path for path in written if path in occurring), *tables]
    )


def unit_of(instance: Instance) -> str:
    """The unit that the type or a modification gives, as units.py writes it; "" if none.

    Raises:
        ModelError: it cannot be read.
    """
    change = instance.attributes.get("unit")
    value = change.value.expression if change is not None and change.value is not None else None
    if not isinstance(value, Literal) or not isinstance(value.value, str) or not value.value:
        return ""
    return str(parse(value.value, instance.origin))


Roles = dict[str, tuple[Role, Part]]


def _roles(parts: Iterable[Part]) -> Roles:
    """Parameter -> the first role that it fills all by itself."""
    roles: Roles = {}
    for part in parts:
        for use in part.uses:
            for name in use.value.names:
                if use.value == Laurent.symbol(name):
                    roles.setdefault(name, (KINDS[part.kind].role(use.role), part))
    return roles


def _uses(parts: Iterable[Part]) -> dict[str, list[tuple[Role, Laurent]]]:
    """Parameter -> where it occurs: the role and the expression that fills it."""
    uses: dict[str, list[tuple[Role, Laurent]]] = {}
    for part in parts:
        for use in part.uses:
            for name in use.value.names:
                uses.setdefault(name, []).append((KINDS[part.kind].role(use.role), use.value))
    return uses


def _parameter(
    name: str,
    written: Instance | None,
    unit: str,
    values: Values,
    roles: Roles,
    uses: Mapping[str, list[tuple[Role, Laurent]]],
) -> FlatParameter:
    role, part = roles.get(name, (None, None))
    comment = written.declaration.comment if written is not None and written.declaration is not None else ""
    meaning = comment or (
        f"{role.meaning} of {part.origin.component}" if role is not None and part is not None else ""
    )
    value = values.nominal.get(name)
    positive = _declared_positive(written) or is_positive(name, uses.get(name, ()), value)
    return FlatParameter(name, unit, meaning, value, positive, _origin(name, written, part))


def _declared_positive(written: Instance | None) -> bool:
    """``Real kT(min = 1e-3)``: a least value above zero."""
    change = written.attributes.get("min") if written is not None else None
    least = change.value.expression if change is not None and change.value is not None else None
    return isinstance(least, Number) and least.value > 0


def _origin(name: str, written: Instance | None, part: Part | None) -> Origin:
    """Where its value is written, else where it is declared, else its component."""
    if written is not None:
        bound = written.binding
        return replace(bound.origin if bound is not None else written.origin, component=name)
    return replace(part.origin, component=name) if part is not None else Origin(name)


def _check_values(parts: Iterable[Part], values: Values) -> None:
    for part in parts:
        for use in part.uses:
            if use.value.names <= values.nominal.keys():
                value = float(use.value.value(values.nominal))
                problem = KINDS[part.kind].role(use.role).problem(value)
                if problem:
                    raise ModelError(f"its {use.role} ({use.meaning}) is {value:g}: it {problem}", use.origin)
