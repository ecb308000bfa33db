"""A motion for the position controller of an axis, under which the drive gets the designed torque."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine_signals import Complex, Multisine
from monitor_core.excitation.open_loop import ExcitationError
from monitor_core.excitation.planned_drive import Controller, Motion, Plant
from monitor_core.excitation.record_phases import Schedule

_BANDWIDTH = 2.0
"""rad/s, of the controller that stands for a good one: it only keeps the drive from drifting away."""


@dataclass(frozen=True)
class ClosedLoop:
    """Motions of a plant that follows a reference, with the torque signal at a given amplitude.

    Without a ``controller`` the real one is assumed to follow well: the reference is the linear motion under the
    signal, and the torque along it is known beforehand.  With a controller, the reference makes it command the signal.

    Raises:
        ExcitationError: the controller does not hold the drive.
    """

    plant: Plant
    schedule: Schedule
    signal: Multisine
    controller: Controller | None = None

    def __post_init__(self) -> None:
        if not self.plant.held_together_by(self._controller):
            c = self._controller
            raise ExcitationError(
                f"the drive is not stable with kp = {c.kp:g} N m/rad and kd = {c.kd:g} N m s/rad"
            )

    @cached_property
    def _controller(self) -> Controller:
        if self.controller is not None:
            return self.controller
        J = self.plant.inertia
        return Controller(J * _BANDWIDTH**2, J * _BANDWIDTH)

    @cached_property
    def planned_angle(self) -> Floats:
        """Angle of the reference (samples,), from rest at zero and back, with the same room on both sides."""
        G = self.plant.response(self.signal.frequency_hz)[0]
        if self.controller is not None:
            omega = 2 * np.pi * self.signal.frequency_hz
            G = G + 1 / (self.controller.kp + 1j * omega * self.controller.kd)
        angle = self.schedule.repeated(self.signal.through(G))
        return np.asarray(self.schedule.window() * (angle - (angle.max() + angle.min()) / 2))

    @cached_property
    def _references(self) -> Floats:
        """Angle and its derivative (2, samples)."""
        return np.array([self.planned_angle, self._filtered(lambda f: 2j * np.pi * f)])

    @cached_property
    def _forward(self) -> Floats:
        """The torque along the linear motion (samples,), from the inverse of the drive's frequency response."""
        return self._filtered(lambda f: 1 / self.plant.response(f)[0])

    def _filtered(self, response: Callable[[Floats], Complex]) -> Floats:
        """The planned angle through a frequency response, below twice the highest line."""
        N = len(self.planned_angle)
        spectrum = np.fft.rfft(self.planned_angle)
        frequency = np.arange(len(spectrum)) / (N * self.plant.interval_s)
        top = min(2 * float(self.signal.frequency_hz.max()), 0.4 / self.plant.interval_s)
        used = (frequency > 0) & (frequency <= max(top, float(self.signal.frequency_hz.max())))
        spectrum[~used] = 0
        spectrum[used] *= response(frequency[used])
        return np.fft.irfft(spectrum, N)

    def reference(self, size: float) -> Floats:
        """Angle [rad] and speed [rad/s] (2, samples) that the controller must follow."""
        return size * self._references

    def move(self, size: float) -> Motion:
        """The motion (samples, 1) with the signal scaled by a factor."""
        angle, speed = self.reference(size)
        forward = np.zeros(len(angle))
        if self.controller is None:
            forward = size * self._forward + self.plant.countered(angle, speed)
        motion = self.plant.moved(forward[:, None], np.array([angle, speed]), self._controller)
        if not all(math.isfinite(np.abs(x).max()) for x in motion):
            raise ExcitationError("the drive runs away from its controller")
        return motion
