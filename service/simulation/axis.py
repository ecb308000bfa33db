"""A simulated axis: the drive, a soft position controller, a test signal, sensors with noise."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import DELAY, AxisModel, split_name
from monitor_core.excitation import faulty, multisine
from monitor_core.modeling import SimulatedAxis
from service.config import NamedAxis, conditions_of, drive_of, given_values, predictor_of
from service.simulation.planned_motion import motion_of
from service.simulation.simulated_conditions import SimulatedConditions

PERIOD_S = 10.0
BAND_HZ = (0.0, 30.0)
RIPPLE = 0.4
"""Part of the configured torque noise that the drive really has; the rest is for what no model has."""

FOLLOW_S = 0.1
"""So often a drive follows its operating conditions."""

_SWING, _SWING_PERIOD_S = 2.0, 20.0  # rad, s


class Reading(NamedTuple):
    """Values of one sample that the controller sends."""

    torque: float  # N m
    motion: float  # rad or rad/s
    signals: tuple[float, ...] = ()  # further ones that the axis needs, in the order of the configuration


class ControlledAxis:
    """Position-controlled axis with the drive, the nominal values and the noise of a configured one.

    Args:
        axis: the configured axis.
        rng: for the test signal and the noise.
    """

    def __init__(self, axis: NamedAxis, rng: np.random.Generator) -> None:
        config = axis.config
        self.axis, self.interval_s = axis, config.sample_interval_s
        predictor = predictor_of(config)
        self._delay_s = predictor.torque_delay_s
        self._output, self._averaged = config.output, config.interval_mean
        self._rng = rng
        # With the angle among its states, whichever of angle and speed is sent.
        self._given = given_values(config)
        self._model = model = AxisModel(drive_of(config, "angle"), self._given, ())
        self._drive = SimulatedAxis(model.nominal, predictor.friction_speed_scale, drive=model.drive)
        self._motion = motion_of(model, lines_of_motion(self.interval_s))
        length, band = round(PERIOD_S / self.interval_s), _band(self.interval_s)
        self._test_signal = multisine(rng, length, self.interval_s, band, self._motion.torque_rms)
        self._ripple = RIPPLE * (predictor.torque_noise or 0.0)
        self._noise = predictor.output_noise or 0.0
        self._torque_before = self._angle_before = 0.0
        self._conditions = SimulatedConditions(axis) if conditions_of(axis) else None
        self._follows_every = max(1, round(FOLLOW_S / self.interval_s))

    def break_down(self, fault: Mapping[str, float]) -> None:
        """Multiply parameters by factors from now on: {"fm": 1.3, "1/Ja": 0.8}.

        They may be parameters of the drive, or drawn ones of which the drive has merged ones.  The delay of the torque
        is given in seconds instead of a factor.

        Raises:
            KeyError: the drive has no such parameter.
            ValueError: the drive cannot have such a value.
        """
        own = {name: factor for name, factor in fault.items() if name != DELAY or DELAY in self._given}
        changed = faulty({**self._model.nominal, **self._given}, own)
        named = {split_name(name)[0] for name in own}
        delay_s = fault.get(DELAY, self._delay_s) if DELAY not in own else self._delay_s
        if not 0 <= delay_s <= self.interval_s:
            raise ValueError(
                f"delay = {delay_s:g}: a torque acts from 0 to {self.interval_s:g} s after its sample"
            )
        given = {name: value for name, value in changed.items() if name in named or name in self._given}
        self._drive.set(AxisModel(self._model.drive, given, ()).nominal)
        self._given, self._delay_s = given, delay_s

    def sample(self, k: int, others: Mapping[str, float] = MappingProxyType({})) -> Reading:
        """Sample k: the measured and commanded values now; then the drive moves to the next one.

        ``others`` are the motions of the other axes of the robot as sent, by name.
        """
        signals = self._conditions.signals(k * self.interval_s, others) if self._conditions else ()
        if self._conditions and k % self._follows_every == 0:
            values = AxisModel(self._model.drive, self._given, ()).nominal
            self._drive.set(dict(self._conditions.followed(signals, values)))
        torque = self._command(k)
        reading = Reading(torque, self._moved() + self._noise * self._rng.standard_normal(), signals)
        self._move(torque + self._ripple * self._rng.standard_normal())
        return reading

    def _moved(self) -> float:
        """Measured motion: the angle, the speed, or its mean since the last sample."""
        if self._output == "angle":
            return self._drive.angle
        way, self._angle_before = self._drive.angle - self._angle_before, self._drive.angle
        return way / self.interval_s if self._averaged else self._drive.speed

    def _command(self, k: int) -> float:
        """PD control around a slow swing, and the test signal."""
        motion, angle = self._motion, self._drive.angle
        wanted = _SWING * math.sin(2 * math.pi * k * self.interval_s / _SWING_PERIOD_S)
        test = self._test_signal[k % len(self._test_signal)]
        held = motion.kp * (wanted - angle) - motion.kd * self._drive.speed + motion.holding(angle)
        return float(held + test)

    def _move(self, torque: float) -> None:
        """Move over one interval: the previous torque acts until the delay is over."""
        if self._delay_s > 0:
            self._drive.step(self._torque_before, self._delay_s)
        if self._delay_s < self.interval_s:
            self._drive.step(torque, self.interval_s - self._delay_s)
        self._torque_before = torque


def _band(interval_s: float) -> tuple[float, float]:
    """The band of the test signal, below the Nyquist frequency of slow samples."""
    return BAND_HZ[0], min(BAND_HZ[1], 0.4 / interval_s)


def lines_of_motion(interval_s: float) -> Floats:
    """The frequencies of the test signal [rad/s]."""
    low, high = (round(end * PERIOD_S) for end in _band(interval_s))
    return np.asarray(2 * np.pi / PERIOD_S * np.arange(max(low, 1), high + 1), dtype=float)
