"""Combinations of parameters that can be identified, as text: "kT/Jm", "J1 + J2", "r^2*Jg/(Jm + J1)".

Parameters that are identifiable only as a sum (in the direction "one more, the other less" nothing changes, whatever
the values) become one coordinate.  In the logarithms of the coordinates, vectors orthogonal to all hidden directions
are products of powers.  If combinations are still missing, they are identifiable entries of A, B and C.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Ints
from monitor_core.modeling.identifiability.jacobian import GradientSample, gradient, gradients, samples_of, union
from monitor_core.modeling.identifiability.lattice import Vector, agreed, components, short_basis
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modular import inverse, null_space, product, rank
from monitor_core.modeling.statespace import StateSpace

_BELOW = ("kg m^2", "N m/rad", "N m s/rad", "N m")
"""Units in the order in which parameters go below the fraction stroke; numbers last."""


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
    samples: Sequence[Sequence[GradientSample]],
    rng: np.random.Generator,
    inputs: Sequence[int],
) -> list[tuple[str, frozenset[str]]]:
    """Independent identifiable combinations, each with the free parameters in it.

    Merged parameters count as one where that loses nothing; else ``samples``, in the free parameters, do.
    """
    seen = len(samples[0][0].seen)
    if not seen:
        return []
    coordinates = _coordinates(ss, free)
    if tuple(c.name for c in coordinates) != tuple(free):
        merged = samples_of(ss, [c.name for c in coordinates], rng, inputs)
        if len(merged[0][0].seen) == seen:
            return _named(ss, coordinates, merged)
    units = {p.name: p.unit for p in ss.drawn}
    return _named(ss, [Coordinate(name, units[name], name, frozenset({name})) for name in free], samples)


def _named(
    ss: StateSpace, coordinates: Sequence[Coordinate], samples: Sequence[Sequence[GradientSample]]
) -> list[tuple[str, frozenset[str]]]:
    order = sorted(range(len(coordinates)), key=lambda j: (by_unit(coordinates[j].unit, _BELOW), j))
    unit = tuple(map(tuple, np.eye(len(coordinates), dtype=np.int64).tolist()))
    frame = CoordinateGradients(tuple(c.text for c in coordinates), unit, tuple(order), samples)
    first = [some[0] for some in samples]
    found = list(products(with_sums(frame), first[0]))
    texts = {c.name: c.text for c in coordinates}
    if len(found) < len(first[0].seen):
        for candidate in entries_seen(ss, [c.name for c in coordinates], texts, first):
            if rank(np.array([f.slope() for f in (*found, candidate)]), first[0].prime) > len(found):
                found.append(candidate)
    return [(f.text, frozenset().union(*(coordinates[j].free for j in f.columns))) for f in found]


def _coordinates(ss: StateSpace, free: Sequence[str]) -> list[Coordinate]:
    """The names in A, B and C that are free, or merged with a free part."""
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
    """The value in terms of drawn parameters; a sum by which another is divided stays as it is written."""
    try:
        return value.substitute(sums)
    except NotLaurentError:
        return value.substitute({name: Laurent.symbol(str(total)) for name, total in sums.items()})


# --- Identifiable sums, products of powers, and entries ---------------------------------------------------------------


@dataclass(frozen=True)
class CoordinateGradients:
    """Coordinates by their texts, and their gradients at random points, for each prime.

    ``forms``: each coordinate as a sum of the first ones.  ``order``: which of them stand below the fraction stroke,
    the first first.
    """

    texts: tuple[str, ...]
    forms: tuple[Vector, ...]
    order: tuple[int, ...]
    samples: Sequence[Sequence[GradientSample]]

    @property
    def primes(self) -> list[int]:
        """The prime of each list of samples."""
        return [some[0].prime for some in self.samples]


@dataclass(frozen=True)
class Combination:
    """An identifiable combination: its text, the first coordinates in it, and the gradient (p,) of its logarithm.

    The gradient is that at the first sample, with respect to the logarithms of the first coordinates.
    """

    text: str
    columns: frozenset[int]
    slope: Callable[[], Ints]


def with_sums(frame: CoordinateGradients) -> CoordinateGradients:
    """The frame with sums in place of coordinates that are identifiable only as a sum; hidden coordinates removed."""
    bases = [union([s.plain for s in some], some) for some in frame.samples]
    forms = agreed(bases, frame.primes)
    if not forms:
        return frame
    first = [min(frame.order.index(j) for j, c in enumerate(form) if c) for form in forms]
    samples = [[_in_forms(s, forms) for s in some] for some in frame.samples]
    texts = tuple(_sum(form, frame.texts) for form in forms)
    return CoordinateGradients(texts, forms, tuple(np.argsort(first).tolist()), samples)


def _in_forms(sample: GradientSample, forms: Sequence[Vector]) -> GradientSample:
    """The sample in terms of the linear forms; the first column of each form occurs in no other form."""
    prime = sample.prime
    leading = [next(j for j, c in enumerate(form) if c) for form in forms]
    multiples = np.array([form[j] for form, j in zip(forms, leading, strict=True)], dtype=np.int64)
    values = product(np.array(forms, dtype=np.int64) % prime, sample.values[:, None], prime)[:, 0]
    plain = sample.plain[:, leading] * inverse(multiples % prime, prime) % prime
    return GradientSample(sample.point, values, plain * values % prime)


def products(frame: CoordinateGradients, first: GradientSample) -> Iterator[Combination]:
    """Products of powers of the coordinates that are seen; also those that are seen by themselves.

    ``first``: the first sample, in the first coordinates.
    """
    bases = [null_space(union([s.hidden for s in some], some), some[0].prime) for some in frame.samples]
    space = agreed(bases, frame.primes)
    for group in components(bases[0]) if space else []:
        inside = [tuple(v[j] for j in group) for v in space if any(v[j] for j in group)]
        order = [group.index(column) for column in frame.order if column in group]
        for short in short_basis(inside, order, frame.primes[0]) if inside else []:
            vector = dict(zip(group, short, strict=True))
            yield _product(tuple(vector.get(j, 0) for j in range(len(frame.texts))), frame, first)


def _product(vector: Vector, frame: CoordinateGradients, first: GradientSample) -> Combination:
    powers = {frame.texts[j]: e for j, e in enumerate(vector) if e}
    alone = list(powers.values()) == [1]  # then no brackets are needed
    text = next(iter(powers)) if alone else str(Laurent([(tuple(sorted(powers.items())), Fraction(1))]))
    columns = {i for j, e in enumerate(vector) if e for i, c in enumerate(frame.forms[j]) if c}
    slope = partial(_slope, vector, frame.forms, first, frame.samples[0][0])
    return Combination(text, frozenset(columns), slope)


def _slope(vector: Vector, forms: Sequence[Vector], first: GradientSample, sample: GradientSample) -> Ints:
    """sum of e_j dlog(form_j), form_j = sum of c_ij theta_i, by the logarithms of theta."""
    prime = first.prime
    weights = np.array(vector, dtype=np.int64) % prime * inverse(sample.values, prime) % prime
    plain = product(weights[None], np.array(forms, dtype=np.int64) % prime, prime)[0]
    return np.asarray(plain * first.values % prime)


def entries_seen(
    ss: StateSpace, coordinates: Sequence[str], texts: Mapping[str, str], first: Sequence[GradientSample]
) -> Iterator[Combination]:
    """Identifiable entries of A, B and C, and sums in them; simple ones first."""
    candidates = {_positive(e) for M in (ss.A, ss.B, ss.C) for e in M.values()}
    candidates |= {entry.common_factor()[1] for entry in candidates}
    symbols = {name: Laurent.symbol(text) for name, text in texts.items()}
    named = {str(entry.substitute(symbols)): entry for entry in candidates}
    place = {name: j for j, name in enumerate(coordinates)}
    for text, entry in sorted(named.items(), key=lambda item: (len(item[0]), item[0])):
        slopes = tuple(_entry_slope(ss, entry, coordinates, s) for s in first)
        if all(rank(np.vstack([s.seen, g]), s.prime) == len(s.seen) for s, g in zip(first, slopes, strict=True)):
            columns = frozenset(place[name] for name in entry.names if name in place)
            yield Combination(text, columns, partial(_entry_slope, ss, entry, coordinates, first[0]))


def _entry_slope(ss: StateSpace, entry: Laurent, coordinates: Sequence[str], sample: GradientSample) -> Ints:
    known = gradients(coordinates, ss.definitions, sample.point)
    return gradient(entry, known, len(coordinates), sample.point)


def _positive(entry: Laurent) -> Laurent:
    return -entry if all(c < 0 for c in entry.terms.values()) else entry


def _sum(form: Vector, texts: Sequence[str]) -> str:
    """``J1``, ``J1 + 2*J2``."""
    terms = [(text, c) for text, c in zip(texts, form, strict=True) if c]
    return terms[0][0] if len(terms) == 1 else str(Laurent((((text, 1),), Fraction(c)) for text, c in terms))
