"""Exact Laurent polynomials in named parameters: the entries of A, B and C.

A Laurent polynomial is a sum of terms  c * theta_1^e1 * theta_2^e2 ...  with rational c and integer exponents, which
may be negative.  Sums, differences and products of Laurent polynomials are Laurent polynomials, and so are quotients by
a single term (a unit of the ring).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import Any

Monomial = tuple[tuple[str, int], ...]
"""Names with their exponents, sorted by name, none of them zero."""


class NotLaurentError(ArithmeticError):
    """A quotient that is not a sum of Laurent terms; the text is the divisor."""


class Laurent:
    """An immutable sum of Laurent terms with rational coefficients."""

    def __init__(self, terms: Iterable[tuple[Monomial, Fraction]] = ()) -> None:
        """From pairs of monomial and coefficient, each monomial once."""
        self.terms: dict[Monomial, Fraction] = {m: c for m, c in terms if c}

    @classmethod
    def number(cls, value: int | float | str | Fraction) -> Laurent:
        """A constant; a float means the decimal number of its printed form."""
        return cls([((), Fraction(str(value)) if isinstance(value, float) else Fraction(value))])

    @classmethod
    def symbol(cls, name: str, exponent: int = 1) -> Laurent:
        """A parameter, or a power of it."""
        return cls([(((name, exponent),) if exponent else (), Fraction(1))])

    def __bool__(self) -> bool:
        return bool(self.terms)

    @property
    def is_unit(self) -> bool:
        """Whether there is exactly one term, which allows division."""
        return len(self.terms) == 1

    @property
    def is_number(self) -> bool:
        """Whether the sum contains no parameter."""
        return all(monomial == () for monomial in self.terms)

    @cached_property
    def names(self) -> frozenset[str]:
        """The parameters that occur."""
        return frozenset(name for monomial in self.terms for name, _ in monomial)

    def __iter__(self) -> Iterator[tuple[Monomial, Fraction]]:
        return iter(sorted(self.terms.items()))

    def __eq__(self, other: object) -> bool:
        return self.terms == other.terms if isinstance(other, Laurent) else NotImplemented

    def __hash__(self) -> int:
        return hash(frozenset(self.terms.items()))

    def __neg__(self) -> Laurent:
        return Laurent((m, -c) for m, c in self.terms.items())

    def __add__(self, other: Laurent) -> Laurent:
        terms = dict(self.terms)
        for m, c in other.terms.items():
            terms[m] = terms.get(m, Fraction(0)) + c
        return Laurent(terms.items())

    def __sub__(self, other: Laurent) -> Laurent:
        return self + -other

    def __mul__(self, other: Laurent) -> Laurent:
        terms: dict[Monomial, Fraction] = {}
        for m1, c1 in self.terms.items():
            for m2, c2 in other.terms.items():
                m = _product(m1, m2)
                terms[m] = terms.get(m, Fraction(0)) + c1 * c2
        return Laurent(terms.items())

    def __truediv__(self, other: Laurent) -> Laurent:
        if other.is_unit:
            return self * other**-1
        quotient = _exact_quotient(self, other) if other else None
        if quotient is None:
            raise NotLaurentError(str(other))
        return quotient

    def __pow__(self, exponent: int) -> Laurent:
        if exponent < 0:
            if not self.is_unit:
                raise NotLaurentError(str(self))
            ((m, c),) = self.terms.items()
            return Laurent([(tuple((name, e * exponent) for name, e in m), c**exponent)])
        out = Laurent.number(1)
        for _ in range(exponent):
            out = out * self
        return out

    def substitute(self, replacements: Mapping[str, Laurent]) -> Laurent:
        """Replace parameters by Laurent sums.

        Raises:
            NotLaurentError: a negative power of something that is not a single term.
        """
        if self.names.isdisjoint(replacements):
            return self
        out = Laurent()
        for m, c in self.terms.items():
            product = Laurent([((), c)])
            for name, e in m:
                product = product * replacements.get(name, Laurent.symbol(name)) ** e
            out = out + product
        return out

    def derivative(self, name: str) -> Laurent:
        """The partial derivative with respect to a parameter."""
        out: list[tuple[Monomial, Fraction]] = []
        for m, c in self.terms.items():
            e = dict(m).get(name, 0)
            out.append((_product(m, ((name, -1),)), c * e))
        return Laurent(out)

    def value(self, values: Mapping[str, Any]) -> Any:
        """The number at the given parameter values, of type float, complex or Fraction."""
        exact = all(isinstance(values[name], int | Fraction) for name in self.names)
        return sum(
            (c if exact else float(c)) * math.prod(Fraction(values[n]) ** e if exact else values[n] ** e for n, e in m)
            for m, c in self
        )

    def __str__(self) -> str:
        if not self:
            return "0"
        if len(self.terms) == 1:
            ((m, c),) = self.terms.items()
            return _term_text(m, c)
        common, rest = self.common_factor()
        inner = rest.sum_text()
        if common == Laurent.number(1):
            return inner
        ((m, c),) = common.terms.items()
        return _term_text(m, c, f"({inner})")

    __repr__ = __str__

    def common_factor(self) -> tuple[Laurent, Laurent]:
        """A single term and a rest, whose product this is: the lowest power of each parameter, and the sign."""
        lowest: dict[str, int] = {}
        for name in self.names:
            lowest[name] = min(dict(m).get(name, 0) for m in self.terms)
        sign = -1 if all(c < 0 for c in self.terms.values()) else 1
        common = Laurent([(tuple(sorted((n, e) for n, e in lowest.items() if e)), Fraction(sign))])
        return common, self / common

    def sum_text(self) -> str:
        """Text as a plain sum, without brackets: the name of a merged parameter."""
        ordered = sorted(self, key=lambda term: (term[1] < 0, len(term[0])))  # positive and short terms first
        text = " + ".join(_term_text(m, c) for m, c in ordered)
        return text.replace("+ -", "- ")


def _product(m1: Monomial, m2: Monomial) -> Monomial:
    if not m1:
        return m2
    if not m2:
        return m1
    exponents = dict(m1)
    for name, e in m2:
        exponents[name] = exponents.get(name, 0) + e
    return tuple(sorted((name, e) for name, e in exponents.items() if e))


def _exact_quotient(dividend: Laurent, divisor: Laurent) -> Laurent | None:
    """The quotient where the division leaves no rest and the quotient is a single term, otherwise None."""
    if not dividend:
        return Laurent()
    if len(dividend.terms) != len(divisor.terms):
        return None
    m1, c1 = max(dividend)
    for m2, c2 in divisor:
        candidate = Laurent([(m1, c1)]) / Laurent([(m2, c2)])
        if candidate * divisor == dividend:
            return candidate
    return None


def _term_text(m: Monomial, c: Fraction, inner: str = "") -> str:
    """``-2*kg*r/(3*Jm)``: a term, times text that is in brackets already."""
    above = [_power(name, e) for name, e in m if e > 0] + ([inner] if inner else [])
    below = [_power(name, -e) for name, e in m if e < 0]
    if abs(c.numerator) != 1 or not above:
        above.insert(0, str(abs(c.numerator)))
    if c.denominator != 1:
        below.insert(0, str(c.denominator))
    text = ("-" if c < 0 else "") + "*".join(above)
    if not below:
        return text
    return f"{text}/{below[0]}" if len(below) == 1 else f"{text}/({'*'.join(below)})"


def _power(name: str, e: int) -> str:
    plain = name.replace(".", "").replace("_", "").isalnum()
    factor = name if plain else f"({name})"  # a merged parameter is named by its sum
    return factor if e == 1 else f"{factor}^{e}"
