"""Masses and springs of a chain from what is seen at its end: an inverse eigenvalue problem with a closed solution.

Speed over torque at the first of n masses that springs join in a row, without losses, is

    Y(s) = sum_i a_i s / (s^2 + p_i^2),      p_0 = 0,  a_i > 0.

The springs' matrix scaled by the masses, M^-1/2 K M^-1/2, is a Jacobi matrix (symmetric, tridiagonal) with the
eigenvalues p_i^2, whose normalised eigenvectors begin with sqrt(a_i / sum a).  These determine it (Stieltjes' continued
fraction; Hochstadt; Golub and Welsch); Householder's reflections find it without cancellation.  Its null vector is
sqrt(J_i), and 1 / J_1 = sum a.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import hessenberg

from monitor_core.arrays import Floats


class Chain(NamedTuple):
    """Seen from the first mass, all at its speed: J (n,) kg m^2, k (n - 1,) N m/rad."""

    J: Floats
    k: Floats


def chain_of_modes(p: Floats, a: Floats) -> Chain:
    """From resonances p (n,), rad/s, with p_0 = 0, and their weights a (n,), 1/(kg m^2).

    Raises:
        ValueError: weights that are not positive, or resonances that are not distinct and increasing from zero.
    """
    if p[0] != 0 or not (np.diff(p) > 0).all() or not (a > 0).all():
        raise ValueError("resonances must increase from zero, and their weights must be positive")
    n, top = p.size, max(float(p[-1]), 1.0)
    bordered = np.zeros((n + 1, n + 1))
    bordered[0, 1:] = bordered[1:, 0] = np.sqrt(a / a.sum())
    bordered[1:, 1:] = np.diag((p / top) ** 2)
    T = hessenberg(bordered)[1:, 1:]
    diagonal, beside = np.diag(T), np.abs(np.diag(T, 1))
    # The null vector: what the springs before a mass do to it, those behind it undo.
    v = np.ones(n)
    for i in range(n - 1):
        before = beside[i - 1] * v[i - 1] if i else 0.0
        v[i + 1] = (diagonal[i] * v[i] - before) / beside[i]
    J = v**2 / a.sum()
    return Chain(J, beside * top**2 * np.sqrt(J[:-1] * J[1:]))


def modes_of_chain(chain: Chain) -> tuple[Floats, Floats]:
    """Resonances p (n,) and weights a (n,): what chain_of_modes inverts."""
    n = chain.J.size
    stretch = np.eye(n, k=0)[: n - 1] - np.eye(n, k=1)[: n - 1]
    root = np.sqrt(chain.J)
    # Squares of singular values: a small eigenvalue keeps its digits.
    _, s, Vt = np.linalg.svd(np.sqrt(chain.k)[:, None] * stretch / root)
    order = np.argsort(np.append(s, 0.0))
    return np.append(s, 0.0)[order], (Vt[order, 0] / root[0]) ** 2
