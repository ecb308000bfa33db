"""Sums, products, quotients and powers of sums of variables with Laurent coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from monitor_core.modeling.components.linear import Linear
from monitor_core.modeling.flat import CONSTANT, ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError


def operation(symbol: str, values: Sequence[Linear], origin: Origin) -> Linear:
    """An operation on the values of its operands.

    Raises:
        ModelError: the result is not linear in the variables, or its coefficients are no Laurent sums.
    """
    if len(values) == 1 and symbol in "+-":
        return values[0] if symbol == "+" else -values[0]
    left, right = values[0], values[-1]
    if symbol in ("+", "-"):
        return left + right if symbol == "+" else left - right
    factors = [without_variables(value) for value in values]
    try:
        if symbol == "*" and factors[0] is not None:
            return right * factors[0]
        if symbol == "*" and factors[1] is not None:
            return left * factors[1]
        if symbol == "/" and factors[1] is not None:
            return _divided(left, factors[1])
        if symbol == "^" and factors[0] is not None and factors[1] is not None:
            return constant(_power(factors[0], factors[1]))
    except ZeroDivisionError:
        raise ModelError("a division by zero", origin) from None
    except ValueError as error:
        raise ModelError(str(error), origin) from None
    except OverflowError:
        raise ModelError("this power cannot be calculated with", origin) from None
    except NotLaurentError as error:
        raise ModelError(
            f"{error} cannot be divided by, being no single product: give the whole a name of its own",
            origin,
        ) from None
    if symbol not in ("*", "/", "^"):
        raise ModelError(f'"{symbol}" is not supported: only + - * / ^ and der(...) are', origin)
    raise ModelError(f'"{symbol}" of variables: equations must be linear, with constant coefficients', origin)


def without_variables(value: Linear) -> Laurent | None:
    """The constant part; None if there are variables."""
    if any(name != CONSTANT for name, _ in value.terms):
        return None
    return value.terms.get((CONSTANT, 0), Laurent())


def number_of(value: Laurent, origin: Origin) -> float:
    """The number of a constant without parameters.

    Raises:
        ModelError: it is too large.
    """
    try:
        return float(value.value({}))
    except OverflowError:
        raise ModelError("this number is too large to calculate with", origin) from None


def constant(value: Laurent) -> Linear:
    """A sum without variables."""
    return Linear({(CONSTANT, 0): value})


def _divided(value: Linear, divisor: Laurent) -> Linear:
    if not divisor:
        raise ZeroDivisionError
    return Linear({symbol: c / divisor for symbol, c in value.terms.items()})


def _power(base: Laurent, exponent: Laurent) -> Laurent:
    """The power; ValueError with what is wrong, OverflowError where it would be no number, or a very long sum."""
    if not exponent.is_number:
        raise ValueError(f"the exponent {exponent} is not a number")
    number = Fraction(exponent.value({}))
    if not base and number < 0:
        raise ZeroDivisionError
    if base.is_number:
        value = float(base.value({})) ** float(number)
        if isinstance(value, complex):
            raise OverflowError
        return base ** int(number) if _is_small(number) else Laurent.number(value)
    if number.denominator > 1:
        raise ValueError(f"({base})^({exponent}) is not a whole power: give it a name of its own")
    if not _is_small(number) or len(base.terms) ** abs(number) > _MOST_TERMS:
        raise OverflowError
    return base ** int(number)


def _is_small(exponent: Fraction) -> bool:
    return exponent.denominator == 1 and abs(exponent) <= _HIGHEST


_HIGHEST, _MOST_TERMS = 12, 1000


# --- The functions that may be applied to numbers in a Modelica text --------------------------------------------------


FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "abs": abs,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "log10": math.log10,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "min": min,
    "max": max,
}
