"""The speed at the middle of an interval by state and inputs, which friction depends on (kernel/friction.py)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.predictor.held_drive import Linear
from monitor_core.kernel.tables import COULOMB, TORQUE


class MiddleSpeed(NamedTuple):
    """Half an interval times the acceleration; derivatives have the parameter as last axis."""

    half: Floats  # (G, n + m') by the state and the inputs but friction; m' = m + 1: the last is the torque before
    dhalf: Floats  # (G, n + m', q)
    braked: Floats  # (G, m) by each friction
    dbraked: Floats  # (G, m, q)


def middle_speed(
    system: Linear, kinds: Ints, state: int | None, intervals_s: Floats, late_s: float | None
) -> MiddleSpeed:
    """Over intervals (G,) [s], of the speed in ``state``, or None: of the output, which is the speed.

    ``late_s``: delay of the torque, with the derivative with respect to it as the last one; or None.
    """
    n = len(system.A)
    AB, dAB = np.hstack([system.A, system.B]), np.hstack([system.dA, system.dB])
    if state is None:
        row = system.C @ AB
        slopes = np.einsum("rp,rc->cp", system.dC, AB) + np.einsum("r,rcp->cp", system.C, dAB)
    else:
        row, slopes = AB[state], dAB[state]
    half, dhalf = (np.multiply.outer(intervals_s / 2, part) for part in (row, slopes))
    friction = kinds == COULOMB
    braked, dbraked = (
        part[:, n:] * friction.reshape(shape) for part, shape in ((half, -1), (dhalf, (-1, 1)))
    )
    half[:, n:][:, friction] = 0.0
    dhalf[:, n:][:, friction] = 0.0
    if late_s is None:
        return MiddleSpeed(half, dhalf, braked, dbraked)
    return MiddleSpeed(
        *_late(half, dhalf, n + np.flatnonzero(kinds == TORQUE), intervals_s, late_s),
        braked,
        np.concatenate([dbraked, np.zeros((*braked.shape, 1))], axis=2),
    )


def _late(
    half: Floats, dhalf: Floats, torque: Ints, intervals_s: Floats, late_s: float
) -> tuple[Floats, Floats]:
    """A share (1 - late / h)^2 of the held torque, the rest of the one before (mean_torque_share of the kernel)."""
    rest = (1 - np.minimum(late_s, intervals_s) / intervals_s)[:, np.newaxis]
    out = np.concatenate([half, (1 - rest**2) * half[:, torque]], axis=1)
    out[:, torque] *= rest**2
    slopes = np.concatenate([dhalf, (1 - rest**2)[..., np.newaxis] * dhalf[:, torque]], axis=1)
    slopes[:, torque] *= (rest**2)[..., np.newaxis]
    of_delay = np.zeros(out.shape)
    of_delay[:, torque] = -2 * rest / intervals_s[:, np.newaxis] * half[:, torque]
    of_delay[:, -1:] = -of_delay[:, torque]
    return out, np.concatenate([slopes, of_delay[..., np.newaxis]], axis=2)
