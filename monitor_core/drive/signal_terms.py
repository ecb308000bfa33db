"""Terms that a nominal value can follow: a measured signal, a function of a sum of signals, or a product of these.

    temperature        cos(angle2)        cos(angle2 + angle3)        payload * cos(angle2 - angle3)

The weight of a robot's arm loads an axis with a sum of such terms.  Each link beyond the axis has a cosine and a sine
of its angle to the ground, which is a sum of the angles of the axes before it.  A payload is a further factor.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
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
        total = sum((sign * signals[name] for sign, name in self.addends), np.zeros(()))
        # Value by value: the last bit of a vectorised cosine may depend on the index in the array.
        function = FUNCTIONS[self.function] if self.function else float
        return np.array([function(v) if math.isfinite(v) else math.nan for v in total.tolist()], np.float64)


class Term(NamedTuple):
    """A product of factors."""

    factors: tuple[Factor, ...]

    def __str__(self) -> str:
        return " * ".join(str(factor) for factor in self.factors)

    @classmethod
    def read(cls, text: str) -> Term:
        """The term in a text such as ``temperature`` or ``payload * cos(angle2 + angle3)``.

        Its functions and signals may be unknown.  A blank stands before the minus of a difference, as names of
        signals may contain one.

        Raises:
            ValueError: the text is no term.
        """
        matches = [_FACTOR.fullmatch(part.strip()) for part in text.split("*")]
        if any(match is None for match in matches):
            functions = ", ".join(f"{name}(...)" for name in FUNCTIONS)
            raise ValueError(
                f'"{text}" is neither a signal nor one of {functions} of a signal or of a sum of signals, such as'
                " cos(a + b), nor a product of these, such as payload * cos(a)"
            )
        return cls(tuple(_factor(match) for match in matches if match is not None))

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
        """Whether the term has a cosine or sine, so that it varies with the pose like a weight."""
        return not {"cos", "sin"}.isdisjoint(self.functions)

    @property
    def is_signal(self) -> bool:
        """Whether the term is a single signal."""
        return len(self.factors) == 1 and not self.functions

    def value(self, signals: Mapping[str, Floats]) -> Floats:
        """The term (N,) at values of its signals (N,); NaN where one of them is not finite."""
        first, *others = (factor.value(signals) for factor in self.factors)
        for value in others:
            first = first * value
        return first


def _factor(match: re.Match[str]) -> Factor:
    if match["signal"] is not None:
        return Factor("", ((1, match["signal"]),))
    addends = _ADDEND.finditer(match["inner"])
    return Factor(match["function"], tuple((-1 if "-" in a["sign"] else 1, a["signal"]) for a in addends))
