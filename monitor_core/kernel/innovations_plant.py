"""Simulated axes in innovations form, side by side: their outputs with given torque and innovations."""

import math

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import entry
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, TORQUE


@entry
def simulate_innovations(
    Ad: Floats,
    Bd: Floats,
    C: Floats,
    which: Ints,
    K: Floats,
    kind: Ints,
    u_scale: Floats,
    speed_state: int,
    filtered: bool,
    mean_state: int,
    late: Floats,
    x: Floats,
    u_before: Floats,
    u: Floats,
    eps: Floats,
    y: Floats,
) -> None:
    """y = C x + eps,  x = x + K eps,  then x = Ad x + Bd u over the interval.

    Axis a is number ``which[a]`` of the drives Ad (F, n, n), Bd (F, n, m), C (F, n).  K (n,); ``kind`` (m,) and
    ``u_scale`` (m,) as in the tables of the monitor, friction by the speed x[speed_state] where ``filtered``, else by
    y.  ``late`` (F,): that share of an interval the torque before still acts.  ``x`` (W, n) and ``u_before`` (W,) are
    changed; u, eps, y (N, W).
    """
    n, m = K.size, kind.size
    v, w = np.zeros(m), np.zeros(n)
    for a in range(which.size):
        f = which[a]
        for k in range(u.shape[0]):
            out = 0.0
            for r in range(n):
                out += C[f, r] * x[a, r]
            out += eps[k, a]
            y[k, a] = out
            for r in range(n):
                x[a, r] += K[r] * eps[k, a]
            if mean_state >= 0:
                x[a, mean_state] = 0.0
            for c in range(m):
                if kind[c] == TORQUE:
                    v[c] = (1.0 - late[f]) * u[k, a] + late[f] * u_before[a]
                elif kind[c] == ONE:
                    v[c] = 1.0
                elif kind[c] == COULOMB:
                    v[c] = math.tanh(u_scale[c] * (x[a, speed_state] if filtered else out))
                elif kind[c] == COSINE:
                    v[c] = math.cos(u_scale[c] * out)
                else:
                    v[c] = math.sin(u_scale[c] * out)
            u_before[a] = u[k, a]
            for r in range(n):
                total = 0.0
                for j in range(n):
                    total += Ad[f, r, j] * x[a, j]
                for c in range(m):
                    total += Bd[f, r, c] * v[c]
                w[r] = total
            for r in range(n):
                x[a, r] = w[r]
