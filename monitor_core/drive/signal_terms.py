"""Terms that a nominal value can follow: a signal, a function of a sum of signals, a product of these, or their sum.

    temperature        cos(angle2)        cos(angle2 + angle3)        payload * cos(angle2 - angle3)

The weight of a robot's arm loads an axis with a sum of such terms.  Each link beyond the axis has a cosine and a sine
of its angle to the ground, which is a sum of the angles of the axes before it.  A payload is a further factor.

A sum of products is one term with one slope.  The torque of an inertia that follows the pose, for example, is the rate
of change of cos(angle2) * speed1, which is

    acceleration1 * cos(angle2) - speed1 * speed2 * sin(angle2)
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats

FUNCTIONS: Mapping[str, Callable[[float], float]] = MappingProxyType(
    {"cos": math.cos, "sin": math.sin, "square": lambda value: value * value}
)
"""Functions of a signal, or of a sum of signals: cos(angle2 + angle3)."""

_NAME = r"(?=[\w-]*[^\W\d])\w[\w-]*"  # with a letter: 2 is no signal
_SUM = rf"(?:-\s*)?{_NAME}(?:\s*\+\s*{_NAME}|\s+-\s*{_NAME})*"
_FACTOR = re.compile(rf"(?:(?P<function>\w+)\s*\(\s*(?P<inner>{_SUM})\s*\))|(?P<signal>{_NAME})")
_ADDEND = re.compile(rf"(?P<sign>^-\s*|\s*\+\s*|\s+-\s*|^)(?P<signal>{_NAME})")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_NEXT_PRODUCT = re.compile(r"\s*\+\s*|\s+-\s*")


class Factor(NamedTuple):
    """A signal (``function`` is empty), or a function of a sum of signals, each with its sign."""

    function: str
    addends: tuple[tuple[int, str], ...]

    def __str__(self) -> str:
        (sign, first), *others = self.addends
        inner = ("-" if sign < 0 else "") + first
        inner += "".join(f" {'-' if sign < 0 else '+'} {name}" for sign, name in others)
        return f"{self.function}({inner})" if self.function else inner

    def value(self, signals: Mapping[str, Floats]) -> Floats:
        """The factor (N,) at values of its signals (N,); NaN where one of them is not finite."""
        total = np.asarray(sum((sign * signals[name] for sign, name in self.addends), np.zeros(())))
        if self.function in ("", "square"):
            known = np.where(np.isfinite(total), total, math.nan)
            return known * known if self.function else known
        # Value by value: the last bit of a vectorised cosine may depend on the index in the array.
        function = FUNCTIONS[self.function]
        return np.array([function(v) if math.isfinite(v) else math.nan for v in total.tolist()], np.float64)


class SignalProduct(NamedTuple):
    """A number times a product of factors."""

    factors: tuple[Factor, ...]
    number: float = 1.0

    def __str__(self) -> str:
        """The product without its sign."""
        number = () if abs(self.number) == 1 else (f"{abs(self.number):.12g}",)
        return " * ".join((*number, *map(str, self.factors)))


class Term(NamedTuple):
    """A sum of products."""

    products: tuple[SignalProduct, ...]

    def __str__(self) -> str:
        first, *others = self.products
        found = f"-{first}" if first.number < 0 else str(first)
        return found + "".join(f" {'-' if p.number < 0 else '+'} {p}" for p in others)

    @classmethod
    def product(cls, *factors: Factor) -> Term:
        """The term that is a product of these factors."""
        return cls((SignalProduct(factors),))

    @classmethod
    def read(cls, text: str) -> Term:
        """The term in a text such as ``temperature`` or ``payload * cos(angle2 + angle3)``.

        Its functions and signals may be unknown.  A blank stands before the minus of a difference, as names of
        signals may contain one.

        Raises:
            ValueError: the text is no term.
        """
        products = [_product(sign, part) for sign, part in _addends(text.strip())]
        if any(product is None for product in products):
            functions = ", ".join(f"{name}(...)" for name in FUNCTIONS)
            raise ValueError(
                f'"{text}" is neither a signal nor one of {functions} of a signal or of a sum of signals, such as'
                " cos(a + b), nor a product of these, such as payload * cos(a), nor a sum of products"
            )
        return cls(tuple(product for product in products if product is not None))

    @property
    def factors(self) -> tuple[Factor, ...]:
        """The factors of all products."""
        return tuple(factor for product in self.products for factor in product.factors)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals in the term, each once."""
        return tuple(dict.fromkeys(name for factor in self.factors for _, name in factor.addends))

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the functions in the term, each once."""
        return tuple(dict.fromkeys(factor.function for factor in self.factors if factor.function))

    @property
    def turns(self) -> bool:
        """Whether the term has a cosine or sine: it varies with the pose, as weight and inertia of an arm do."""
        return not {"cos", "sin"}.isdisjoint(self.functions)

    @property
    def is_load(self) -> bool:
        """Whether it is the torque of what the axis carries: it turns, or multiplies a load and its acceleration."""
        return self.turns or any(sum(not f.function for f in p.factors) > 1 for p in self.products)

    @property
    def is_signal(self) -> bool:
        """Whether the term is a single signal."""
        return len(self.factors) == 1 and not self.functions and self.products[0].number == 1

    def value(self, signals: Mapping[str, Floats], values: dict[Factor, Floats] | None = None) -> Floats:
        """The term (N,) at values of its signals (N,); NaN where one of them is not finite.

        ``values``: of factors for the same signals, as other terms may have the same; those of this one are added.
        """
        values = {} if values is None else values
        for factor in self.factors:
            if factor not in values:
                values[factor] = factor.value(signals)
        first, *others = (_multiplied(product, values) for product in self.products)
        for value in others:
            first = first + value
        return first


def _multiplied(product: SignalProduct, values: Mapping[Factor, Floats]) -> Floats:
    first, *others = (values[factor] for factor in product.factors)
    for value in others:
        first = first * value
    return first if product.number == 1 else product.number * first


def _addends(text: str) -> Iterator[tuple[int, str]]:
    """The products in a text, each with its sign: parts between plus and minus signs outside of parentheses."""
    sign, start, place = 1, 0, 0
    if text.startswith("-"):
        sign, start = -1, 1
    place = start
    while place < len(text):
        following = _NEXT_PRODUCT.match(text, place)
        if following and text.count("(", start, place) == text.count(")", start, place):
            yield sign, text[start:place]
            sign, start = (-1 if "-" in following[0] else 1), following.end()
            place = start
        else:
            place += 1
    yield sign, text[start:]


def _product(sign: int, text: str) -> SignalProduct | None:
    """The product in a text, times a sign; None: it is no product."""
    parts = [part.strip() for part in text.split("*")]
    number = float(parts.pop(0)) if _NUMBER.fullmatch(parts[0]) else 1.0
    matches = [_FACTOR.fullmatch(part) for part in parts]
    factors = tuple(_factor(match) for match in matches if match is not None)
    return SignalProduct(factors, sign * number) if parts and len(factors) == len(parts) and number else None


def _factor(match: re.Match[str]) -> Factor:
    if match["signal"] is not None:
        return Factor("", ((1, match["signal"]),))
    addends = _ADDEND.finditer(match["inner"])
    return Factor(match["function"], tuple((-1 if "-" in a["sign"] else 1, a["signal"]) for a in addends))
