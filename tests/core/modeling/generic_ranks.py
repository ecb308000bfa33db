"""Oracles by numerical rank at random points: of matrices of Laurent sums, and of what inputs reach and sensors see."""

from __future__ import annotations

from collections.abc import Sequence

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modular import Seed, krylov_rank, points_of, random_points, rank, residues
from monitor_core.modeling.statespace import Definition, StateSpace


def generic_rank(
    rows: Sequence[Sequence[Laurent]], seed: Seed, definitions: Sequence[Definition] = ()
) -> int:
    """Rank of a matrix of Laurent sums for generic values of its parameters; ``definitions`` tie some of them."""
    entries = {(i, j): entry for i, row in enumerate(rows) for j, entry in enumerate(row) if entry}
    names = set[str]().union(*(e.names for e in entries.values()), *(d.value.names for d in definitions))
    shape = (len(rows), max((len(row) for row in rows), default=0))
    points = random_points(names, definitions, seed)
    return max(rank(residues(entries, shape, point), point.prime) for point in points)


def minimality(ss: StateSpace, seed: Seed) -> tuple[int, int]:
    """Dimensions of the part that the inputs reach and of the part that the sensors see, for generic values."""
    n, m, q = len(ss.states), len(ss.inputs), len(ss.sensors)
    ranks = []
    for point in points_of(ss, seed):
        A, B, C = (residues(e, s, point) for e, s in ((ss.A, (n, n)), (ss.B, (n, m)), (ss.C, (q, n))))
        ranks.append((krylov_rank(A, B, point.prime), krylov_rank(A.T, C.T, point.prime)))
    return max(c for c, _ in ranks), max(o for _, o in ranks)
