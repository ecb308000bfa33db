"""What inputs reach and sensors see, by the rank at random points."""

from __future__ import annotations

from monitor_core.modeling.modular import Seed, krylov_basis, points_of, residues
from monitor_core.modeling.statespace import StateSpace


def minimality(ss: StateSpace, seed: Seed) -> tuple[int, int]:
    """Dimensions of the part that the inputs reach and of the part that the sensors see, for generic values."""
    ranks = []
    for point in points_of(ss, seed):
        A, B, C = residues(ss, point)
        ranks.append((len(krylov_basis(A, B, point.prime)), len(krylov_basis(A.T, C.T, point.prime))))
    return max(c for c, _ in ranks), max(o for _, o in ranks)
