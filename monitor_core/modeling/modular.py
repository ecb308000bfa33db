"""Exact ranks for generic parameter values: the parameters are drawn at random modulo a large prime.

A determinant that is not identically zero is zero at a random point with probability degree / prime (Schwartz and
Zippel).  So the rank at a random point can only be too small, and hardly ever is; several points and two primes exclude
this in practice.  With 31 bits a product of two residues fits into numpy's int64.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Ints
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import StateSpace

PRIMES = (2**31 - 1, 2**31 - 19)
POINTS = (*PRIMES, PRIMES[0])

Seed = int | np.random.Generator


class ModularPoint(NamedTuple):
    """Values of parameters modulo a prime, none of them zero."""

    prime: int
    values: Mapping[str, int]


def points_of(ss: StateSpace, seed: Seed, primes: Sequence[int] = POINTS) -> Iterator[ModularPoint]:
    """A point for each of the primes: all names of a state space at random, then the values of its definitions."""
    rng = np.random.default_rng(seed)
    names = {p.name for p in (*ss.parameters, *ss.drawn)}
    for entries in (ss.A, ss.B, ss.C):
        names.update(*(entry.names for entry in entries.values()))
    names.update(*(d.value.names for d in ss.definitions))
    free = sorted(names - {d.name for d in ss.definitions})
    for prime in primes:
        values = dict(zip(free, rng.integers(1, prime, len(free)).tolist(), strict=True))
        for definition in ss.definitions:
            values[definition.name] = residue(definition.value, ModularPoint(prime, values))
        yield ModularPoint(prime, values)


def terms_at(entry: Laurent, point: ModularPoint) -> Iterator[tuple[int, dict[str, int]]]:
    """Value and exponents of each term."""
    for monomial, c in entry.terms.items():
        value = c.numerator * pow(c.denominator, -1, point.prime)
        for name, e in monomial:
            value = value * pow(point.values[name], e, point.prime) % point.prime
        yield value % point.prime, dict(monomial)


def residue(entry: Laurent, point: ModularPoint) -> int:
    """The value of a Laurent sum."""
    return sum(value for value, _ in terms_at(entry, point)) % point.prime


def residues(ss: StateSpace, point: ModularPoint) -> list[Ints]:
    """The values of A, B and C."""
    matrices = [np.zeros(shape, dtype=np.int64) for shape in ss.shapes]
    for matrix, entries in zip(matrices, (ss.A, ss.B, ss.C), strict=True):
        for place, entry in entries.items():
            matrix[place] = residue(entry, point)
    return matrices


def echelon(matrix: Ints, prime: int) -> tuple[Ints, tuple[int, ...]]:
    """Reduced row echelon form without zero rows, and the columns of its pivots."""
    M = matrix % prime
    pivots: list[int] = []
    for column in range(M.shape[1]):
        row = len(pivots)
        below = np.flatnonzero(M[row:, column])
        if not below.size:
            continue
        M[[row, row + below[0]]] = M[[row + below[0], row]]
        M[row] = M[row] * pow(int(M[row, column]), -1, prime) % prime
        factors = M[:, column].copy()
        factors[row] = 0
        hit = np.flatnonzero(factors)
        M[hit] = (M[hit] - factors[hit, None] * M[row] % prime) % prime
        pivots.append(column)
        if len(pivots) == len(M):
            break
    return M[: len(pivots)], tuple(pivots)


def rank(matrix: Ints, prime: int) -> int:
    """Rank modulo the prime."""
    return len(echelon(matrix, prime)[1])


def null_space(matrix: Ints, prime: int) -> Ints:
    """Rows (d, columns) in reduced echelon form that span all v with matrix v = 0."""
    reduced, pivots = echelon(matrix, prime)
    free = [column for column in range(matrix.shape[1]) if column not in pivots]
    out = np.zeros((len(free), matrix.shape[1]), dtype=np.int64)
    for k, column in enumerate(free):
        out[k, column] = 1
        out[k, list(pivots)] = -reduced[:, column] % prime
    return echelon(out, prime)[0]


def krylov_basis(A: Ints, start: Ints, prime: int) -> Ints:
    """Rows (rank, n) that span  [start, A start, A^2 start, ...]: the controllable space of the columns (n, m)."""
    newest = start.T % prime
    basis, before = echelon(newest, prime)[0], 0
    while len(basis) > before:  # until the space stops growing
        newest, before = product(newest, A.T, prime), len(basis)
        basis = echelon(np.vstack([basis, newest]), prime)[0]
    return basis


def inverse(values: Ints, prime: int) -> Ints:
    """The reciprocal of each element."""
    reciprocals = [pow(v, -1, prime) for v in values.ravel().tolist()]
    return np.array(reciprocals, dtype=np.int64).reshape(values.shape)


def product(left: Ints, right: Ints, prime: int) -> Ints:
    """Matrix product; each of the two is reduced modulo the prime."""
    out = np.zeros((left.shape[0], right.shape[1]), dtype=np.int64)
    for k in range(left.shape[1]):
        out += left[:, k, None] * right[k] % prime
    return np.asarray(out % prime)
