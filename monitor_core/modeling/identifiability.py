"""Structural identifiability: which parameters the sensors of a drive can determine at all, from any record.

By the rank of the derivatives of the Markov parameters C A^k B at random points.  The first 2n of them fix the transfer
function of n states, so parameters can be seen exactly as far as these change.  The arithmetic is modulo a prime, so
the rank needs no tolerance.  Derivatives are of logarithms with respect to logarithms: what a product of powers hides
is then the same at all points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from monitor_core.arrays import Ints
from monitor_core.modeling.flat import FlatParameter, ModelError
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modular import (
    Point,
    Seed,
    echelon,
    null_space,
    points_of,
    rank,
    residue,
    terms_at,
)
from monitor_core.modeling.statespace import Definition, Entries, StateSpace
from monitor_core.wording import listed

_HELD = ("1", "kg m^2", "N m/rad", "N m s/rad", "N m")
"""By unit: what is known best from a data sheet first."""


@dataclass(frozen=True, slots=True)
class Identifiability:
    """What any record, however exciting, can tell at most of the parameters that are not known already.

    ``identifiable``: seen by themselves (up to a finite number of values). ``groups``: parameters that cannot be
    distinguished, of which only ``combinations`` (so many numbers each) can be seen. ``invisible``: no sensor shows
    them at all. ``suggestion``: a smallest set to hold known so that all others can be found; none of the
    ``invisible`` can, so they belong to it.
    """

    identifiable: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]
    combinations: tuple[int, ...]
    invisible: tuple[str, ...]
    suggestion: tuple[str, ...]

    @property
    def count(self) -> int:
        """How many numbers can be found."""
        return len(self.identifiable) + sum(self.combinations)

    def words(self) -> tuple[str, ...]:
        """The same in plain sentences."""
        return tuple(_sentences(self))


def structural(
    ss: StateSpace, free: Sequence[str] | None = None, seed: Seed = 0, inputs: Sequence[int] | None = None
) -> Identifiability:
    """What the sensors can see of the ``free`` parameters (default: all that were drawn), the others being known.

    ``inputs``: columns of B, each a known signal of its own (torque, direction of motion, 1, gravity); default all.

    Raises:
        ModelError: the drive has no parameter of that name.
    """
    drawn = {p.name: p for p in ss.drawn}
    for name in free or ():
        if name not in drawn:
            raise ModelError(f"no parameter {name}: the drive has {', '.join(drawn)}")
    names = tuple(drawn if free is None else dict.fromkeys(free))
    if not names:
        return Identifiability((), (), (), (), ())
    columns = range(len(ss.inputs)) if inputs is None else inputs
    points = list(points_of(ss, seed))
    spaces = [_seen(ss, names, point, columns) for point in points]
    best = max(
        range(len(points)), key=lambda k: len(spaces[k])
    )  # a rank at a random point is never too large
    return _sorted_out([drawn[name] for name in names], spaces[best], points[best].prime)


def _sorted_out(free: Sequence[FlatParameter], seen: Ints, prime: int) -> Identifiability:
    """The parameters by what is ``seen`` of them (rank, p), and by the directions that stay hidden."""
    names, hidden = [p.name for p in free], null_space(seen, prime)
    groups = [g for g in _components(hidden) if len(g) > 1]
    invisible = tuple(name for name, column in zip(names, seen.T, strict=True) if not column.any())
    held = _held(free, hidden, groups, prime)
    return Identifiability(
        identifiable=tuple(name for name, column in zip(names, hidden.T, strict=True) if not column.any()),
        groups=tuple(tuple(names[j] for j in g) for g in groups),
        combinations=tuple(len(g) - rank(hidden[:, g], prime) for g in groups),
        invisible=invisible,
        suggestion=(*(names[j] for j in held), *invisible),
    )


def _components(basis: Ints) -> list[tuple[int, ...]]:
    """The finest partition of the columns such that the space is a direct sum; ``basis`` in reduced echelon form."""
    groups = [{column} for column in range(basis.shape[1])]
    for row in basis:
        support = set(np.flatnonzero(row).tolist())
        touched = [g for g in groups if g & support]
        groups = [g for g in groups if not g & support] + [set[int]().union(*touched)] * bool(touched)
    return sorted(tuple(sorted(g)) for g in groups)


def _held(
    free: Sequence[FlatParameter], hidden: Ints, groups: Sequence[tuple[int, ...]], prime: int
) -> list[int]:
    """Parameters that, held, leave no hidden direction in the groups; the best known ones first."""
    chosen: list[int] = []
    for j in sorted(chain.from_iterable(groups), key=lambda j: (_known_well(free[j]), j)):
        if rank(hidden[:, [*chosen, j]], prime) > len(chosen):
            chosen.append(j)
    return chosen


def _known_well(p: FlatParameter) -> int:
    return _HELD.index(p.unit) if p.unit in _HELD else len(_HELD)


# --- The derivatives of all Markov parameters -------------------------------------------------------------------------


Gradients = Mapping[str, Ints]
"""Of each name, the derivatives (p,) of its logarithm with respect to those of the coordinates."""


def _seen(ss: StateSpace, names: Sequence[str], point: Point, inputs: Sequence[int]) -> Ints:
    """What the sensors show at one point: rows (rank, p) that span the gradients of C A^k B, k = 0 .. 2n - 1."""
    known = gradients(names, ss.definitions, point)
    n, p = len(ss.states), len(names)
    A = _Varying(ss.A, n, known, p, point)
    C = _Varying(ss.C, len(ss.sensors), known, p, point)
    B = _Varying(ss.B, n, known, p, point)
    columns = np.eye(len(ss.inputs), dtype=np.int64)[:, list(inputs)]
    X, dX = B.times(columns, np.zeros((*columns.shape, p), dtype=np.int64))
    rows = []
    for _ in range(2 * n):
        rows.append(C.times(X, dX)[1].reshape(-1, p))
        X, dX = A.times(X, dX)
    return echelon(np.vstack(rows), point.prime)[0]


def gradients(coordinates: Sequence[str], definitions: Sequence[Definition], point: Point) -> dict[str, Ints]:
    """The gradients of the logarithms of the coordinates, and of what is defined by them."""
    unit = np.eye(len(coordinates), dtype=np.int64)
    out = dict(zip(coordinates, unit, strict=True))
    for definition in definitions:
        if definition.name not in out:
            slope = gradient(definition.value, out, len(coordinates), point)
            out[definition.name] = slope * pow(point.values[definition.name], -1, point.prime) % point.prime
    return out


def gradient(entry: Laurent, known: Gradients, p: int, point: Point) -> Ints:
    """The gradient (p,) of a Laurent sum with respect to the logarithms of the coordinates."""
    out = np.zeros(p, dtype=np.int64)
    for value, exponents in terms_at(entry, point):
        for name, e in exponents.items():
            if name in known:
                out = (out + value * e % point.prime * known[name]) % point.prime
    return out


class _Varying:
    """A sparse matrix and its gradient, and what both make of a matrix that varies, too."""

    def __init__(self, entries: Entries, rows: int, known: Gradients, p: int, point: Point) -> None:
        self.rows, self.prime = rows, point.prime
        places = sorted(entries)
        self.row, self.col = np.array(places, dtype=np.int64).reshape(-1, 2).T
        self.filled, self.first = np.unique(self.row, return_index=True)
        self.value = np.array([residue(entries[at], point) for at in places], dtype=np.int64).reshape(-1, 1)
        slopes = [gradient(entries[at], known, p, point) for at in places]
        self.slopes = np.array(slopes, dtype=np.int64).reshape(-1, p)
        self.entry, self.parameter = np.nonzero(self.slopes)

    def times(self, X: Ints, dX: Ints) -> tuple[Ints, Ints]:
        """The product with X (n, m), and its gradient, that of X being dX (n, m, p)."""
        dY = self._summed(self.value[..., None] * dX[self.col] % self.prime)
        entry, every = self.entry, np.arange(X.shape[1])
        moved = self.slopes[entry, self.parameter, None] * X[self.col[entry]] % self.prime
        np.add.at(dY, (self.row[entry, None], every, self.parameter[:, None]), moved)
        return self._summed(self.value * X[self.col] % self.prime) % self.prime, dY % self.prime

    def _summed(self, products: Ints) -> Ints:
        """Of each row the sum of its products; they are sorted by row."""
        out = np.zeros((self.rows, *products.shape[1:]), dtype=np.int64)
        if len(products):
            out[self.filled] = np.add.reduceat(products, self.first, axis=0)
        return out


# --- The same in plain sentences --------------------------------------------------------------------------------------


_FEW = 12
"""So many names are listed; more are counted."""


def _sentences(result: Identifiability) -> Iterator[str]:
    if result.identifiable:
        yield f"{listed(result.identifiable)} can be found."
    alone = not result.identifiable and len(result.groups) == 1
    for names, count in zip(result.groups, result.combinations, strict=True):
        yield _group(names, count, alone)
    for name in result.invisible:
        yield f"{name} cannot be seen at all: whatever its value, the sensors show the same."
    held = [name for name in result.suggestion if name not in result.invisible]
    if held:
        rest = [name for names in result.groups for name in names if name not in held]
        found = listed(rest) if len(rest) <= _FEW else f"the other {len(rest)}"
        yield f"Hold {listed(held)} known and {found} can be found."


def _group(names: Sequence[str], count: int, alone: bool) -> str:
    who = listed(names) if len(names) <= _FEW else f"{len(names)} parameters ({listed(names)})"
    if not count:
        return f"Nothing of {who} can be seen."
    seen = "one combination" if count == 1 else f"{count} combinations"
    if alone:
        return f"Only {seen} can be seen: {who} cannot be distinguished."
    return f"Of {who} only {seen} can be seen."
