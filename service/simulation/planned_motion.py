"""Motion of a simulated axis: a controller and a test signal scaled to its drive.

Everything is computed from the frequency response of the drive at its nominal values, so it holds for any drive.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import COSINE, COULOMB, SINE, TORQUE, AxisModel

SPEED_RMS = 3.0
"""rad/s at the sensor, from the test signal alone: on the reference drive that takes 1.2 N m."""

_BANDWIDTH = 2.0  # rad/s: slow, so that the test signal moves the axis and not the controller
_RIGID = np.array([0.1, 0.2])  # rad/s: so slow that nothing bends


class Weight(NamedTuple):
    """The motor torque [N m] that holds a weight at angle zero, times cosine or sine of ``ratio`` * angle."""

    kind: int
    torque: float
    ratio: float


class Motion(NamedTuple):
    """``kp`` [N m/rad] and ``kd`` [N m s/rad] of the position controller, ``torque_rms`` [N m] of the test signal."""

    kp: float
    kd: float
    torque_rms: float
    weights: tuple[Weight, ...] = ()

    def holding(self, angle: float) -> float:
        """Torque [N m] that balances all weights at this angle [rad]."""
        return sum(
            w.torque * (math.cos if w.kind == COSINE else math.sin)(w.ratio * angle) for w in self.weights
        )


def motion_of(model: AxisModel, lines: Floats) -> Motion:
    """The motion of a drive whose output is the angle.

    Args:
        model: the drive with its nominal values.
        lines: angular frequencies of the test signal [rad/s] (L,).
    """
    low, high = stiffness(model, _RIGID)[0].real
    inertia = float(abs(low - high) / (_RIGID[1] ** 2 - _RIGID[0] ** 2))
    kp, kd = inertia * _BANDWIDTH**2, inertia * _BANDWIDTH
    torque, others = stiffness(model, lines)
    # Of fc sign(w), at a speed of random phases and SPEED_RMS, the part sqrt(2/pi) fc / SPEED_RMS follows the speed.
    friction = np.abs(_of_kind(model, others, COULOMB)) * math.sqrt(2 / math.pi) / SPEED_RMS
    closed = torque + kp + 1j * lines * (kd + friction)
    speed = np.sqrt(np.mean(np.abs(lines / closed) ** 2))  # rms at a torque of 1 N m rms
    return Motion(kp, kd, float(SPEED_RMS / speed), tuple(_weights(model)))


def stiffness(model: AxisModel, omega: Floats) -> tuple[Floats, Floats]:
    """Torque over angle (L,) and the torque (L, m) that acts like each input at 1; both complex."""
    A, B, C = model.matrices()
    s = 1j * omega[:, np.newaxis, np.newaxis] * np.eye(len(A))
    inputs = np.broadcast_to(B, (len(omega), *B.shape)).astype(complex)
    response = (C @ np.linalg.solve(s - A, inputs))[:, 0, :]
    torque = _of_kind(model, response, TORQUE)
    return 1 / torque, response / torque[:, np.newaxis]


def _of_kind(model: AxisModel, by_input: Floats, kind: int) -> Floats:
    return np.asarray(by_input[:, [k == kind for k in model.drive.inputs]].sum(axis=1))


def _weights(model: AxisModel) -> Sequence[Weight]:
    like_torque = stiffness(model, _RIGID)[1][0].real
    ratio = model.drive.matrix("ratio", model.nominal)[:, 0]
    return [
        Weight(kind, -float(like_torque[i]), float(ratio[i]))
        for i, kind in enumerate(model.drive.inputs)
        if kind in (COSINE, SINE)
    ]
