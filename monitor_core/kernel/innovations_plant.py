"""Simulates axes in innovations form side by side: their outputs for given torques and innovations."""

import math
from typing import NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import entry, kernel
from monitor_core.kernel.friction import SMALLEST, mean_torque_share, tanh
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE, WEIGHT
from monitor_core.kernel.work_arrays import floats, table


class PlantFriction(NamedTuple):
    """Friction of W axes from the speed at the middle of the interval (friction.py).

    v = v_0 + half (x, u) + sum of braked_c tanh(u_scale_c v)
    """

    state: int  # v_0 is x[state]
    unit: float  # or unit y where this is not 0
    half: Floats  # (n + m, W), by the state and the inputs but friction
    braked: Floats  # (m, W)


class InnovationsPlants(NamedTuple):
    """W axes in innovations form, held over an interval."""

    Ad: Floats  # (n, n, W)
    Bd: Floats  # (n, m, W)
    C: Floats  # (n, W)
    K: Floats  # (n,)
    kind: Ints  # (m,) as in the tables of the monitor
    u_scale: Floats  # (m,) as there
    friction: PlantFriction
    mean_state: int  # a state that is reset with every sample; -1: there is none
    late: Floats  # (W,) share of an interval for which the torque before still acts


@kernel
def _hold_friction(
    plants: InnovationsPlants, x: Floats, out: Floats, torque: Floats, before: Floats, speed: Floats, first: Floats,
    v: Floats,
) -> None:  # fmt: skip
    """Write the frictions to their rows of the inputs v (m, W); ``speed`` and ``first`` (W,) are scratch."""
    kind, u_scale, friction, late = plants.kind, plants.u_scale, plants.friction, plants.late
    n, W, half, braked = x.shape[0], out.size, friction.half, friction.braked
    for a in range(W):
        speed[a] = friction.unit * out[a] if friction.unit > 0.0 else x[friction.state, a]
    for r in range(n):
        for a in range(W):
            speed[a] += half[r, a] * x[r, a]
    for c in range(kind.size):
        what, row = kind[c], n + c
        if what == TORQUE:
            for a in range(W):
                share = mean_torque_share(late[a], 1.0)
                speed[a] += half[row, a] * (share * torque[a] + (1.0 - share) * before[a])
        elif what != COULOMB:
            for a in range(W):
                speed[a] += half[row, a] * v[c, a]
    for a in range(W):
        first[a] = 1.0
    for c in range(kind.size):
        if kind[c] == COULOMB:
            scale = u_scale[c]
            for a in range(W):
                first[a] -= braked[c, a] * scale
    for a in range(W):
        first[a] = speed[a] / max(first[a], SMALLEST)
    for c in range(kind.size):
        if kind[c] == COULOMB:
            scale = u_scale[c]
            for a in range(W):
                speed[a] += braked[c, a] * tanh(scale * first[a])
    for c in range(kind.size):
        if kind[c] == COULOMB:
            scale = u_scale[c]
            for a in range(W):
                v[c, a] = tanh(scale * speed[a])


@entry
def simulate_innovations(
    plants: InnovationsPlants, x: Floats, u_before: Floats, u: Floats, eps: Floats, weight: Floats, y: Floats
) -> None:
    """y = C x + eps,  x = x + K eps,  then x = Ad x + Bd u over the interval, of W axes.

    ``x`` (n, W) and ``u_before`` (W,) are changed; u, eps, weight, y (N, W).
    """
    Ad, Bd, C, K, kind, u_scale, _, mean_state, late = plants
    n, m, W = K.size, kind.size, late.size
    v, w, speed, first = table(m, W), table(n, W), floats(W), floats(W)
    out, torque = floats(W), floats(W)
    for k in range(u.shape[0]):
        for a in range(W):
            out[a], torque[a] = 0.0, u[k, a]
        for r in range(n):
            for a in range(W):
                out[a] += C[r, a] * x[r, a]
        for a in range(W):
            out[a] += eps[k, a]
            y[k, a] = out[a]
        for r in range(n):
            gain = K[r]
            for a in range(W):
                x[r, a] += gain * eps[k, a]
        if mean_state >= 0:
            for a in range(W):
                x[mean_state, a] = 0.0
        for c in range(m):
            what, scale = kind[c], u_scale[c]
            if what == TORQUE:
                for a in range(W):
                    v[c, a] = (1.0 - late[a]) * torque[a] + late[a] * u_before[a]
            elif what == ONE:
                for a in range(W):
                    v[c, a] = 1.0
            elif what == COSINE:
                for a in range(W):
                    v[c, a] = math.cos(scale * out[a])
            elif what == SINE:
                for a in range(W):
                    v[c, a] = math.sin(scale * out[a])
            elif what == WEIGHT:
                for a in range(W):
                    v[c, a] = weight[k, a]
        _hold_friction(plants, x, out, torque, u_before, speed, first, v)
        for a in range(W):
            u_before[a] = torque[a]
        for r in range(n):
            for a in range(W):
                w[r, a] = 0.0
            for j in range(n):
                for a in range(W):
                    w[r, a] += Ad[r, j, a] * x[j, a]
            for c in range(m):
                for a in range(W):
                    w[r, a] += Bd[r, c, a] * v[c, a]
        for r in range(n):
            for a in range(W):
                x[r, a] = w[r, a]
