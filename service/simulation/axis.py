"""One simulated axis: the drive, a gentle position controller, a test signal, sensors with noise."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monitor_core.excitation import multisine
from monitor_core.reference import faulty
from monitor_core.simulation import SimulatedAxis
from service.config import DRIVES, NamedAxis

PERIOD_S = 10.0
BAND_HZ = (0.0, 30.0)
ACCELERATION_RMS = 36.0
"""rad/s^2 of the motor, were the drive rigid: 1.2 N m on the reference drive."""
RIPPLE = 0.4
"""Part of the configured torque noise that the drive really has; the rest is for what no model has."""

_BANDWIDTH = 2.0  # rad/s: slow, so that the test signal moves the axis and not the controller
_SWING, _SWING_PERIOD_S = 2.0, 20.0  # rad, s


class Reading(NamedTuple):
    """What the controller sends of one sample."""

    torque: float  # N m
    motion: float  # rad or rad/s


class ControlledAxis:
    """Position-controlled axis with the drive, the nominal values and the noise of a configured one.

    Args:
        axis: the configured axis.
        rng: for the test signal and the noise.
    """

    def __init__(self, axis: NamedAxis, rng: np.random.Generator) -> None:
        config = axis.config
        self.id, self.interval_s = axis.id, config.sample_interval_s
        self._delay_s = config.torque_delay_s
        self._output = config.output
        self._rng = rng
        nominal = config.model.nominal
        # With the angle among its states, whichever of angle and speed is sent.
        drive = DRIVES[config.model.drive]("angle")
        self._drive = SimulatedAxis(nominal, config.model.friction_speed_scale, drive=drive)
        self._inertia = _rigid_inertia(nominal)
        count = round(PERIOD_S / self.interval_s)
        self._test_signal = multisine(
            rng, count, self.interval_s, _band(self.interval_s), ACCELERATION_RMS * self._inertia
        )
        self._ripple = RIPPLE * (config.estimator.torque_noise or 0.0)
        self._noise = config.estimator.output_noise or 0.0
        self._torque_before = 0.0

    def break_down(self, fault: Mapping[str, float]) -> None:
        """From now on parameters have so many times their value: {"fm": 1.3, "1/Ja": 0.8}.

        Raises:
            KeyError: the drive has no such parameter.
            ValueError: the drive cannot have such a value.
        """
        self._drive.set(faulty(self._drive.values, fault))

    def sample(self, k: int) -> Reading:
        """Sample k: what is measured and commanded now; then the drive moves on to the next one."""
        torque = self._command(k)
        motion = self._drive.angle if self._output == "angle" else self._drive.speed
        reading = Reading(torque, motion + self._noise * self._rng.standard_normal())
        self._move(torque + self._ripple * self._rng.standard_normal())
        return reading

    def _command(self, k: int) -> float:
        """PD control around a slow swing, and the test signal."""
        kp, kd = self._inertia * _BANDWIDTH**2, self._inertia * _BANDWIDTH
        wanted = _SWING * math.sin(2 * math.pi * k * self.interval_s / _SWING_PERIOD_S)
        test = self._test_signal[k % len(self._test_signal)]
        return float(kp * (wanted - self._drive.angle) - kd * self._drive.speed + test)

    def _move(self, torque: float) -> None:
        """One interval: the torque before acts until the delay is over."""
        if self._delay_s > 0:
            self._drive.step(self._torque_before, self._delay_s)
        if self._delay_s < self.interval_s:
            self._drive.step(torque, self.interval_s - self._delay_s)
        self._torque_before = torque


def _rigid_inertia(values: Mapping[str, float]) -> float:
    """Inertia that the motor feels at low frequencies, kg m^2."""
    return values["Jm"] + values["r"] ** 2 * (values["Jg"] + values["Ja"])


def _band(interval_s: float) -> tuple[float, float]:
    """The band of the test signal, below the Nyquist frequency of slow samples."""
    return BAND_HZ[0], min(BAND_HZ[1], 0.4 / interval_s)
