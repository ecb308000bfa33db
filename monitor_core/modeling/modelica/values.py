"""Values of expressions: Laurent sums in free parameters, and sums of variables with such factors."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from pymoca import ast
from pymoca.tree import InstanceSymbol, find_name

from monitor_core.modeling.components.fragments import LinearForm, der
from monitor_core.modeling.flat import CONSTANT, ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modelica.parsing import is_parameter, place_of


def is_given(value: object) -> bool:
    """Whether an attribute of a symbol has a value."""
    return value is not None and not (isinstance(value, ast.Primary) and value.value is None)


def plain(value: object) -> object:
    """The number, truth value or text of an attribute; None for anything else."""
    found = value.value if isinstance(value, ast.Primary) else value
    return found if isinstance(found, bool | int | float | str) else None


@dataclass
class ExpressionValues:
    """Evaluates expressions.

    A parameter with a value that is a number stays a parameter, that number its nominal value, unless it is final or
    a constant; a parameter with a value in terms of others is replaced by it.

    ``symbols``: of the flat class, by path.  ``places``: where each is declared.  ``root``: the tree of all classes,
    for constants of packages.  ``nominal``: the values found so far.
    """

    symbols: Mapping[str, ast.Symbol]
    places: Mapping[str, Origin]
    root: ast.Tree
    nominal: dict[str, float] = field(default_factory=dict)
    _known: dict[str, Laurent] = field(default_factory=dict)
    _busy: list[str] = field(default_factory=list)

    def place(self, name: str) -> Origin:
        """Place of the value of a parameter, or else of its declaration, or else of its component."""
        value, declared = self.symbols[name].value, self.places[name]
        written = Origin() if isinstance(value, InstanceSymbol) else place_of(value, name)
        return written if written.file else replace(declared, component=name)

    def parameter(self, name: str) -> Laurent:
        """The value of a parameter in terms of the free ones."""
        if name not in self._known:
            if name in self._busy:
                ring = [*self._busy[self._busy.index(name) :], name]
                raise ModelError(f"its value depends on itself: {' -> '.join(ring)}", self.place(self._busy[-1]))
            self._busy.append(name)
            self._known[name] = self._value(name)
            self._busy.pop()
        return self._known[name]

    def _value(self, name: str) -> Laurent:
        symbol = self.symbols[name]
        if not is_given(symbol.value):
            if "constant" in symbol.prefixes:
                raise ModelError("a constant needs a value", self.place(name))
            return Laurent.symbol(name)
        value = self.constant(symbol.value, self.place(name))
        folded = symbol.final or "constant" in symbol.prefixes or symbol.type.name == "Integer"
        if folded or not value.is_number:
            return value
        self.nominal[name] = number_of(value, self.place(name))
        return Laurent.symbol(name)

    def constant(self, node: Any, origin: Origin) -> Laurent:
        """The value of an expression without variables."""
        value = self.linear(node, origin)
        found = without_variables(value)
        if found is None:
            names = ", ".join(sorted(name for name, _ in value.terms if name != CONSTANT))
            raise ModelError(f"a parameter cannot depend on a variable: {names}", origin)
        return found

    def linear(self, node: Any, origin: Origin) -> LinearForm:
        """The value of an expression that is linear in the variables."""
        match node:
            case ast.Primary(value=value):
                return self.linear(value, origin)
            case bool() | str():
                shown = f'"{node}"' if isinstance(node, str) else str(node).lower()
                raise ModelError(f"{shown} is not a number", origin)
            case int() | float():
                if not abs(node) < float("inf"):
                    raise ModelError("a number is too large to calculate with", origin)
                return constant(Laurent.number(node))
            case InstanceSymbol():
                return self._name(node.full_instance_name.partition(".")[2], node, origin)
            case ast.ComponentRef():
                if any(index is not None for indices in node.indices for index in indices):
                    raise ModelError(f"{node}[..]: arrays are not supported", origin)
                return self._name(str(node), None, origin)
            case ast.Expression(operator="der", operands=[argument]):
                value = self.linear(argument, origin)
                return der(LinearForm({s: c for s, c in value.terms.items() if s[0] != CONSTANT}))
            case ast.Expression(operator=str() as symbol, operands=operands):
                return operation(symbol.removeprefix("."), [self.linear(o, origin) for o in operands], origin)
            case ast.Expression():
                return self._call(node, origin)
            case ast.Array() | list():
                raise ModelError("arrays are not supported", origin)
        raise ModelError("only numbers, names, + - * / ^ and der(...) are supported", origin)

    def _call(self, call: ast.Expression, origin: Origin) -> LinearForm:
        name = str(call.operator)
        function = FUNCTIONS[name.removeprefix("Modelica.Math.")]  # others: refused with all names
        arguments = [without_variables(self.linear(argument, origin)) for argument in call.operands]
        numbers = [argument for argument in arguments if argument is not None]
        if len(numbers) < len(arguments):
            instead = ", and gravity is AxisWatch.Gravity" if name in ("sin", "cos") else ""
            raise ModelError(f"{name} of a variable: equations must be linear{instead}", origin)
        free = sorted({n for number in numbers for n in number.names})
        if free:
            raise ModelError(
                f"{name} of a parameter ({', '.join(free)}) is not supported: make {name}(...) a parameter of its own",
                origin,
            )
        try:
            return constant(Laurent.number(float(function(*(number_of(n, origin) for n in numbers)))))
        except (ValueError, TypeError, OverflowError):
            raise ModelError(f"{name} is not defined for these arguments", origin) from None

    def _name(self, name: str, found: ast.Symbol | None, origin: Origin) -> LinearForm:
        if name == "time":
            raise ModelError("equations cannot depend on time", origin)
        symbol = self.symbols.get(name)
        if symbol is None:
            return constant(self._outside(name, found, origin))
        if symbol.type.name not in ("Real", "Integer"):
            raise ModelError(f"{name} is of type {symbol.type.name}, not a number", origin)
        return constant(self.parameter(name)) if is_parameter(symbol) else LinearForm.variable(name)

    def _outside(self, name: str, found: ast.Symbol | None, origin: Origin) -> Laurent:
        """A constant of a package."""
        symbol = found.ast_ref if isinstance(found, InstanceSymbol) else find_name(self.root, name)
        if isinstance(symbol, ast.Symbol) and "constant" in symbol.prefixes and name not in self._busy:
            for change in symbol.class_modification.arguments if symbol.class_modification else ():
                if str(change.value.component) == "value":
                    self._busy.append(name)
                    value = self.constant(change.value.modifications[0], origin)
                    self._busy.pop()
                    return value
        raise ModelError(f"{name} is not a number, and not a constant with a value", origin)


# --- Sums, products, quotients and powers -----------------------------------------------------------------------------


def operation(symbol: str, values: Sequence[LinearForm], origin: Origin) -> LinearForm:
    """An operation on the values of its operands."""
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
        raise ModelError("this power cannot be calculated: it is too large, or not a real number", origin) from None
    except NotLaurentError as error:
        raise ModelError(
            f"{error} is not a single product, so a division by it is not supported: make the quotient a parameter",
            origin,
        ) from None
    if symbol not in ("*", "/", "^"):
        raise ModelError(f'"{symbol}" is not supported: only + - * / ^ and der(...) are', origin)
    raise ModelError(f'"{symbol}" of variables: equations must be linear, with constant coefficients', origin)


def without_variables(value: LinearForm) -> Laurent | None:
    """The constant part; None if there are variables."""
    if any(name != CONSTANT for name, _ in value.terms):
        return None
    return value.terms.get((CONSTANT, 0), Laurent())


def number_of(value: Laurent, origin: Origin) -> float:
    """The number of a constant without parameters."""
    try:
        return float(value.value({}))
    except OverflowError:
        raise ModelError("this number is too large to calculate with", origin) from None


def constant(value: Laurent) -> LinearForm:
    """A sum without variables."""
    return LinearForm({(CONSTANT, 0): value})


def _divided(value: LinearForm, divisor: Laurent) -> LinearForm:
    if not divisor:
        raise ZeroDivisionError
    return LinearForm({symbol: c / divisor for symbol, c in value.terms.items()})


def _power(base: Laurent, exponent: Laurent) -> Laurent:
    """The power.  ValueError: it does not exist; OverflowError: it is no finite number, or a very long sum."""
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
        raise ValueError(f"({base})^({exponent}) is not a whole power: make it a parameter of its own")
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
