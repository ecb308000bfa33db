"""The inner loop of ``Plant.moved``, compiled."""

from __future__ import annotations

import math

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import entry
from monitor_core.kernel.tables import COSINE, COULOMB, SINE, TORQUE


@entry
def step_through(
    Ad: Floats,
    Bd: Floats,
    C: Floats,
    kinds: Floats,
    ratio: Floats,
    parts: int,
    forward: Floats,
    reference: Floats,
    gains: Floats,
    out: Floats,
    inputs: Floats,
) -> None:
    """W drives from rest, one after the other.

    Args:
        Ad: (n, n) over one part of an interval; Bd (n, m).
        Bd: (n, m).
        C: rows of angle and speed (2, n).
        kinds: of the inputs (m,).
        ratio: angle at each input (m, 2) over angle, and speed over speed in units of that of friction.
        parts: of an interval, over which the forces that depend on the motion are held.
        forward: torque (N, W).
        reference: angle and slope (N, 2).
        gains: of the controller on both (2,).
        out: torque, angle, speed (3, N, W).
        inputs: all inputs at each sample of the first drive (N, m).
    """
    n, m = Bd.shape
    for w in range(forward.shape[1]):
        x, y, f, moved = np.zeros(n), np.zeros(2), np.zeros(m), np.zeros(n)
        for k in range(len(forward)):
            for part in range(parts):
                for i in range(2):
                    y[i] = 0.0
                    for j in range(n):
                        y[i] += C[i, j] * x[j]
                if part == 0:
                    u = forward[k, w]
                    for i in range(2):
                        u += gains[i] * (reference[k, i] - y[i])
                    out[0, k, w], out[1, k, w], out[2, k, w] = u, y[0], y[1]
                for i in range(m):
                    f[i] = 1.0
                    if kinds[i] == TORQUE:
                        f[i] = u
                    elif kinds[i] == COULOMB:
                        f[i] = math.tanh(ratio[i, 1] * y[1])
                    elif kinds[i] == COSINE:
                        f[i] = math.cos(ratio[i, 0] * y[0])
                    elif kinds[i] == SINE:
                        f[i] = math.sin(ratio[i, 0] * y[0])
                if part == 0 and w == 0:
                    inputs[k] = f
                for i in range(n):
                    moved[i] = 0.0
                    for j in range(n):
                        moved[i] += Ad[i, j] * x[j]
                    for j in range(m):
                        moved[i] += Bd[i, j] * f[j]
                x[:] = moved
