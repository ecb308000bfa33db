"""Exact zero-order hold as matrices, for whatever is not the recursion: simulation, Kalman gain."""

import numpy as np
import scipy.linalg as sla

from monitor_core.kernel.tables import Floats


def zero_order_hold(A: Floats, B: Floats, interval_s: float) -> tuple[Floats, Floats]:
    """Ad (n, n) and Bd (n, m) of  x(t + h) = Ad x(t) + Bd u  with u held over h = ``interval_s``."""
    n, m = B.shape
    F = np.zeros((n + m, n + m))
    F[:n, :n], F[:n, n:] = A, B
    exp = sla.expm(F * interval_s)
    return exp[:n, :n], exp[:n, n:]
