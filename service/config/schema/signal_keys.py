"""Schema of the samples of an axis: signals, their time, gates, warm-up; see configuration.py."""

import math
from typing import Literal

from pydantic import Field

from monitor_core.drive import ThermalStart, Unwatched
from service.config.schema.base_table import NonEmptyText, NonZero, NotNegative, PlainName, Positive, Real, TomlTable

MOST_LATE = 10
"""Largest number of samples by which the torque may come later than the motion."""


class SignalConfig(TomlTable):
    """[robot.axis.angle], .speed, .torque: source of a quantity; without a bus only ``column`` is given."""

    message: NonEmptyText = ""
    """name of the message on the bus"""
    signal: NonEmptyText = ""
    """name of the signal in that message"""
    factor: NonZero = 1.0
    """SI value = factor * signal + offset; a negative factor reverses the direction"""
    offset: Real = 0.0
    """SI value = factor * signal + offset"""
    column: NonEmptyText | None = None
    """column (.csv, .parquet) or variable (.mat) in records"""

    @property
    def scale(self) -> tuple[float, float]:
        """Factor and offset to the SI value."""
        return self.factor, self.offset


class TorqueConfig(SignalConfig):
    """[robot.axis.torque]: the motor torque."""

    kT_Nm_per_A: Real | None = None
    """torque constant, if the signal is the motor current: torque = kT * (factor * signal + offset) [N m/A]"""
    late_samples: Real = Field(0.0, ge=0, le=MOST_LATE, multiple_of=0.5)
    """number of samples by which the signal comes later than a torque that acts from the sample on: 0.5 if it is the
    torque at the sample, which the drive changes many times before the next one; more for a filtered current"""

    @property
    def scale(self) -> tuple[float, float]:
        """Factor and offset to N m."""
        kT = 1.0 if self.kT_Nm_per_A is None else self.kT_Nm_per_A
        return kT * self.factor, kT * self.offset


class AngleConfig(SignalConfig):
    """[robot.axis.angle]: the motor angle."""

    wrap_period: Positive | None = None
    """period after which the signal wraps, in its own unit, before the factor: 360, 65536, 6.2831853"""
    resolution: Positive | None = None
    """step of the encoder, in the unit of the signal, before the factor; gives a default of output_noise"""

    def wraps_after_a_turn(self, ratio: float) -> bool:
        """Whether the angle wraps after a whole turn of the arm with this gear ratio, as that of a turntable does."""
        if self.wrap_period is None:
            return False
        turn = abs(self.factor * ratio) * self.wrap_period
        return math.isclose(turn, 2 * math.pi, rel_tol=1e-3)


class SpeedConfig(SignalConfig):
    """[robot.axis.speed]: the motor speed."""

    interval_mean: bool = Field(False, strict=True)
    """the drive sends the mean of the speed over each sample interval, not the speed at the sample"""
    resolution: Positive | None = None
    """step of the encoder, in the unit of the signal, before the factor; gives a default of output_noise"""


class FurtherSignalConfig(TomlTable):
    """[[robot.axis.signal]]: an auxiliary signal of the axis or of the robot, or the motion of another axis."""

    name: PlainName
    """name by which the configuration refers to it: letters, digits, - and _"""
    axis: NonEmptyText | None = None
    """it is the angle (or speed) of this other axis of the robot, in place of a message"""
    speed: bool = False
    """it is the speed of that axis [rad/s], taken from its angle; that axis may be this one"""
    acceleration: bool = False
    """it is the acceleration of that axis [rad/s^2], from values that come with the samples of this axis"""
    message: NonEmptyText | None = None
    """name of the message on the bus"""
    signal: NonEmptyText | None = None
    """name of the signal in that message"""
    column: NonEmptyText | None = None
    """column (.csv, .parquet) or variable (.mat) in records"""
    factor: NonZero = 1.0
    """value = factor * signal + offset"""
    offset: Real = 0.0
    """value = factor * signal + offset"""
    max_age_s: Positive = 10.0
    """a value received longer ago than this is not used any more [s]"""

    @property
    def scale(self) -> tuple[float, float]:
        """Factor and offset to its own unit."""
        return self.factor, self.offset

    @property
    def is_derivative(self) -> bool:
        """Whether it is the speed or the acceleration to an angle."""
        return self.speed or self.acceleration


class GateConfig(TomlTable):
    """[[robot.axis.gate]]: a condition for learning; the signal is one of [[robot.axis.signal]]."""

    signal: NonEmptyText
    """name of a signal; estimates and tests wait while it has another value"""
    equals: tuple[Real, ...] | None = Field(None, min_length=1)
    """open while the signal is one of these"""
    above: Real | None = None
    """open while the signal is greater than this"""
    below: Real | None = None
    """open while the signal is less than this"""
    settle_s: NotNegative = 0.0
    """stays closed for this time after the signal has the right value again [s]"""


class TimeConfig(TomlTable):
    """[robot.axis.time]: source of the time of a sample."""

    column: NonEmptyText | None = None
    """column of the time in records; without it rows are sample_interval_s apart"""
    factor: Positive = 1.0
    """seconds = factor * column: 0.001 for milliseconds"""
    counter_message: NonEmptyText | None = None
    """message that carries the sample counter; if not given, that of angle or speed"""
    counter_signal: NonEmptyText | None = None
    """sample counter; with it sample times are whole intervals, free of receipt jitter"""
    clock: Literal["receipt", "cyclic"] = "receipt"
    """without a counter: "receipt", the times of receipt, or "cyclic": the controller samples every sample_interval_s
    by its own clock, which is fitted to the times of receipt"""


class ThermalConfig(TomlTable):
    """[robot.axis.thermal]: warm-up of an axis whose friction follows its heat, without thermometer (nominal_file)."""

    start: ThermalStart = "unknown"
    """how warm the axis is at a start without a checkpoint: "unknown" (friction is not tested until the first motion
    has shown it), or "cold" """
    unwatched: Unwatched = "unknown"
    """motion of the axis while the daemon did not run: "unknown" (its heat is less certain the longer that was), or
    "stood" (the robot never works without the daemon)"""
