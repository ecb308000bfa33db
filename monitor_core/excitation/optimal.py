"""A-optimal spectrum for chosen parameters: the powers of the lines.

The information on the parameters is a sum over lines, power times |sensitivity|^2, and the design problem is convex:

    minimise  tr(W M^-1),   M = sum_k p_k M_k,   subject to  sum_k c_jk p_k <= 1  for each limit j

The multiplicative algorithm (S. Silvey, D. Titterington, B. Torsney, Comm. Statistics A 7 (1978)) multiplies each power
by the root of its gain over its cost, with the limits weighted by their use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine_signals import Complex

_STEPS = 2000
_CLOSE = 1e-3
_FLOOR = 1e-9
_SINGULAR = 1e-13


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
    _must_tell_all(np.tensordot(p, M, axes=1))
    weights = np.ones(len(costs)) / len(costs)
    best, least, powers = np.inf, 0.0, p
    for _ in range(_STEPS):
        p = p / (costs @ p).max()
        gains, value = _gains(M, p, wanted)
        # The criterion is convex and falls with the inverse of all powers: no powers reach less than value / worst.
        ratio = gains / (value * (weights @ costs))
        least = max(least, value / float(ratio.max()))
        if value < best:
            best, powers = value, p
        if best < (1 + _CLOSE) * least:
            break
        p = p * np.sqrt(ratio)
        p = np.maximum(p, _FLOOR * p.max())  # what has become zero never grows again
        used = costs @ p
        weights = np.maximum(weights * np.sqrt(used / used.max()), _FLOOR)
        weights /= weights.sum()
    return Optimum(powers, best / least - 1)


def _must_tell_all(M: Floats) -> None:
    scale = np.sqrt(np.diag(M))
    if not (scale > 0).all() or np.linalg.eigvalsh(M / np.outer(scale, scale))[0] < _SINGULAR:
        raise np.linalg.LinAlgError("the lines do not tell all parameters")


def _gains(M: Floats, p: Floats, wanted: Floats) -> tuple[Floats, float]:
    """How much the criterion falls for each power (L,), and the criterion."""
    C = np.linalg.inv(np.tensordot(p, M, axes=1))
    return np.einsum("ij,lij->l", (C * wanted) @ C, M), float(wanted @ np.diag(C))
