"""Oracles by numerical rank at random points: of matrices of Laurent sums, and of what inputs reach and sensors see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modular import (
    Seed,
    krylov_basis,
    points_of,
    random_points,
    rank,
    residue,
    residues,
)
from monitor_core.modeling.statespace import Definition, StateSpace


def generic_rank(
    rows: Sequence[Sequence[Laurent]], seed: Seed, definitions: Sequence[Definition] = ()
) -> int:
    """Rank of a matrix of Laurent sums for generic values of its parameters; ``definitions`` tie some of them."""
    entries = {(i, j): entry for i, row in enumerate(rows) for j, entry in enumerate(row) if entry}
    names = set[str]().union(*(e.names for e in entries.values()), *(d.value.names for d in definitions))
    shape = (len(rows), max((len(row) for row in rows), default=0))
    ranks = []
    for point in random_points(names, definitions, seed):
        matrix = np.zeros(shape, dtype=np.int64)
        for place, entry in entries.items():
            matrix[place] = residue(entry, point)
        ranks.append(rank(matrix, point.prime))
    return max(ranks)


def minimality(ss: StateSpace, seed: Seed) -> tuple[int, int]:
    """Dimensions of the part that the inputs reach and of the part that the sensors see, for generic values."""
    ranks = []
    for point in points_of(ss, seed):
        A, B, C = residues(ss, point)
        ranks.append((len(krylov_basis(A, B, point.prime)), len(krylov_basis(A.T, C.T, point.prime))))
    return max(c for c, _ in ranks), max(o for _, o in ranks)
