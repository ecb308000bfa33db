"""The keys of the samples of an axis: signals, their time, gates."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.config.base_table import Name, Positive, Real, Table, Text


class SignalConfig(Table):
    """[robot.axis.torque], .angle, .speed: source of a quantity; without a bus only ``column`` is given."""

    message: Text = ""
    """name of the message in the DBC"""
    signal: Text = ""
    """name of the signal in that message"""
    factor: Real = 1.0
    """SI value = factor * signal + offset; negative turns the direction"""
    offset: Real = 0.0
    """SI value = factor * signal + offset"""
    column: Text | None = None
    """column (.csv, .parquet) or variable (.mat) in records"""


class AngleConfig(SignalConfig):
    """[robot.axis.angle]: the motor angle."""

    wrap_period: Positive | None = None
    """period after which the signal wraps, in its own unit, before the factor: 360, 65536, 6.2831853"""
    resolution: Positive | None = None
    """step of the encoder, in the unit of the signal, before the factor; gives a default of output_noise"""


class SpeedConfig(SignalConfig):
    """[robot.axis.speed]: the motor speed."""

    interval_mean: bool = Field(False, strict=True)
    """the drive sends the mean of the speed over each sample interval, not the speed at the sample"""
    resolution: Positive | None = None
    """step of the encoder, in the unit of the signal, before the factor; gives a default of output_noise"""


class FurtherConfig(Table):
    """[[robot.axis.signal]]: an auxiliary signal: of the axis, of another axis, of the robot."""

    name: Name
    """name by which the configuration refers to it: letters, digits, - and _"""
    axis: Text | None = None
    """it is the angle (or speed) of this other axis of the robot, in place of a message"""
    message: Text | None = None
    """name of the message in the DBC"""
    signal: Text | None = None
    """name of the signal in that message"""
    column: Text | None = None
    """column (.csv, .parquet) or variable (.mat) in records"""
    factor: Real = 1.0
    """value = factor * signal + offset"""
    offset: Real = 0.0
    """value = factor * signal + offset"""
    max_age_s: Positive = 10.0
    """a value received longer ago than this is no longer believed [s]"""


Source = FurtherConfig
"""Where an auxiliary signal of an axis comes from; that of another axis has the place of its motion"""


class GateConfig(Table):
    """[[robot.axis.gate]]: a condition for learning; the signal is one of [[robot.axis.signal]]."""

    signal: Text
    """name of a signal; estimates and tests wait while it has another value"""
    equals: tuple[Real, ...] | None = Field(None, min_length=1)
    """open while the signal is one of these"""
    above: Real | None = None
    """open while the signal is greater than this"""
    below: Real | None = None
    """open while the signal is less than this"""


class TimeConfig(Table):
    """[robot.axis.time]: source of the time of a sample."""

    column: Text | None = None
    """column of the time [s] in records; without it rows are sample_interval_s apart"""
    counter_message: Text | None = None
    """message that carries the sample counter"""
    counter_signal: Text | None = None
    """sample counter; with it sample times are whole intervals, free of receipt jitter"""
    clock: Literal["receipt", "cyclic"] = "receipt"
    """without a counter: "receipt", the times of receipt, or "cyclic", the controller sends every sample_interval_s
    by its own clock, which is fitted to them"""
