"""The drive for which an experiment is planned, at its nominal values: frequency responses, and motions from rest."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import balance_of, zero_order_hold
from monitor_core.drive.structure import Drive
from monitor_core.excitation.multisine_signals import Complex
from monitor_core.kernel.compile import entry
from monitor_core.kernel.tables import ANGLE_FUNCTIONS, COSINE, COULOMB, OF_ANGLE, OF_MOTION, SINE, TORQUE

_SUBSTEP_S = 1e-3
"""Coulomb friction and gravity are held no longer than this while the drive is simulated."""
_RIGID = np.array([0.1, 0.2])  # rad/s: so slow that nothing bends


class DriveMotion(NamedTuple):
    """Torque [N m], angle [rad] and speed [rad/s] at each sample (N,), and all inputs of the drive (N, m).

    The torque acts until the next sample.
    """

    torque: Floats
    angle: Floats
    speed: Floats
    inputs: Floats


@dataclass(frozen=True)
class Plant:
    """The drive that a planned motion moves.

    Args:
        drive: the drive, with the angle as output.
        values: of all its parameters.
        interval_s: sample interval [s].
        speed_scale: that of Coulomb friction [rad/s].
        coulomb: factor of that friction.

    Raises:
        KeyError: a value is missing.
    """

    drive: Drive
    values: Mapping[str, float]
    interval_s: float
    speed_scale: float = 1.0
    coulomb: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", self.drive.complete(self.values))

    @cached_property
    def _balanced(self) -> tuple[Floats, Floats, Floats]:
        """A, B and the rows of angle and speed (2, n), in states x_i / d_i."""
        A, B, C = self.drive.matrices(self.values)
        B[:, [kind == COULOMB for kind in self.drive.inputs]] *= self.coulomb
        d = balance_of(A)
        A, B, C = A / d[:, None] * d, B / d[:, None], C * d
        return A, B, np.vstack([C, C @ A])

    @property
    def is_linear(self) -> bool:
        """Whether no input depends on the motion."""
        return not self.drive.acts(OF_MOTION, self.values)

    @cached_property
    def bears_weight(self) -> bool:
        """Whether gravity acts on the drive."""
        return self.drive.acts(OF_ANGLE, self.values)

    def response(self, frequency_hz: Floats) -> Complex:
        """Frequency response from the held torque to the samples of angle and speed (2, L)."""
        A, B, C = self._balanced
        Ad, Bd = zero_order_hold(A, B[:, self.drive.of_torque].sum(axis=1, keepdims=True), self.interval_s)
        z = np.exp(2j * np.pi * np.asarray(frequency_hz) * self.interval_s)
        x = np.linalg.solve(z[:, None, None] * np.eye(len(A)) - Ad, np.broadcast_to(Bd, (len(z), *Bd.shape)))
        return np.asarray((C @ x)[:, :, 0].T)

    @cached_property
    def _slowly(self) -> Complex:
        """Angle over each input (2, m) at two low frequencies."""
        A, B, C = self._balanced
        s = 1j * _RIGID[:, None, None] * np.eye(len(A))
        return np.asarray((C[:1] @ np.linalg.solve(s - A, np.broadcast_to(B, (2, *B.shape))))[:, 0])

    @cached_property
    def inertia(self) -> float:
        """Total inertia at the motor for rigid motion, kg m^2."""
        low, high = (1 / self._slowly[:, self.drive.of_torque].sum(axis=1)).real
        return float(abs(low - high) / (_RIGID[1] ** 2 - _RIGID[0] ** 2))

    def countered(self, angle: Floats, speed: Floats) -> Floats:
        """Torque (N,) that balances friction, weights and offsets along a slow motion (N,)."""
        forces = self.inputs(np.zeros_like(angle), angle, speed)
        like_torque = self._slowly[0] / self._slowly[0, self.drive.of_torque].sum()
        return np.asarray(-(like_torque.real * ~self.drive.of_torque) @ forces)

    def inputs(self, torque: Floats, angle: Floats, speed: Floats) -> Floats:
        """All inputs (m, N) of the drive with that torque (N,) at that angle and speed of the sensor."""
        out = np.ones((len(self.drive.inputs), len(torque)))
        for i, (kind, ratio) in enumerate(zip(self.drive.inputs, self._ratio, strict=True)):
            if kind == TORQUE:
                out[i] = torque
            elif kind == COULOMB:
                out[i] = np.tanh(ratio * speed / self.speed_scale)
            elif kind in ANGLE_FUNCTIONS:
                out[i] = ANGLE_FUNCTIONS[kind](ratio * angle)
        return out

    @cached_property
    def _ratio(self) -> Floats:
        return self.drive.matrix("ratio", self.values)[:, 0]

    def moved(self, forward: Floats, reference: Floats | None = None, gains: Floats | None = None) -> DriveMotion:
        """Motion from rest at angle zero, under  u = forward + kp (reference - angle) + kd (its slope - speed).

        Args:
            forward: torque (N,).
            reference: angle and its slope (2, N), with gains.
            gains: kp [N m/rad] and kd [N m s/rad] at each sample (2, N); default none.
        """
        A, B, C = self._balanced
        parts = 1 if self.is_linear else max(1, round(self.interval_s / _SUBSTEP_S))
        Ad, Bd = zero_order_hold(A, B, self.interval_s / parts)
        none = np.zeros((2, len(forward)))
        reference, gains = (none if rows is None else rows for rows in (reference, gains))
        out, inputs = np.empty((3, len(forward))), np.empty((len(forward), len(self.drive.inputs)))
        Ad, Bd, C = (np.ascontiguousarray(matrix) for matrix in (Ad, Bd, C))
        kinds, ratio = np.array(self.drive.inputs, dtype=float), self._ratio
        ratios = np.column_stack([ratio, ratio / self.speed_scale])
        reference, gains = np.ascontiguousarray(reference.T), np.ascontiguousarray(gains.T)
        step_through(_DiscreteDrive(Ad, Bd, C, kinds, ratios, parts), _Command(forward, reference, gains), out, inputs)
        torque, angle, speed = out
        return DriveMotion(torque, angle, speed, inputs)


# --- The inner loop of ``Plant.moved``, compiled ----------------------------------------------------------------------


class _DiscreteDrive(NamedTuple):
    """A drive whose inputs are held over one part of an interval."""

    Ad: Floats  # (n, n)
    Bd: Floats  # (n, m)
    C: Floats  # (2, n) rows of angle and speed
    kinds: Floats  # (m,) of the inputs
    ratio: Floats  # (m, 2) angle at each input over angle, and speed over speed in units of that of friction
    parts: int  # of an interval, over which the forces that depend on the motion are held


class _Command(NamedTuple):
    forward: Floats  # (N,) torque
    reference: Floats  # (N, 2) angle and slope
    gains: Floats  # (N, 2) of the controller on both


@entry
def step_through(drive: _DiscreteDrive, command: _Command, out: Floats, inputs: Floats) -> None:
    """A drive from rest: torque, angle, speed into ``out`` (3, N), all inputs at each sample into ``inputs`` (N, m)."""
    Ad, Bd, C, kinds, ratio, parts = drive
    forward, reference, gains = command
    n, m = Bd.shape
    x, y, f, moved = np.zeros(n), np.zeros(2), np.zeros(m), np.zeros(n)
    for k in range(len(forward)):
        for part in range(parts):
            for i in range(2):
                y[i] = 0.0
                for j in range(n):
                    y[i] += C[i, j] * x[j]
            if part == 0:
                u = forward[k]
                for i in range(2):
                    u += gains[k, i] * (reference[k, i] - y[i])
                out[0, k], out[1, k], out[2, k] = u, y[0], y[1]
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
            if part == 0:
                inputs[k] = f
            for i in range(n):
                moved[i] = 0.0
                for j in range(n):
                    moved[i] += Ad[i, j] * x[j]
                for j in range(m):
                    moved[i] += Bd[i, j] * f[j]
            x[:] = moved
