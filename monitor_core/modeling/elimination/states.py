"""The choice of states: relative angles, speeds, and an absolute angle only where a sensor needs it.

Springs depend on differences of angles only.  The deflections in the balances are expressed by as few independent ones
as span them, which replace the absolute angles, as nothing else depends on these (paper, section 2).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from monitor_core.modeling.elimination.balances import Balances, Sum
from monitor_core.modeling.elimination.operators import Coefficient, is_unit
from monitor_core.modeling.laurent import Laurent

K = TypeVar("K")

Angles = dict[str, Coefficient]
"""A combination of angles: name -> coefficient."""


@dataclass
class Basis:
    """Independent combinations of angles, in echelon form, that others are expressed in."""

    rows: list[Angles] = field(default_factory=list)
    _echelon: list[tuple[str, Angles, dict[int, Coefficient]]] = field(default_factory=list)

    def express(self, row: Angles) -> tuple[dict[int, Coefficient], Angles]:
        """Coordinates in the basis, and the part that is not in its span."""
        rest, coordinates = dict(row), dict[int, Coefficient]()
        for pivot, reduced, combination in self._echelon:
            if pivot in rest:
                factor = rest[pivot] / reduced[pivot]
                rest = add(rest, reduced, -factor)
                coordinates = add(coordinates, combination, factor)
        return coordinates, rest

    def extend(self, row: Angles, order: Mapping[str, int]) -> bool:
        """Add the part of the row that is independent of the basis; returns whether there is any."""
        coordinates, rest = self.express(row)
        if not rest:
            return False
        if not any(is_single(c) for c in rest.values()):
            # A loop through different gears: an absolute angle shows in a deflection, times (1 - ratio).  The angle
            # itself is the better state.
            nearest = rest[min(rest, key=lambda name: order[name])]
            row = rest = {name: c / nearest for name, c in rest.items()}
            coordinates = {}
        unit = next(iter(rest.values())) / next(iter(rest.values()))
        combination = add({len(self.rows): unit}, coordinates, -unit)
        pivot = min(rest, key=lambda name: (not is_unit(rest[name]), -order[name]))
        self._echelon.append((pivot, rest, combination))
        self.rows.append(row)
        return True


def add(
    left: Mapping[K, Coefficient], right: Mapping[K, Coefficient], factor: Coefficient
) -> dict[K, Coefficient]:
    """Left + factor * right of sparse sums."""
    out = dict(left)
    for key, c in right.items():
        total = out[key] + factor * c if key in out else factor * c
        if total:
            out[key] = total
        else:
            out.pop(key, None)
    return out


def angles_of(total: Sum, names: Iterable[str]) -> Angles:
    """The part of a sum that depends on angles themselves."""
    return {name: total[name, 0] for name in names if (name, 0) in total}


def deflections(balances: Balances, candidates: Sequence[Angles], order: Mapping[str, int]) -> Basis:
    """Independent deflections that span what the balances depend on; drawn ones first, those turned to the motor.

    ``order``: the distance of each angle from the motor.
    """
    basis = Basis()
    for candidate in candidates:
        basis.extend(towards_motor(candidate, order), order)
    for total in [*balances.masses.values(), *balances.massless.values()]:
        needed = angles_of(total, order)
        _, rest = basis.express(needed)
        if rest:
            nearest = rest[min(rest, key=lambda name: order[name])]
            basis.extend({name: c / nearest for name, c in rest.items()}, order)
    return basis


def towards_motor(row: Angles, order: Mapping[str, int]) -> Angles:
    """The row, or its negative, so that the angle nearest to the motor counts positive.

    Where the coefficients are sums (of stiffnesses: a massless node was eliminated), the row is divided by that of the
    nearest angle.
    """
    nearest = row[min(row, key=lambda name: order[name])]
    if not all(is_single(c) for c in row.values()):
        return {name: c / nearest for name, c in row.items()}
    return {name: -c for name, c in row.items()} if leading_sign(nearest) < 0 else row


def is_single(c: Coefficient) -> bool:
    """One term in the numerator, one in the denominator."""
    return c.is_unit if isinstance(c, Laurent) else len(c.numer.terms()) == len(c.denom.terms()) == 1


def leading_sign(c: Coefficient) -> int:
    """The sign of the first term."""
    terms = c.terms if isinstance(c, Laurent) else dict(c.numer)
    return -1 if next(iter(terms.values())) < 0 else 1
