"""Parts of a drive, and the uses of parameters in them, which determine units, signs and meanings."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import NamedTuple

from monitor_core.modeling.components.component_kinds import ComponentKind, Role, fragment
from monitor_core.modeling.components.fragments import Fragment
from monitor_core.modeling.components.units import ONE, Dimension, parse
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent, Monomial


class Use(NamedTuple):
    """A use of parameters in a component: the expression there, the required unit ("": any), the place, and the role.

    ``role`` is None for an equation of the user's own.
    """

    value: Laurent
    unit: str
    origin: Origin
    role: Role | None = None

    def __str__(self) -> str:
        role = f"{self.role.name} ({self.role.meaning})" if self.role else ""
        return " of ".join(part for part in (role, self.origin.component) if part)

    @property
    def is_name(self) -> bool:
        """Whether the expression is only the name of a parameter."""
        return len(self.value.names) == 1 and self.value == Laurent.symbol(next(iter(self.value.names)))

    def meaning(self, component: str) -> str:
        """Meaning of a parameter in this use: "inertia of the motor"."""
        place = f"{self.role.meaning if self.role else ''} of the {component}"
        return place if self.is_name else f"in the {place}: {self.value}"


@dataclass(frozen=True, slots=True)
class DriveComponent:
    """A component in a drive: its kind, its name, its parameters by role, where it is drawn, and where its flanges are.

    ``uses``: of its parameters, for their units and signs.  ``nodes``: parts at one node are connected there.
    """

    kind: ComponentKind
    name: str
    parameters: Mapping[str, Laurent]
    origin: Origin
    uses: tuple[Use, ...]
    nodes: tuple[str, ...]

    def fragment(self) -> Fragment:
        """Its variables and equations."""
        return fragment(self.kind, self.name, self.parameters, self.origin)


def first_use(uses: Sequence[Use]) -> Use:
    """The use that gives a parameter its meaning: one in which it stands alone, or else the first one."""
    return next((use for use in uses if use.is_name), uses[0])


def sign_of(name: str, uses: Sequence[Use], value: float | None, least: float = -math.inf) -> tuple[bool, bool]:
    """Whether a parameter must be positive; else, whether it must not be negative.  ``least``: as the user declared.

    So it is where it is a factor, to an odd power, of something positive, or not negative.  To an even power, or in a
    gear ratio, it may be negative if its value is.
    """
    if least > 0 or any(_makes_positive(name, use, value) for use in uses):
        return True, False
    nonnegative = any(
        use.role is not None and use.role.nonnegative and exponent % 2 == 1 and coefficient > 0
        for use in uses
        for exponent, coefficient in _factor(name, use)
    )
    return False, least >= 0 or nonnegative


def _makes_positive(name: str, use: Use, value: float | None) -> bool:
    if use.role is None or not use.role.positive:
        return False
    return any(
        coefficient > 0 if exponent % 2 == 1 and not use.role.signed else value is None or value >= 0
        for exponent, coefficient in _factor(name, use)
    )


def _factor(name: str, use: Use) -> Iterator[tuple[int, Fraction]]:
    """Exponent of the parameter in a single product, and the coefficient of that."""
    if use.value.is_unit:
        ((monomial, coefficient),) = use.value
        yield dict(monomial)[name], coefficient


def impossible(uses: Iterable[Use], values: Mapping[str, float]) -> Iterator[tuple[Use, Role, float, str]]:
    """Expressions whose value is impossible in their role, with that value and the requirement.

    Expressions with an unknown value are left out.
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
    found = _InferredUnits()
    for name, unit in declared.items():
        if unit:
            found.add(name, parse(unit), "declared so")
    ordered = sorted(uses, key=lambda use: not use.is_name)
    while sum(found.learn(use) for use in ordered):
        pass  # repeat: a new unit may leave only one unknown unit in another product
    for use in ordered:
        found.check(use)
    names = dict.fromkeys([*declared, *(name for use in ordered for name in sorted(use.value.names))])
    return {name: str(found.dimension[name]) if name in found.dimension else "" for name in names}


class _InferredUnits:
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
