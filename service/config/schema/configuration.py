"""Schema of the configuration: every key with unit, bounds and default.

Keys of signals, buses, model and links have files of their own: signal_keys.py, bus_keys.py, and so on.
Attributes have the names of the TOML keys.  Units are SI; torque, angle and speed are those of the motor.  The
docstring of a key is shown to the user with mistakes in it.
"""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from monitor_core.drive import Output
from monitor_core.monitoring import DEFAULT_MEMORY_S, MIN_MEMORY_SAMPLES
from service.config.schema.base_table import (
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
from service.config.schema.bus_keys import BusConfig
from service.config.schema.canopen_axis import CanopenConfig
from service.config.schema.link_keys import LinksConfig
from service.config.schema.model_keys import (
    AlarmsConfig,
    DetectorConfig,
    EstimatorConfig,
    ModelConfig,
    TrendConfig,
)
from service.config.schema.robot_defaults import completed
from service.config.schema.signal_keys import (
    AngleConfig,
    FurtherSignalConfig,
    GateConfig,
    SpeedConfig,
    ThermalConfig,
    TimeConfig,
    TorqueConfig,
)


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


NEVER_IDENTIFIED = {"kT", GEAR_RATIO}
"""Torque constant and gear ratio of a library drive, which torque and motion of the motor do not determine."""
_TOGETHER = 0.01
"""Largest relative difference between the sample intervals of axes that are sampled together"""


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
