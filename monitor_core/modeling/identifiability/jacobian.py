"""The derivatives of all Markov parameters C A^k B with respect to the logarithms of the parameters, modulo a prime.

The first 2n Markov parameters determine the transfer function of n states.  So a change of parameters is visible
exactly if it changes these.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monitor_core.arrays import Ints
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modular import (
    PRIMES,
    ModularPoint,
    Seed,
    echelon,
    inverse,
    null_space,
    points_of,
    residue,
    terms_at,
)
from monitor_core.modeling.statespace import Entries, StateSpace, SymbolicDefinition

Gradients = Mapping[str, Ints]
"""By name: derivatives (p,) of its logarithm with respect to the logarithms of the coordinates."""


@dataclass(frozen=True)
class GradientSample:
    """Gradients at one point: ``values`` (p,) of the coordinates; ``seen`` (rank, p) spans the gradients.

    The gradients are those of the transfer function with respect to the logarithms of the coordinates.
    """

    point: ModularPoint
    values: Ints
    seen: Ints

    @property
    def prime(self) -> int:
        """Modulus of all arithmetic."""
        return self.point.prime

    @cached_property
    def hidden(self) -> Ints:
        """Directions (p - rank, p) in which the logarithms of the coordinates move and no sensor shows it."""
        return null_space(self.seen, self.prime)

    @cached_property
    def plain(self) -> Ints:
        """``seen`` with respect to the coordinates themselves."""
        return np.asarray(self.seen * inverse(self.values, self.prime) % self.prime)


def samples_of(
    ss: StateSpace, coordinates: Sequence[str], seed: Seed, inputs: Sequence[int]
) -> list[list[GradientSample]]:
    """For each prime, as many random points as it takes until no further one adds anything.

    ``coordinates`` are names of parameters, drawn or merged, that vary; all others are known, or follow from them.
    """
    rng, enough = np.random.default_rng(seed), len(coordinates) + 2
    taken = [_until_settled(points_of(ss, rng, [prime] * enough), ss, coordinates, inputs) for prime in PRIMES]
    most = max(len(sample.seen) for some in taken for sample in some)
    return [[sample for sample in some if len(sample.seen) == most] for some in taken]


def _until_settled(
    points: Iterator[ModularPoint], ss: StateSpace, coordinates: Sequence[str], inputs: Sequence[int]
) -> list[GradientSample]:
    found: list[GradientSample] = []
    spans, before = (-1, -1), (-2, -2)
    while spans != before and (point := next(points, None)):
        rows = markov_gradients(ss, gradients(coordinates, ss.definitions, point), point, inputs)
        values = np.array([point.values[name] for name in coordinates], dtype=np.int64)
        found.append(GradientSample(point, values, echelon(rows, point.prime)[0]))
        before = spans
        spans = (len(union([s.hidden for s in found], found)), len(union([s.plain for s in found], found)))
    return found


def union(spaces: Sequence[Ints], samples: Sequence[GradientSample]) -> Ints:
    """Sum of all the spaces, in echelon form."""
    return echelon(np.vstack(spaces), samples[0].prime)[0]


def gradients(
    coordinates: Sequence[str], definitions: Sequence[SymbolicDefinition], point: ModularPoint
) -> dict[str, Ints]:
    """The gradients of the logarithms of the coordinates, and of the parameters defined by them."""
    unit = np.eye(len(coordinates), dtype=np.int64)
    out = dict(zip(coordinates, unit, strict=True))
    for definition in definitions:
        if definition.name not in out:
            slope = gradient(definition.value, out, len(coordinates), point)
            out[definition.name] = slope * pow(point.values[definition.name], -1, point.prime) % point.prime
    return out


def gradient(entry: Laurent, known: Gradients, p: int, point: ModularPoint) -> Ints:
    """The gradient (p,) of a Laurent sum with respect to the logarithms of the coordinates."""
    out = np.zeros(p, dtype=np.int64)
    for value, exponents in terms_at(entry, point):
        for name, e in exponents.items():
            if name in known:
                out = (out + value * e % point.prime * known[name]) % point.prime
    return out


class _Varying:
    """A sparse matrix and its gradient, and what both make of a matrix that varies, too."""

    def __init__(self, entries: Entries, rows: int, known: Gradients, p: int, point: ModularPoint) -> None:
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
        """The sum of the products of each row; they are sorted by row."""
        out = np.zeros((self.rows, *products.shape[1:]), dtype=np.int64)
        if len(products):
            out[self.filled] = np.add.reduceat(products, self.first, axis=0)
        return out


def markov_gradients(ss: StateSpace, known: Gradients, point: ModularPoint, inputs: Sequence[int]) -> Ints:
    """The gradients (rows, p) of C A^k B, k = 0 .. 2n - 1, all sensors and the given inputs."""
    n, p = len(ss.states), len(next(iter(known.values())))
    A = _Varying(ss.A, n, known, p, point)
    C = _Varying(ss.C, len(ss.sensors), known, p, point)
    columns = np.eye(len(ss.inputs), dtype=np.int64)[:, list(inputs)]
    B = _Varying(ss.B, n, known, p, point)
    X, dX = B.times(columns, np.zeros((*columns.shape, p), dtype=np.int64))
    rows = []
    for _ in range(2 * n):
        rows.append(C.times(X, dX)[1].reshape(-1, p))
        X, dX = A.times(X, dX)
    return np.vstack(rows)
