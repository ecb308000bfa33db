"""Units of parameters: inferred from where a parameter is used, and checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import NamedTuple

from monitor_core.modeling.components.unit_algebra import ONE, Dimension, parse
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, Monomial

__all__ = ["Dimension", "Use", "infer", "parse", "unit_of"]


class Use(NamedTuple):
    """A use of a parameter in a component: the text there, the required unit ("": any), and the place.

    ``role`` and ``meaning`` ("J", "inertia") are for messages.
    """

    value: Laurent
    unit: str
    origin: Origin
    role: str = ""
    meaning: str = ""

    def __str__(self) -> str:
        role = f"{self.role} ({self.meaning})" if self.meaning else self.role
        return " of ".join(part for part in (role, self.origin.component) if part)


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
    ordered = sorted(uses, key=lambda use: not _is_name(use.value))
    while sum(found.learn(use) for use in ordered):
        pass  # a unit found may be the last but one of the next product
    for use in ordered:
        found.check(use)
    names = dict.fromkeys([*declared, *(name for use in ordered for name in sorted(use.value.names))])
    return {name: str(found.dimension[name]) if name in found.dimension else "" for name in names}


def unit_of(value: Laurent, units: Mapping[str, str]) -> str:
    """The unit of an expression in parameters whose units are known; "" where one of them is not.

    Raises:
        ModelError: a sum of different units.
    """
    found = _Found()
    for name, unit in units.items():
        if unit:
            found.add(name, parse(unit), "given")
    use = Use(value, "", Origin())
    found.check(use)
    known = [found.dimension_of(monomial) for monomial, _ in value if monomial or value.is_number]
    return "" if not known or None in known else str(known[0])


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
        place = f"its {use.role} ({use.meaning})" if use.role else str(use.value)
        product = Laurent([(monomial, Fraction(1))])
        return f"{place} is in {target}, but {product} is in {actual} ({reasons})"


def _is_name(value: Laurent) -> bool:
    return len(value.names) == 1 and value == Laurent.symbol(next(iter(value.names)))
