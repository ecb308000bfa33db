"""A parameter of a component as the user writes it: "Jm", "1/r", "m*l^2", "2*(a + b)"."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from types import MappingProxyType

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError

LONGEST, HIGHEST, MOST, LARGEST = 200, 12, 500, 1000
"""Characters of an expression; its exponents, terms, and the bits of its numbers: far beyond any drive, and quick."""
_NAME = r"[^\W\d]\w*(?:\.[^\W\d]\w*)*(?![\w.])"
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])"
_TOKENS = re.compile(rf"(?:\s|[-+*/^()]|{_NAME}|{_NUMBER})*")
_OPERATIONS: Mapping[type[ast.operator], Callable[[Laurent, Laurent], Laurent]] = MappingProxyType(
    {
        ast.Add: lambda a, b: a + b,
        ast.Sub: lambda a, b: a - b,
        ast.Mult: lambda a, b: a * b,
        ast.Div: lambda a, b: a / b,
    }
)


class _UnreadableError(Exception):
    """Why, in words."""


def parse(text: str, origin: Origin | None = None) -> Laurent:
    """The expression as a sum of Laurent terms; names may have dots ("motor.J").

    Raises:
        ModelError: it is not made of names, numbers, + - * / ^ and brackets, or it divides by a sum.
    """
    try:
        return _value(_tree(text))
    except NotLaurentError as error:
        problem = f"{text!r} divides by {error}: only a product can be divided by; name the quotient instead"
    except (_UnreadableError, RecursionError) as error:
        problem = f'{text!r} is not an expression such as "Jm", "1/r", "m*l^2" or "2*(a + b)": {error}'
    raise ModelError(problem, origin)


def _tree(text: str) -> ast.expr:
    if not text.strip():
        raise _UnreadableError("it is empty")
    if len(text) > LONGEST:
        raise _UnreadableError(f"it is longer than {LONGEST} characters")
    matched = _TOKENS.match(text)
    if matched is None or matched.end() < len(text):
        at = matched.end() if matched else 0
        raise _UnreadableError(f"{text[at]!r} at character {at + 1}")
    try:
        return ast.parse(" ".join(text.replace("^", "**").split()), mode="eval").body
    except SyntaxError as error:
        raise _UnreadableError("it ends too early, or an operator or bracket is out of place") from error


def _value(node: ast.expr) -> Laurent:
    match node:
        case ast.Name() | ast.Attribute():
            return Laurent.symbol(ast.unparse(node))
        case ast.Constant(value=int() | float() as number) if _is_number(number):
            return Laurent.number(number)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _value(operand)
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            return _bounded(_power(_value(base), _exponent(_value(exponent))))
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATIONS:
            return _bounded(_OPERATIONS[type(operator)](_value(left), _value(right)))
    raise _UnreadableError(f"{ast.unparse(node)!r} is not arithmetic")


def _is_number(value: float) -> bool:
    return not isinstance(value, bool) and abs(value) < float("inf")


def _power(base: Laurent, exponent: int) -> Laurent:
    if math.comb(len(base.terms) + abs(exponent), abs(exponent)) > MOST and not base.is_unit:
        raise _UnreadableError(f"({base})^{exponent} has too many terms")
    return base**exponent


def _bounded(value: Laurent) -> Laurent:
    numbers = (n for c in value.terms.values() for n in (c.numerator, c.denominator))
    if len(value.terms) > MOST or any(n.bit_length() > LARGEST for n in numbers):
        raise _UnreadableError("multiplied out, it is too long")
    return value


def _exponent(value: Laurent) -> int:
    number = value.terms.get((), Fraction(0))
    if not value.is_number or number.denominator != 1 or abs(number) > HIGHEST:
        raise _UnreadableError(f"the exponent {value} is not a whole number from -{HIGHEST} to {HIGHEST}")
    return int(number)
