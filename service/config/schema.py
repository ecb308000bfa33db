"""Schema of the configuration: every key with unit, bounds and default.  Keys of the model: see schema_model.py.

Attributes have the names of the TOML keys.  Units are SI; torque, angle and speed are those of the motor.  The
docstring of a key is shown to the user with mistakes in it.
"""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from monitor_core.drive import Output, ThermalStart, Unwatched
from monitor_core.monitoring import DEFAULT_MEMORY_S, MIN_MEMORY_SAMPLES
from service.config.base_table import (
    GEAR_RATIO,
    FilePath,
    NonEmptyText,
    NonZero,
    NotNegative,
    PlainName,
    Positive,
    Real,
    TomlTable,
    Undecidable,
    written,
)
from service.config.canopen_axis import CanopenConfig
from service.config.robot_defaults import completed
from service.config.schema_links import LinksConfig
from service.config.schema_model import (
    AlarmsConfig,
    DetectorConfig,
    EstimatorConfig,
    ModelConfig,
    TrendConfig,
)

# --- The samples of an axis: signals, their time, gates ---------------------------------------------------------------


MOST_LATE = 10
"""Largest number of samples by which the torque may come later than the motion."""
NEVER_IDENTIFIED = {"kT", GEAR_RATIO}
"""Torque constant and gear ratio of a library drive, which torque and motion of the motor do not determine."""


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
    late_samples: int = Field(0, ge=0, le=MOST_LATE, strict=True)
    """number of samples by which the signal comes later than the motion that it has caused"""

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


# --- Service, buses, robots, axes -------------------------------------------------------------------------------------


class ServiceConfig(TomlTable):
    """[service]: the state directory, history and recordings of the daemon."""

    state_dir: FilePath = Field(Path("state"), validate_default=True)
    """folder of the alarm journal and the checkpoints, relative to the configuration file; default under systemd: its
    StateDirectory"""
    block_s: Real | None = Field(None, ge=0.01, le=1.0)
    """time in which frames are collected before estimates follow them [s]; default: 30 sample intervals of the fastest
    axis, 0.03 to 0.1; a block that takes long is followed by a longer one, up to 0.5"""
    checkpoint_interval_s: Positive = Field(60.0, le=86400)
    """time between checkpoints [s]"""
    history_interval_s: Positive = Field(10.0, le=3600)
    """time between points of the history [s]"""
    history_raw_days: Positive = Field(7.0, le=36500)
    """age of the points of the history [days]"""
    history_minute_days: Positive = Field(60.0, le=36500)
    """age of the history's minutes [days]"""
    history_hour_days: Positive = Field(730.0, le=36500)
    """age of the history's hours [days]"""
    history_day_days: Positive = Field(3650.0, le=36500)
    """age of the history's days [days]"""
    history_mb: Real = Field(1000.0, ge=1)
    """largest size of the history file; the oldest part is removed [MB]"""
    recording_before_s: Positive = Field(120.0, le=3600)
    """time before an alarm for which raw frames are recorded; they are kept in memory until then [s]"""
    recording_after_s: Positive = Field(30.0, le=3600)
    """time after an alarm for which raw frames are recorded [s]"""
    recording_format: Literal["log", "blf"] = "log"
    """format of the recorded frames around alarms: "log" (candump), or "blf" (Vector's tools)"""
    recordings_mb: Real = Field(500.0, ge=0)
    """largest size of all recordings; the oldest are removed; 0: no recordings [MB]"""


_HOST = r"[A-Za-z0-9._-]+|[0-9A-Fa-f.]*(?::[0-9A-Fa-f.]*){2,}"
"""A name, an IPv4 address, or an IPv6 address (with two colons or more)."""
Host = Annotated[NonEmptyText, written(_HOST, "a name or an address, without port, brackets or path")]


class WebConfig(TomlTable):
    """[web]: address and TLS of the REST API, the metrics and the page."""

    host: NonEmptyText = "127.0.0.1"
    """address to listen on; any but 127.0.0.1, such as 0.0.0.0 for all interfaces, needs tokens and TLS"""
    port: Annotated[int, Field(strict=True)] = Field(8080, ge=0, le=65535)
    """TCP port; 0 for any free one"""
    hosts: tuple[Host, ...] = ()
    """further names and addresses of the daemon in requests, besides host and localhost, without a port"""
    certificate: FilePath | None = None
    """PEM file of the certificate for TLS, with the chain up to the root, relative to the configuration file"""
    key: FilePath | None = None
    """PEM file of the private key of the certificate, without a password"""
    open_metrics: bool = Field(False, strict=True)
    """/metrics needs no token"""


MAX_BYTES = 64
"""Data bytes of the longest frame"""
LAST_STANDARD_ID, _LAST_ID = 0x7FF, 0x1FFFFFFF
_LAST_PGN = 0x3FFFF
FLOAT_BITS = (16, 32, 64)


class BitsConfig(TomlTable):
    """[[bus.message.signal]]: a signal by its bits."""

    name: NonEmptyText
    """name of the signal"""
    start_bit: Annotated[int, Field(strict=True)] = Field(ge=0, lt=8 * MAX_BYTES)
    """lowest bit, or highest bit in big endian: 8 * byte + bit, both from 0; bit 0 is the lowest of a byte"""
    length: Annotated[int, Field(strict=True)] = Field(ge=1, le=64)
    """number of bits"""
    kind: Literal["unsigned", "signed", "float"] = "unsigned"
    """kind of number: "unsigned", "signed" or "float" (16, 32 or 64 bits)"""
    byte_order: Literal["little", "big"] = "little"
    """"little": lowest byte first (Intel); "big": highest byte first (Motorola)"""
    factor: NonZero = 1.0
    """value = factor * number + offset"""
    offset: Real = 0.0
    """value = factor * number + offset"""


class MessageConfig(TomlTable):
    """[[bus.message]]: a message by its identifier."""

    name: NonEmptyText
    """name by which axes refer to the message"""
    id: Annotated[int, Field(strict=True)] | None = Field(None, ge=0, le=_LAST_ID)
    """identifier, such as 0x181; or pgn"""
    pgn: Annotated[int, Field(strict=True)] | None = Field(None, ge=0, le=_LAST_PGN)
    """parameter group number of J1939, such as 0xFF31: any priority, and any source address unless it is given"""
    source_address: Annotated[int, Field(strict=True)] | None = Field(None, ge=0, le=0xFF)
    """with pgn: source address of the drive"""
    extended: Annotated[bool, Field(strict=True)] | None = None
    """whether the identifier has 29 bits; default: if it is above 0x7FF"""
    signal: tuple[BitsConfig, ...] = Field(min_length=1)
    """its signals, [[bus.message.signal]]"""

    @property
    def is_extended(self) -> bool:
        """Whether its identifier has 29 bits."""
        if self.extended is None:
            return self.id is None or self.id > LAST_STANDARD_ID
        return self.extended


class BusConfig(TomlTable):
    """[[bus]]: one CAN bus."""

    name: PlainName
    """name by which axes refer to the bus: letters, digits, - and _"""
    interface: NonEmptyText = "socketcan"
    """python-can interface: socketcan, virtual, pcan, ..."""
    channel: NonEmptyText
    """channel of that interface, e.g. can0"""
    messages: FilePath | None = None
    """file that describes the messages on the bus: .dbc, .kcd, .sym or .arxml, relative to this file"""
    message: tuple[MessageConfig, ...] = ()
    """messages that no file describes, [[bus.message]]"""
    queue_frames: Annotated[int, Field(strict=True)] = Field(100_000, ge=100, le=10_000_000)
    """most frames that wait for the worker; further ones are dropped"""
    options: dict[str, Any] = Field(default_factory=dict)
    """passed to python-can as they are: bitrate, fd, ..."""


_TOGETHER = 0.01
"""Between the sample intervals of axes that are sampled together."""


class AxisConfig(TomlTable):
    """[[robot.axis]]: one axis, the source of its samples and its monitoring."""

    name: PlainName
    """name of the axis: letters, digits, - and _"""
    bus: NonEmptyText = ""
    """name of a [[bus]]; default: the only one"""
    canopen: CanopenConfig | None = None
    """its drive is a CANopen drive (CiA 402), [robot.axis.canopen]: torque and motion follow from the EDS"""
    sample_interval_s: Positive = Field(ge=1e-5, le=1)
    """nominal sample interval [s]"""
    pairing_tolerance_s: Positive = Field(default_factory=lambda known: 0.4 * known["sample_interval_s"])
    """torque and angle (or speed) whose times differ by more than this do not form a sample [s]"""
    max_gap_s: Positive = Field(default_factory=lambda known: 10 * known["sample_interval_s"])
    """a longer interval restarts the predictor [s]"""
    settling_time_s: Annotated[Real, Field(ge=0)] | None = None
    """no estimation for this time after a restart [s]; default from the model"""
    torque_delay_s: Real = Field(0.0, ge=0)
    """delay of the torque after its sample [s], at most one interval"""
    torque: TorqueConfig
    """motor torque; factor and offset convert it to N m, or, with kT_Nm_per_A, to A"""
    angle: AngleConfig | None = None
    """motor angle; factor and offset convert it to rad"""
    speed: SpeedConfig | None = None
    """motor speed; factor and offset convert it to rad/s"""
    coupling: dict[NonEmptyText, NonZero] = Field(default_factory=dict)
    """motor motion = its angle (or speed), which is that of the arm, + sum of factor * that of each axis named here; in
    place of an axis, also the name of a signal"""
    time: TimeConfig = Field(default_factory=TimeConfig)
    """time of the samples"""
    signal: tuple[FurtherSignalConfig, ...] = ()
    """further signals: temperature, mode, angle of another axis, ..., [[robot.axis.signal]]"""
    gate: tuple[GateConfig, ...] = ()
    """the axis is monitored only while all of these are open, [[robot.axis.gate]]"""
    min_speed: NotNegative | None = None
    """the axis is not monitored while its motor turns more slowly than this [rad/s]; default: from the nominal file"""
    thermal: ThermalConfig = Field(default_factory=ThermalConfig)
    """warm-up without a thermometer"""
    model: ModelConfig
    """drive, nominal values and monitored parameters"""
    estimator: EstimatorConfig = Field(default_factory=EstimatorConfig)
    """recursive estimator"""
    detector: DetectorConfig = Field(default_factory=DetectorConfig)
    """change detector"""
    trend: TrendConfig = Field(default_factory=TrendConfig)
    """long-term trend and forecasts"""
    alarms: AlarmsConfig = Field(default_factory=AlarmsConfig)
    """priority of the alarms, and which ones are latched or hidden"""

    @property
    def records_only(self) -> bool:
        """Whether the axis is on no bus: it is not monitored, only identified from tables."""
        return not self.bus

    @property
    def to_be_identified(self) -> bool:
        """Whether its nominal values have not been found yet: only those are given that no record determines."""
        return self.model.nominal_file is None and (self.records_only or not set(self.model.nominal) - NEVER_IDENTIFIED)

    @property
    def forgetting(self) -> float:
        """lambda, per sample."""
        return 1 - self.sample_interval_s / self.memory_s

    @property
    def memory_s(self) -> float:
        """Length of the memory [s]."""
        h = self.sample_interval_s
        return self.estimator.memory_s or max(DEFAULT_MEMORY_S, MIN_MEMORY_SAMPLES * h)

    @property
    def interval_mean(self) -> bool:
        """Whether the output is the mean of the speed over each sample interval."""
        return self.speed is not None and self.speed.interval_mean

    @property
    def motion(self) -> AngleConfig | SpeedConfig:
        """The signal of the angle, or, if that is not measured, of the speed."""
        motion = self.angle or self.speed
        if motion is None:
            raise Undecidable("angle or speed")
        return motion

    def is_sampled_as(self, other: "AxisConfig") -> bool:
        """Whether the samples of both axes come together."""
        return math.isclose(self.sample_interval_s, other.sample_interval_s, rel_tol=_TOGETHER)

    @property
    def output(self) -> Output:
        """The measured motion: "angle" or "speed"."""
        return "angle" if self.motion is self.angle else "speed"


def sources_of(axis: AxisConfig, robot: Iterable[AxisConfig]) -> Iterator[FurtherSignalConfig]:
    """The auxiliary signals of an axis with their sources; a motion of another axis gets the source of that motion."""
    axes = {other.name: other for other in robot}
    for s in axis.signal:
        if s.axis is None:
            yield s
            continue
        other = axes[s.axis].motion
        place = {
            "message": other.message or None,  # without a bus a motion has none
            "signal": other.signal or None,
            "column": other.column if s.column is None else s.column,
            "factor": s.factor * other.factor,
            "offset": s.factor * other.offset + s.offset,
        }
        yield s.model_copy(update=place)


def coupled_of(axis: AxisConfig, robot: Iterable[AxisConfig]) -> Iterator[FurtherSignalConfig]:
    """What is added to the motion of an axis to make that of its motor, with sources: factor * motion of another axis.

    A name in ``coupling`` is that of an axis of the robot, else that of an auxiliary signal of the axis.
    """
    others = tuple(robot)
    axes, signals = {other.name for other in others}, {s.name: s for s in sources_of(axis, others)}
    for name, factor in axis.coupling.items():
        if name in axes:
            motion = FurtherSignalConfig(name=name, axis=name)
            (source,) = sources_of(axis.model_copy(update={"signal": (motion,)}), others)
        else:
            source = signals[name]
        yield source.model_copy(update={"factor": factor * source.factor, "offset": factor * source.offset})


def angles_of(axis: AxisConfig, robot: Iterable[AxisConfig]) -> Iterator[str]:
    """Names of the auxiliary signals of an axis that are angles of axes of its robot."""
    outputs = {other.name: other.output for other in robot}
    yield from (s.name for s in axis.signal if not s.is_derivative and outputs.get(s.axis or "") == "angle")


class RobotConfig(TomlTable):
    """[[robot]]: a name for a group of axes."""

    name: PlainName
    """name of the robot: letters, digits, - and _"""
    defaults: dict[str, Any] = Field(default_factory=dict)
    """[robot.defaults], keys of all axes of the robot; an axis that has a key of its own keeps it"""
    axis: tuple[AxisConfig, ...] = Field(min_length=1)
    """axes of the robot, [[robot.axis]]"""


class NamedAxis(NamedTuple):
    """An axis with its external name, "robot.axis"."""

    id: str
    robot: str
    config: AxisConfig
    sources: tuple[FurtherSignalConfig, ...] = ()
    """Its auxiliary signals with their sources"""
    angles: tuple[str, ...] = ()
    """Names of those that are angles of axes of its robot"""
    coupled: tuple[FurtherSignalConfig, ...] = ()
    """What is added to its motion to make that of its motor, with sources"""
    epoch: int = 1
    """Number of the epoch of its nominal values and thresholds"""
    configured: bool = True
    """Whether these values are those of the configuration"""


class Config(TomlTable):
    """The whole file."""

    service: ServiceConfig = Field(default_factory=lambda: ServiceConfig.model_validate({}))
    """state directory, history and recordings of the daemon"""
    web: WebConfig = Field(default_factory=WebConfig)
    """address and TLS of API and page"""
    links: LinksConfig = Field(default_factory=LinksConfig)
    """plant links, to which alarms and states are sent"""
    bus: tuple[BusConfig, ...] = ()
    """CAN buses, [[bus]]; without any, axes are only identified from tables"""
    robot: tuple[RobotConfig, ...] = Field(min_length=1)
    """robots, [[robot]]"""

    _completed = model_validator(mode="before")(completed)

    @property
    def block_s(self) -> float:
        """Time in which frames are collected [s]; as each block costs the same, it should have some samples."""
        if self.service.block_s is not None:
            return self.service.block_s
        return min(max(0.03, 30 * min(axis.config.sample_interval_s for axis in self.axes)), 0.1)

    @property
    def axes(self) -> tuple[NamedAxis, ...]:
        """All axes in the order of the file."""
        return tuple(
            NamedAxis(
                f"{robot.name}.{axis.name}",
                robot.name,
                axis,
                tuple(sources_of(axis, robot.axis)),
                tuple(angles_of(axis, robot.axis)),
                tuple(coupled_of(axis, robot.axis)),
            )
            for robot in self.robot
            for axis in robot.axis
        )
