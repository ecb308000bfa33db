"""Finds small integer vectors in spaces that are known modulo a prime.

A space that is the same for all values of the parameters has a basis in small fractions: its reduced echelon form,
which is unique, so that the residues of its entries are those of small fractions.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, islice

import numpy as np

from monitor_core.arrays import Ints
from monitor_core.modeling.modular import null_space, rank

MOST_SUBSETS = 3000
"""Largest number of subsets that are searched for short vectors; beyond it the echelon form is used."""

Vector = tuple[int, ...]


@lru_cache(maxsize=4096)
def fraction(residue: int, prime: int) -> Fraction | None:
    """The fraction with numerator and denominator below sqrt(prime / 2) that has this residue, if there is one."""
    bound = math.isqrt(prime // 2)
    (r0, t0), (r1, t1) = (prime, 0), (residue % prime, 1)
    while r1 > bound:
        q = r0 // r1
        (r0, t0), (r1, t1) = (r1, t1), (r0 - q * r1, t0 - q * t1)
    return Fraction(r1, t1) if 0 < abs(t1) <= bound else None


def integers(row: Ints, prime: int) -> Vector | None:
    """The row times the smallest number that makes its small fractions integers without common factor."""
    places = np.flatnonzero(row).tolist()
    found = [f for f in (fraction(int(row[j]), prime) for j in places) if f is not None]
    if len(found) < len(places):
        return None
    scale = math.lcm(*(f.denominator for f in found))
    scaled = [int(f * scale) for f in found]
    common = math.gcd(*scaled)
    out = [0] * len(row)
    for j, v in zip(places, scaled, strict=True):
        out[j] = v // common
    return tuple(out)


def agreed(bases: Sequence[Ints], primes: Sequence[int]) -> tuple[Vector, ...]:
    """The rows of echelon forms as integers, where they are the same for all primes; else none."""
    read = [tuple(integers(row, prime) for row in basis) for basis, prime in zip(bases, primes, strict=True)]
    if any(rows != read[0] for rows in read) or None in read[0]:
        return ()
    return tuple(row for row in read[0] if row is not None)


def components(basis: Ints) -> list[tuple[int, ...]]:
    """The finest partition of the columns such that the space is a direct sum; ``basis`` in reduced echelon form."""
    groups = [{column} for column in range(basis.shape[1])]
    for row in basis:
        support = set(np.flatnonzero(row).tolist())
        touched = [g for g in groups if g & support]
        groups = [g for g in groups if not g & support] + [set[int]().union(*touched)] * bool(touched)
    return sorted(tuple(sorted(g)) for g in groups)


def short_basis(space: Sequence[Vector], order: Sequence[int], prime: int) -> list[Vector]:
    """Vectors with few entries that span the same space over the rationals.

    First single columns that are in it, then pairs: each column with the one of its class that comes first in
    ``order``; then threes and more of these first ones.  Of each vector that has entries of both signs the one that
    comes first in ``order`` is negative.
    """
    complement = null_space(np.array(space, dtype=np.int64), prime)
    bound = np.count_nonzero(complement, axis=0).tolist()
    classes = _parallel(complement, [column for column in order if bound[column]], prime)
    short: list[tuple[int, ...]] = [(column,) for column in order if not bound[column]]
    short += [(other, first) for first, *others in classes for other in others]
    found = [vector for columns in short if (vector := _relation(complement, columns, prime))]
    found += _circuits(complement, [first for first, *_ in classes], len(space) - len(found), prime)
    return [_signed(vector, order) for vector in found]


def _parallel(complement: Ints, order: Sequence[int], prime: int) -> list[list[int]]:
    """Columns of the complement that are multiples of each other, in order."""
    classes: list[list[int]] = []
    for column in order:
        for members in classes:
            if rank(complement[:, [members[0], column]], prime) < 2:
                members.append(column)
                break
        else:
            classes.append([column])
    return classes


def _relation(complement: Ints, columns: Sequence[int], prime: int) -> Vector | None:
    """The one vector of the space that is zero outside the columns and nowhere in them, if there is just one."""
    relations = null_space(complement[:, list(columns)], prime)
    return _spread(relations[0], columns, complement, prime) if len(relations) == 1 and relations.all() else None


def _spread(relation: Ints, columns: Sequence[int], complement: Ints, prime: int) -> Vector | None:
    out = np.zeros(complement.shape[1], dtype=np.int64)
    out[list(columns)] = relation
    return integers(out, prime)


def _circuits(complement: Ints, columns: Sequence[int], wanted: int, prime: int) -> list[Vector]:
    """Independent vectors of the space within the columns, none of which are parallel; the shortest first."""
    found: list[Vector] = []
    sizes = range(3, len(complement) + 2)
    subsets = (chosen for size in sizes for chosen in combinations(columns, size))
    for chosen in islice(subsets, MOST_SUBSETS):
        if len(found) == wanted:
            return found
        vector = _relation(complement, chosen, prime)
        if vector and rank(np.array([*found, vector], dtype=np.int64), prime) > len(found):
            found.append(vector)
    if len(found) == wanted:
        return found
    rows = null_space(complement[:, list(columns)], prime)
    return [vector for row in rows if (vector := _spread(row, columns, complement, prime))]


def _signed(vector: Vector, order: Sequence[int]) -> Vector:
    entries = [vector[column] for column in order if vector[column]]
    upside_down = max(entries) < 0 or (entries[0] > 0 > min(entries))
    return tuple(-v for v in vector) if upside_down else vector
