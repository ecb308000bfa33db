"""Combinations of parameters that can be seen, as text: "kT/Jm", "J1 + J2", "r^2*Jg/(Jm + J1)"; as many as are found.

Parameters that are seen as a sum only (directions that stay hidden whatever the values: one more, the other less)
become one coordinate.  In the logarithms of what is left, vectors orthogonal to all that is hidden are products of
powers.  What is seen in no such form is only counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from monitor_core.modeling.identifiability.jacobian import Sample, samples_of, union
from monitor_core.modeling.identifiability.lattice import Vector, agreed, components, short_basis
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modular import inverse, null_space, product
from monitor_core.modeling.statespace import StateSpace

_BELOW = ("kg m^2", "N m/rad", "N m s/rad", "N m")
"""By unit: what stands below the fraction stroke first; numbers last."""


class Coordinate(NamedTuple):
    """A parameter that occurs in A, B or C, drawn or merged: its text, and the free parameters in it."""

    name: str
    unit: str
    text: str
    free: frozenset[str]


def by_unit(unit: str, order: Sequence[str]) -> int:
    """The place of the unit in the order; last, if it is not there."""
    return order.index(unit) if unit in order else len(order)


def combinations_of(
    ss: StateSpace,
    free: Sequence[str],
    samples: Sequence[Sequence[Sample]],
    rng: np.random.Generator,
    inputs: Sequence[int],
) -> list[tuple[str, frozenset[str]]]:
    """Combinations that are seen, independent of each other, each with the free parameters in it.

    Merged parameters count as one where that loses nothing; else ``samples``, in the free parameters, do.
    """
    seen = len(samples[0][0].seen)
    if not seen:
        return []
    coordinates = _coordinates(ss, free)
    if tuple(c.name for c in coordinates) != tuple(free):
        merged = samples_of(ss, [c.name for c in coordinates], rng, inputs)
        if len(merged[0][0].seen) == seen:
            return _named(coordinates, merged)
    return _named(_drawn(ss, free), samples)


def _named(
    coordinates: Sequence[Coordinate], samples: Sequence[Sequence[Sample]]
) -> list[tuple[str, frozenset[str]]]:
    order = sorted(range(len(coordinates)), key=lambda j: (by_unit(coordinates[j].unit, _BELOW), j))
    unit = tuple(map(tuple, np.eye(len(coordinates), dtype=np.int64).tolist()))
    frame = Frame(tuple(c.text for c in coordinates), unit, tuple(order), samples)
    return [
        (text, frozenset().union(*(coordinates[j].free for j in columns)))
        for text, columns in products(with_sums(frame))
    ]


def _drawn(ss: StateSpace, free: Sequence[str]) -> list[Coordinate]:
    units = {p.name: p.unit for p in ss.drawn}
    return [Coordinate(name, units[name], name, frozenset({name})) for name in free]


def _coordinates(ss: StateSpace, free: Sequence[str]) -> list[Coordinate]:
    """The names in A, B and C that are free, or merged of what is partly free."""
    inside = {name: frozenset({name}) for name in free}
    sums: dict[str, Laurent] = {}
    for definition in ss.definitions:
        inside[definition.name] = frozenset().union(*(inside.get(n, ()) for n in definition.value.names))
        sums[definition.name] = _expanded(definition.value, sums)
    used = set[str]().union(*(e.names for M in (ss.A, ss.B, ss.C) for e in M.values()))
    return [
        Coordinate(p.name, p.unit, str(sums.get(p.name, p.name)), inside[p.name])
        for p in ss.parameters
        if p.name in used and inside.get(p.name)
    ]


def _expanded(value: Laurent, sums: Mapping[str, Laurent]) -> Laurent:
    """In terms of what was drawn; where one sum is divided by another, that one stays as it is written."""
    try:
        return value.substitute(sums)
    except NotLaurentError:
        return value.substitute({name: Laurent.symbol(str(total)) for name, total in sums.items()})


# --- Sums and products of powers that are seen ------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """Coordinates by their texts, and what is seen of them at random points, for each prime.

    ``forms``: each coordinate as a sum of the first ones.  ``order``: which of them stand below the fraction stroke,
    the first first.
    """

    texts: tuple[str, ...]
    forms: tuple[Vector, ...]
    order: tuple[int, ...]
    samples: Sequence[Sequence[Sample]]

    @property
    def primes(self) -> list[int]:
        """The prime of each list of samples."""
        return [some[0].prime for some in self.samples]


def with_sums(frame: Frame) -> Frame:
    """Sums instead of the coordinates that are seen as a sum only; without what is not seen at all."""
    bases = [union([s.plain for s in some], some) for some in frame.samples]
    forms = agreed(bases, frame.primes)
    if not forms:
        return frame
    first = [min(frame.order.index(j) for j, c in enumerate(form) if c) for form in forms]
    samples = [[_in_forms(s, forms) for s in some] for some in frame.samples]
    texts = tuple(_sum(form, frame.texts) for form in forms)
    return Frame(texts, forms, tuple(np.argsort(first).tolist()), samples)


def _in_forms(sample: Sample, forms: Sequence[Vector]) -> Sample:
    """What is seen, in terms of the linear forms; each has a column that the others do not have: its first."""
    prime = sample.prime
    leading = [next(j for j, c in enumerate(form) if c) for form in forms]
    multiples = np.array([form[j] for form, j in zip(forms, leading, strict=True)], dtype=np.int64)
    values = product(np.array(forms, dtype=np.int64) % prime, sample.values[:, None], prime)[:, 0]
    plain = sample.plain[:, leading] * inverse(multiples % prime, prime) % prime
    return Sample(sample.point, values, plain * values % prime)


def products(frame: Frame) -> Iterator[tuple[str, set[int]]]:
    """Products of powers of the coordinates that are seen; also those that are seen by themselves.

    Each as its text and the first coordinates in it.
    """
    bases = [null_space(union([s.hidden for s in some], some), some[0].prime) for some in frame.samples]
    space = agreed(bases, frame.primes)
    for group in components(bases[0]) if space else []:
        inside = [tuple(v[j] for j in group) for v in space if any(v[j] for j in group)]
        order = [group.index(column) for column in frame.order if column in group]
        for short in short_basis(inside, order, frame.primes[0]) if inside else []:
            powers = {j: e for j, e in zip(group, short, strict=True) if e}
            columns = {i for j in powers for i, c in enumerate(frame.forms[j]) if c}
            yield _product_text({frame.texts[j]: e for j, e in powers.items()}), columns


def _sum(form: Vector, texts: Sequence[str]) -> str:
    """``J1``, ``J1 + 2*J2``."""
    terms = [(text, c) for text, c in zip(texts, form, strict=True) if c]
    return terms[0][0] if len(terms) == 1 else str(Laurent((((text, 1),), Fraction(c)) for text, c in terms))


def _product_text(powers: Mapping[str, int]) -> str:
    """``kT/(J1 + J2)``; one alone needs no brackets."""
    if list(powers.values()) == [1]:
        return next(iter(powers))
    return str(Laurent([(tuple(sorted(powers.items())), Fraction(1))]))
