"""Balancing and exact zero-order hold as matrices, for simulation, Kalman gain and fits; not for the recursion."""

import numpy as np
import scipy.linalg as sla

from monitor_core.arrays import Floats
from monitor_core.kernel.matrix_exponential import hold_intervals


def balance_of(A: Floats) -> Floats:
    """The diagonal d (n,) of powers of two that balances A: in states x_i / d_i it is D^-1 A D."""
    return np.asarray(sla.matrix_balance(A, permute=False, separate=True)[1][0], dtype=float)


def zero_order_hold(A: Floats, B: Floats, interval_s: float) -> tuple[Floats, Floats]:
    """Ad (n, n) and Bd (n, m) of  x(t + h) = Ad x(t) + Bd u  with u held over h = ``interval_s``."""
    n, m = B.shape
    F = np.zeros((n + m, n + m))
    F[:n, :n], F[:n, n:] = A, B
    exp = sla.expm(F * interval_s)
    return exp[:n, :n], exp[:n, n:]


def zero_order_hold_slopes(
    A: Floats, B: Floats, dA: Floats, dB: Floats, intervals_s: Floats
) -> tuple[Floats, Floats]:
    """[Ad Bd] (G, n, n + m) for the intervals (G,), and its derivatives (G, p, n, n + m).

    ``dA`` (p, n, n) and ``dB`` (p, n, m) are the derivatives of A and B.  Nothing is balanced here.
    """
    n, m, p, G = *B.shape, len(dA), len(intervals_s)
    X, dX = np.empty((G, n, n + m)), np.empty((G, p, n, n + m))
    A, B, dA, dB, h = (np.ascontiguousarray(array, dtype=float) for array in (A, B, dA, dB, intervals_s))
    hold_intervals(A, B, dA, dB, h, X, dX)
    return X, dX
