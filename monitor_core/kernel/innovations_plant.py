"""Simulated axes in innovations form, side by side: their outputs with given torque and innovations."""

import math
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import entry
from monitor_core.kernel.friction import SMALLEST, mean_torque_share
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE, WEIGHT


class PlantFriction(NamedTuple):
    """Friction of the speed at the middle of the interval (friction.py), of F drives.

    v = v_0 + half (x, u) + sum of braked_c tanh(u_scale_c v)
    """

    state: int  # v_0 is x[state]
    unit: float  # or unit y where this is not 0
    half: Floats  # (F, n + m), by the state and the inputs but friction
    braked: Floats  # (F, m)


@entry
def simulate_innovations(
    Ad: Floats,
    Bd: Floats,
    C: Floats,
    which: Ints,
    K: Floats,
    kind: Ints,
    u_scale: Floats,
    friction: PlantFriction,
    mean_state: int,
    late: Floats,
    x: Floats,
    u_before: Floats,
    u: Floats,
    eps: Floats,
    weight: Floats,
    y: Floats,
) -> None:
    """y = C x + eps,  x = x + K eps,  then x = Ad x + Bd u over the interval.

    Axis a is number ``which[a]`` of the drives Ad (F, n, n), Bd (F, n, m), C (F, n).  K (n,); ``kind`` (m,) and
    ``u_scale`` (m,) as in the tables of the monitor.  ``late`` (F,): that share of an interval the torque before still
    acts.  ``x`` (W, n) and ``u_before`` (W,) are changed; u, eps, weight, y (N, W).
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
                elif kind[c] == COSINE:
                    v[c] = math.cos(u_scale[c] * out)
                elif kind[c] == SINE:
                    v[c] = math.sin(u_scale[c] * out)
                elif kind[c] == WEIGHT:
                    v[c] = weight[k, a]
            speed = friction.unit * out if friction.unit > 0.0 else x[a, friction.state]
            for r in range(n):
                speed += friction.half[f, r] * x[a, r]
            share = mean_torque_share(late[f], 1.0)
            for c in range(m):
                acting = share * u[k, a] + (1.0 - share) * u_before[a] if kind[c] == TORQUE else v[c]
                speed += friction.half[f, n + c] * acting if kind[c] != COULOMB else 0.0
            divisor = 1.0
            for c in range(m):
                divisor -= friction.braked[f, c] * u_scale[c] if kind[c] == COULOMB else 0.0
            first = speed / max(divisor, SMALLEST)
            for c in range(m):
                speed += friction.braked[f, c] * math.tanh(u_scale[c] * first) if kind[c] == COULOMB else 0.0
            for c in range(m):
                v[c] = math.tanh(u_scale[c] * speed) if kind[c] == COULOMB else v[c]
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
