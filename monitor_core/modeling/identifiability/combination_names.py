"""Enough combinations of parameters, as text, to say all that the sensors can see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.modeling.identifiability.jacobian import Sample, samples_of
from monitor_core.modeling.identifiability.products import (
    Combination,
    entries_seen,
    frame_of,
    products,
    with_sums,
)
from monitor_core.modeling.laurent import Laurent, NotLaurentError
from monitor_core.modeling.modular import rank
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
            return _named(ss, coordinates, merged)
    return _named(ss, _drawn(ss, free), samples)


def _named(
    ss: StateSpace, coordinates: Sequence[Coordinate], samples: Sequence[Sequence[Sample]]
) -> list[tuple[str, frozenset[str]]]:
    order = sorted(range(len(coordinates)), key=lambda j: (by_unit(coordinates[j].unit, _BELOW), j))
    frame = frame_of([c.text for c in coordinates], order, samples)
    first = [some[0] for some in samples]
    found = list(products(with_sums(frame), first[0]))
    texts = {c.name: c.text for c in coordinates}
    if len(found) < len(first[0].seen):
        for candidate in entries_seen(ss, [c.name for c in coordinates], texts, first):
            if _adds(candidate, found, first[0].prime):
                found.append(candidate)
    return [(f.text, frozenset().union(*(coordinates[j].free for j in f.columns))) for f in found]


def _adds(candidate: Combination, found: Sequence[Combination], prime: int) -> bool:
    return rank(np.array([f.slope() for f in (*found, candidate)]), prime) > len(found)


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
