"""Sums of variables and of their derivatives, with Laurent coefficients: the sides of flat equations."""

from __future__ import annotations

from collections.abc import Mapping

from monitor_core.modeling.flat import Symbol
from monitor_core.modeling.laurent import Laurent


class Linear:
    """An immutable sum of coefficient * d^k variable / dt^k; terms of coefficient zero are left out."""

    def __init__(self, terms: Mapping[Symbol, Laurent]) -> None:
        self.terms: dict[Symbol, Laurent] = {symbol: c for symbol, c in terms.items() if c}

    @classmethod
    def variable(cls, name: str) -> Linear:
        """The variable itself."""
        return cls({(name, 0): Laurent.number(1)})

    def __neg__(self) -> Linear:
        return Linear({symbol: -c for symbol, c in self.terms.items()})

    def __add__(self, other: Linear) -> Linear:
        terms = dict(self.terms)
        for symbol, c in other.terms.items():
            terms[symbol] = terms.get(symbol, Laurent()) + c
        return Linear(terms)

    def __sub__(self, other: Linear) -> Linear:
        return self + -other

    def __mul__(self, factor: Laurent) -> Linear:
        return Linear({symbol: c * factor for symbol, c in self.terms.items()})


def der(quantity: Linear) -> Linear:
    """The derivative with respect to time; parameters are constant."""
    return Linear({(name, order + 1): c for (name, order), c in quantity.terms.items()})
