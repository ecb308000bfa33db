"""Conditions of components, evaluated before anything is solved."""

from __future__ import annotations

from fractions import Fraction

from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.modelica.instances import Bound
from monitor_core.modeling.modelica.lookup import component
from monitor_core.modeling.modelica.syntax import Literal, Name, Operation
from monitor_core.modeling.modelica.values import Values


def truth(condition: Bound, values: Values) -> bool:
    """Whether the condition of a component holds.

    Raises:
        ModelError: it depends on more than constants and parameters that are given.
    """
    expression, scope = condition.expression, condition.scope
    match expression:
        case Literal(value=bool(value)):
            return value
        case Operation(symbol="not", operands=(inner,)):
            return not truth(Bound(inner, scope), values)
        case Operation(symbol="and" | "or" as symbol, operands=operands):
            return (all if symbol == "and" else any)(truth(Bound(o, scope), values) for o in operands)
        case Operation(symbol=symbol, operands=(left, right)) if symbol in _COMPARISONS:
            difference = values.constant(left, scope) - values.constant(right, scope)
            if difference.is_number:
                return _compare(symbol, difference.value({}))
        case Name():
            found = component(expression, scope)
            if found is not None and found.base == "Boolean" and found.binding is not None:
                return truth(found.binding, values)
    raise ModelError(
        "its condition is not known: only Boolean parameters with a value decide", condition.origin
    )


_COMPARISONS = ("==", "<>", "<", "<=", ">", ">=")


def _compare(symbol: str, difference: Fraction) -> bool:
    equal, less = difference == 0, difference < 0
    return {
        "==": equal,
        "<>": not equal,
        "<": less,
        "<=": less or equal,
        ">": not less and not equal,
        ">=": not less,
    }[symbol]
