"""Units: parsed, written, multiplied.

Everything is in SI units without prefixes.  Radians are written where they belong, but count as a number: a stiffness
(N m/rad) and a torque (N m) have the same dimension.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType

from monitor_core.modeling.flat import ModelError, Origin

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
        """The dimension whose power ``degree`` (not zero) is this one; None: there is none."""
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
