"""Units: parsed, written, multiplied; inferred from where a parameter is used, and checked.

Everything is in SI units without prefixes.  Radians are written where they belong, but count as a number: a stiffness
(N m/rad) and a torque (N m) have the same dimension.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from monitor_core.modeling.components.component_kinds import Role
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, Monomial

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
"""The SI base units, in the order in which they are written."""


@dataclass(frozen=True, slots=True)
class Dimension:
    """Exponents of the base units; ``rad`` is kept for writing only and makes no difference."""

    exponents: tuple[int, ...] = (0,) * len(BASE)
    rad: int = field(default=0, compare=False)

    def __mul__(self, other: Dimension) -> Dimension:
        pairs = zip(self.exponents, other.exponents, strict=True)
        return Dimension(tuple(a + b for a, b in pairs), self.rad + other.rad)

    def __truediv__(self, other: Dimension) -> Dimension:
        return self * other**-1

    def __pow__(self, exponent: int) -> Dimension:
        return Dimension(tuple(e * exponent for e in self.exponents), self.rad * exponent)

    def root(self, degree: int) -> Dimension | None:
        """The dimension whose power this is, if there is one; ``degree`` is not zero."""
        if any(e % degree for e in self.exponents):
            return None
        rad = 0 if self.rad % degree else self.rad // degree
        return Dimension(tuple(e // degree for e in self.exponents), rad)

    def __str__(self) -> str:
        return _HOUSE.get((self.exponents, self.rad)) or _text(self.exponents)


ONE = Dimension()


def _dimension(**exponents: int) -> Dimension:
    return Dimension(tuple(exponents.get(unit, 0) for unit in BASE), exponents.get("rad", 0))


_NEWTON = _dimension(kg=1, m=1, s=-2)
_VOLT = _dimension(kg=1, m=2, s=-3, A=-1)
_KNOWN: Mapping[str, Dimension] = MappingProxyType(
    {
        **{unit: _dimension(**{unit: 1}) for unit in (*BASE, "rad")},
        "N": _NEWTON,
        "J": _dimension(kg=1, m=2, s=-2),
        "W": _dimension(kg=1, m=2, s=-3),
        "Pa": _dimension(kg=1, m=-1, s=-2),
        "Hz": _dimension(s=-1),
        "C": _dimension(s=1, A=1),
        "V": _VOLT,
        "Wb": _VOLT * _dimension(s=1),
        "T": _dimension(kg=1, s=-2, A=-1),
        "Ohm": _VOLT / _dimension(A=1),
        "H": _VOLT * _dimension(s=1, A=-1),
    }
)
_TOKEN = re.compile(
    r"\s*(?:(?P<before>[/(])|(?:(?P<name>[^\W\d_]+)|1(?!\d)|(?P<close>\)))(?P<power>\^?-?[0-9]+)?)\s*[.*·]?\s*"
)


class _Reader:
    """Recursive descent over ``quotient = product {"/" factor}``, ``product = factor {factor}``."""

    def __init__(self, text: str) -> None:
        self.tokens: list[re.Match[str]] = []
        position = 0
        while position < len(text):
            token = _TOKEN.match(text, position)
            if token is None:
                raise ValueError(f"{text[position:]!r} is no unit")
            self.tokens.append(token)
            position = token.end()

    def take(self, *marks: str) -> re.Match[str] | None:
        return self.tokens.pop(0) if self.next in marks else None

    @property
    def next(self) -> str:
        if not self.tokens:
            return ""
        return self.tokens[0]["before"] or self.tokens[0]["close"] or "unit"

    def quotient(self) -> Dimension:
        value, divided = self.factor(), False
        while self.next not in ("", ")"):
            if self.take("/"):
                value, divided = value / self.factor(), True
            elif divided:
                raise ValueError('a product below the "/" is written in brackets: "N m/(rad/s)"')
            else:
                value = value * self.factor()
        return value

    def factor(self) -> Dimension:
        if self.take("("):
            value, last = self.quotient(), self.take(")")
        else:
            last = self.take("unit")
            value = self.known(last["name"] or "") if last else ONE
        if last is None:
            raise ValueError("it ends too early, or a bracket is out of place")
        return value ** int((last["power"] or "1").lstrip("^"))

    @staticmethod
    def known(name: str) -> Dimension:
        if name and name not in _KNOWN:
            raise ValueError(f"{name} is not among {' '.join(_KNOWN)}")
        return _KNOWN[name] if name else ONE


@cache
def parse(text: str, origin: Origin | None = None) -> Dimension:
    """The dimension of "kg m^2" or, as Modelica writes it, "kg.m2"; of "N m s/rad" or "N.m/(rad/s)"; of "1".

    Raises:
        ModelError: it is not made of SI units without prefixes.
    """
    try:
        if len(text) > 100:
            raise ValueError("it is longer than 100 characters")
        reader = _Reader(text)
        value = reader.quotient()
        if reader.tokens:
            raise ValueError("a bracket is out of place")
    except ValueError as error:
        raise ModelError(f'unit {text!r}: {error}; right are "kg m^2", "N m/rad", "1"', origin) from error
    return value


def _text(exponents: tuple[int, ...]) -> str:
    """Powers of base units, with a newton in front where there is one: "N m s", "1/(kg m^2)", "kg/s"."""
    mass, _, time, *_ = exponents
    newtons = mass if abs(mass) == 1 and mass * time < 0 else 0
    rest = Dimension(exponents) / _NEWTON**newtons
    powers = [("N", newtons), *zip(BASE, rest.exponents, strict=True)]
    above = " ".join(_power(unit, e) for unit, e in powers if e > 0)
    below = [_power(unit, -e) for unit, e in powers if e < 0]
    divisor = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{above or 1}/{divisor}" if below else above or "1"


def _power(unit: str, exponent: int) -> str:
    return unit if exponent == 1 else f"{unit}^{exponent}"


_HOUSE: Mapping[tuple[tuple[int, ...], int], str] = MappingProxyType(
    {
        (parse(text).exponents, parse(text).rad): text
        for text in ("kg m^2", "N m/rad", "N m s/rad", "N m", "rad", "rad/s", "rad/s^2", "1")
    }
)


# --- Units of parameters, from where they are used --------------------------------------------------------------------


class Use(NamedTuple):
    """A use of parameters in a component: the expression there, the required unit ("": any), the place, and the role.

    ``role`` is None for an equation of the user's own.  ``number``: what was drawn in the place of an expression.
    """

    value: Laurent
    unit: str
    origin: Origin
    role: Role | None = None
    number: float | None = None

    def __str__(self) -> str:
        role = f"{self.role.name} ({self.role.meaning})" if self.role else ""
        return " of ".join(part for part in (role, self.origin.component) if part)

    @property
    def is_name(self) -> bool:
        """Whether the expression is only the name of a parameter."""
        return len(self.value.names) == 1 and self.value == Laurent.symbol(next(iter(self.value.names)))

    def meaning(self, component: str) -> str:
        """What a parameter in it means: inertia of the motor."""
        place = f"{self.role.meaning if self.role else ''} of the {component}"
        return place if self.is_name else f"in the {place}: {self.value}"


def is_positive(name: str, uses: Iterable[Use], value: float | None) -> bool:
    """Whether the parameter is a factor, to an odd power, of something positive.

    To an even power, or in a gear ratio, it may be negative if its value is.
    """
    for use in uses:
        if use.role and use.role.positive and use.value.is_unit:
            ((monomial, coefficient),) = use.value
            strict = not use.role.signed and dict(monomial)[name] % 2 == 1
            if coefficient > 0 if strict else value is None or value >= 0:
                return True
    return False


def is_nonnegative(name: str, uses: Iterable[Use]) -> bool:
    """Whether the parameter is a factor, to an odd power, of something that is not negative."""
    for use in uses:
        if use.role and use.role.nonnegative and use.value.is_unit:
            ((monomial, coefficient),) = use.value
            if dict(monomial)[name] % 2 == 1 and coefficient > 0:
                return True
    return False


def impossible(uses: Iterable[Use], values: Mapping[str, float]) -> Iterator[tuple[Use, Role, float, str]]:
    """Expressions whose value makes no sense in their role, with that value and what it must be.

    Those in which a value is not known are left out.
    """
    for use in uses:
        if use.role and use.value.names <= values.keys():
            try:
                number = float(use.value.value(values))
            except (ZeroDivisionError, OverflowError):
                number = math.inf
            if problem := use.role.problem(number):
                yield use, use.role, number, problem


def infer(uses: Iterable[Use], declared: Mapping[str, str] = MappingProxyType({})) -> dict[str, str]:
    """The unit of every parameter that occurs: as declared, or as its uses require; "" where neither is known.

    A number has no unit, except alone, or as a summand, where it stands for a parameter.

    Args:
        uses: every parameter of every component.
        declared: units that the user gave to parameters; "" is none.

    Raises:
        ModelError: a unit cannot be read, or the uses of a parameter contradict each other.
    """
    found = _Found()
    for name, unit in declared.items():
        if unit:
            found.add(name, parse(unit), "declared so")
    ordered = sorted(uses, key=lambda use: not use.is_name)
    while sum(found.learn(use) for use in ordered):
        pass  # a unit found may be the last but one of the next product
    for use in ordered:
        found.check(use)
    names = dict.fromkeys([*declared, *(name for use in ordered for name in sorted(use.value.names))])
    return {name: str(found.dimension[name]) if name in found.dimension else "" for name in names}


class _Found:
    """The dimensions found so far, and the use that determined each parameter."""

    def __init__(self) -> None:
        self.dimension: dict[str, Dimension] = {}
        self.reason: dict[str, str] = {}

    def add(self, name: str, dimension: Dimension, reason: str) -> None:
        self.dimension[name], self.reason[name] = dimension, reason

    def dimension_of(self, monomial: Monomial) -> Dimension | None:
        """The dimension of a product, if all of its factors are known."""
        product = ONE
        for name, e in monomial:
            if name not in self.dimension:
                return None
            product = product * self.dimension[name] ** e
        return product

    def target(self, use: Use) -> Dimension | None:
        """The dimension of every summand: as required, otherwise that of the first known one."""
        if use.unit:
            return parse(use.unit)
        known = (self.dimension_of(monomial) for monomial, _ in use.value if monomial)
        return next((dimension for dimension in known if dimension), None)

    def learn(self, use: Use) -> bool:
        """Determine the unknown name of each summand with only one; true if there was any."""
        target, before = self.target(use), len(self.dimension)
        for monomial, _ in use.value if target else ():
            unknown = [(name, e) for name, e in monomial if name not in self.dimension]
            if target and len(unknown) == 1:
                self._solve(use, target, monomial, *unknown[0])
        return len(self.dimension) > before

    def _solve(self, use: Use, target: Dimension, monomial: Monomial, name: str, e: int) -> None:
        rest = self.dimension_of(tuple(factor for factor in monomial if factor[0] != name)) or ONE
        dimension = (target / rest).root(e)
        if dimension is not None:  # else it stays unknown: no unit has this power
            self.add(name, dimension, str(use))

    def check(self, use: Use) -> None:
        """Every known summand must have the required dimension."""
        target = self.target(use)
        for monomial, _ in use.value if target else ():
            dimension = self.dimension_of(monomial)
            if monomial and dimension and dimension != target:
                raise ModelError(self._conflict(use, monomial, target, dimension), use.origin)

    def _conflict(self, use: Use, monomial: Monomial, target: Dimension | None, actual: Dimension) -> str:
        reasons = ", ".join(f"{name} is {self.dimension[name]}: {self.reason[name]}" for name, _ in monomial)
        place = f"its {use.role.name} ({use.role.meaning})" if use.role else str(use.value)
        product = Laurent([(monomial, Fraction(1))])
        return f"{place} is in {target}, but {product} is in {actual} ({reasons})"
