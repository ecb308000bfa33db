"""Rational functions where Laurent sums do not suffice, and the way back: merged parameters.

Two rigidly joined inertias act only as J1 + r^2 J2, two springs in series as k1 k2/(k1 + k2): then entries of A and B
have sums in their denominators.  Such a sum becomes a parameter of its own, q, and the entries are Laurent sums again.
q depends on its parts.  Where these occur elsewhere, too, either they and q occur only as one product, which becomes
the parameter, or one of them is replaced by its solution from q.  Both are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from monitor_core.modeling.laurent import Laurent, NotLaurentError


class Field:
    """The field of rational functions in the given names, over the rational numbers (sympy's)."""

    def __init__(self, names: Iterable[str]) -> None:
        from sympy import QQ, symbols

        self.names = sorted(names)
        self._field = (
            QQ.frac_field(*symbols([f"p{k}" for k in range(len(self.names))])) if self.names else None
        )
        gens = self._field.gens if self._field else ()
        self._generators = dict(zip(self.names, gens, strict=True))

    def element(self, c: Laurent) -> Any:
        """A Laurent sum as an element of the field."""
        assert self._field is not None
        total = self._field.zero
        for monomial, number in c:
            term = self._field(number)
            for name, e in monomial:
                term = term * self._generators[name] ** e
            total = total + term
        return total

    def factors(self, c: Any) -> tuple[Laurent, list[tuple[Laurent, int]]]:
        """A sum in the numerator, divided by single terms, and the sums in the denominator with their powers."""
        number, powers = c.denom.factor_list()
        single, sums = Laurent.number(_fraction(number)), list[tuple[Laurent, int]]()
        for factor, power in powers:
            poly = self._polynomial(factor)
            if poly.is_unit:
                single = single * poly**power
            else:
                sums.append((poly, power))
        return self._polynomial(c.numer) / single, sums

    def _polynomial(self, poly: Any) -> Laurent:
        return Laurent(
            (tuple((n, e) for n, e in zip(self.names, exponents, strict=True) if e), _fraction(c))
            for exponents, c in poly.terms()
        )


def _fraction(c: Any) -> Fraction:
    return Fraction(int(c.numerator), int(c.denominator))


@dataclass
class Merging:
    """Entries as Laurent sums in the user's and in merged parameters, the latter with their definitions in order."""

    entries: list[Laurent]
    definitions: dict[str, Laurent]


def merge(field: Field, entries: Sequence[Any]) -> Merging:
    """Elements of the field as Laurent sums, with sums in denominators as parameters of their own.

    Raises:
        NotLaurentError: a sum that cannot be made a parameter.
    """
    sums: dict[Laurent, str] = {}
    out: list[Laurent] = []
    for entry in entries:
        total, below = field.factors(entry)
        for poly, power in below:
            name = sums.setdefault(poly, poly.sum_text())
            total = total * Laurent.symbol(name, -power)
        out.append(total)
    merging = Merging(out, {name: poly for poly, name in sums.items()})
    for name in list(merging.definitions):
        _settle(merging, name)
    return merging


def _settle(merging: Merging, name: str) -> None:
    """Make the merged parameter independent of the others that occur."""
    parts = merging.definitions[name].names
    present = {n for entry in merging.entries for n in entry.names}
    if not parts <= present:
        return  # a part that occurs nowhere else makes it independent of the others
    if _as_product(merging, name, parts) or any(_replace(merging, name, part) for part in sorted(parts)):
        return
    raise NotLaurentError(name)


def _as_product(merging: Merging, name: str, parts: Iterable[str]) -> bool:
    """Replace name and its parts by their product, if they occur in that product only."""
    group = [name, *sorted(parts)]
    exponents = {
        tuple(dict(monomial).get(n, 0) for n in group) for entry in merging.entries for monomial, _ in entry
    } - {(0,) * len(group)}
    shortest = min(exponents, key=lambda e: sum(map(abs, e)))
    if not all(_multiple(e, shortest) for e in exponents):
        return False
    if shortest[0] > 0:
        shortest = tuple(-e for e in shortest)
    product = Laurent(
        [(tuple(sorted((n, e) for n, e in zip(group, shortest, strict=True) if e)), Fraction(1))]
    )
    merged = str(product)
    merging.entries = [_in_terms_of(entry, group, shortest, merged) for entry in merging.entries]
    merging.definitions[merged] = product
    return True


def _multiple(e: tuple[int, ...], base: tuple[int, ...]) -> bool:
    k = next(i for i, value in enumerate(base) if value)
    factor, rest = divmod(e[k], base[k])
    return rest == 0 and e == tuple(factor * value for value in base)


def _in_terms_of(entry: Laurent, group: Sequence[str], exponents: Sequence[int], merged: str) -> Laurent:
    k = next(i for i, value in enumerate(exponents) if value)
    terms = []
    for monomial, c in entry:
        powers = dict(monomial)
        times = powers.get(group[k], 0) // exponents[k]
        others = {n: e for n, e in powers.items() if n not in group}
        if times:
            others[merged] = times
        terms.append((tuple(sorted(others.items())), c))
    return Laurent(terms)


def _replace(merging: Merging, name: str, part: str) -> bool:
    """Solve the definition of ``name`` for one of its parameters and put the solution into the entries."""
    poly = merging.definitions[name]
    slope = poly.derivative(part)
    if part in slope.names or not slope.is_unit:
        return False
    rest = poly - slope * Laurent.symbol(part)
    solution = {part: (Laurent.symbol(name) - rest) / slope}
    try:
        merging.entries = [entry.substitute(solution) for entry in merging.entries]
    except NotLaurentError:
        return False
    return True


def needed(definitions: Mapping[str, Laurent], entries: Iterable[Laurent]) -> dict[str, Laurent]:
    """The definitions that the entries need, directly or indirectly, in order."""
    wanted = {n for entry in entries for n in entry.names}
    for name in reversed(list(definitions)):
        if name in wanted:
            wanted |= definitions[name].names
    return {name: value for name, value in definitions.items() if name in wanted}
