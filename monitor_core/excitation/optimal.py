"""The spectrum that tells most of chosen parameters: an A-optimal design over the powers of the lines.

The information on the parameters is a sum over lines, power times |sensitivity|^2, and the designs are convex:

    minimise  tr(W M^-1),   M = sum_k p_k M_k,   subject to  sum_k c_jk p_k <= 1  for each limit j

The multiplicative algorithm (S. Silvey, D. Titterington, B. Torsney, Comm. Statistics A 7 (1978)) multiplies each
power by the root of what it gains over what it costs, the limits weighed by how much of each is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monitor_core.excitation.multisine import Complex
from monitor_core.kernel.tables import Floats

_STEPS = 2000
_CLOSE = 1e-3


class Optimum(NamedTuple):
    """Powers (L,) and an upper bound of (their criterion over the smallest possible) - 1."""

    powers: Floats
    excess: float


def information(responses: Complex) -> Floats:
    """M_k (L, p, p) of a line of power 1, for each sample of white noise of variance 1, from responses (L, p)."""
    return np.asarray((responses.conj()[:, :, None] * responses[:, None, :]).real)


def optimal_powers(M: Floats, costs: Floats, wanted: Floats) -> Optimum:
    """The best powers of the lines.

    Args:
        M: information of each line (L, p, p); together they must tell all parameters.
        costs: share of each limit that a power of 1 in each line takes (J, L).
        wanted: weights W of the variances of the parameters (p,).

    Raises:
        numpy.linalg.LinAlgError: the lines together do not tell all parameters.
    """
    p = 1 / (len(M) * costs.max(axis=0))
    weights = np.ones(len(costs)) / len(costs)
    for _ in range(_STEPS):
        p = p / (costs @ p).max()
        gains, value = _gains(M, p, wanted)
        # The criterion is convex and falls with the inverse of all powers: no powers reach less than value / worst.
        ratio = gains / (value * (weights @ costs))
        excess = float(ratio.max()) - 1
        if excess < _CLOSE:
            break
        p = p * np.sqrt(ratio)
        weights = weights * np.sqrt(np.maximum(costs @ p, 1e-9))
        weights /= weights.sum()
    return Optimum(p / (costs @ p).max(), excess)


def _gains(M: Floats, p: Floats, wanted: Floats) -> tuple[Floats, float]:
    """How much the criterion falls for each power (L,), and the criterion."""
    C = np.linalg.inv(np.tensordot(p, M, axes=1))
    return np.einsum("ij,lij->l", (C * wanted) @ C, M), float(wanted @ np.diag(C))
