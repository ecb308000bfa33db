"""Every key of the configuration file, with its unit, its bounds and its default.

Attributes have the names of the TOML keys.  SI units; torque, angle and speed are those of the motor.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from monitor_core.model import Output
from service.config.sources import Source, sources_of
from service.config.tables import ABSENT, Absent, Reading, Table, present
from service.durations import seconds_in
from service.modeling import SUFFIX

Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
Text = Annotated[str, Field(min_length=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]


def _from_folder(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str | Path) or value == "" or "\0" in str(value):
        raise ValueError("must be a path in quotes")
    return info.context.folder / value if isinstance(info.context, Reading) else value


FilePath = Annotated[Path, BeforeValidator(_from_folder)]


def _drive_from_folder(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str) or not value.endswith(SUFFIX):
        return value
    return str(_from_folder(value, info))


DriveName = Annotated[str, BeforeValidator(_drive_from_folder), Field(min_length=1)]
"""A name of the library, or a Modelica file relative to the folder of the configuration."""


def _intervals(count: float) -> Callable[[dict[str, Any]], Any]:
    """A default of so many sample intervals."""

    def default(validated: dict[str, Any]) -> Any:
        interval = validated["sample_interval_s"]
        return ABSENT if interval is ABSENT else count * interval

    return default


class ServiceConfig(Table):
    """[service]: what the daemon keeps."""

    state_dir: FilePath = Field(
        Path("state"),
        validate_default=True,
        description="folder of the alarm journal and the checkpoints, relative to the configuration file",
    )
    checkpoint_interval_s: Positive = Field(60.0, le=86400, description="time between checkpoints [s]")
    history_interval_s: Positive = Field(1.0, le=3600, description="time between points of the history [s]")
    history_length_s: Positive = Field(
        3600.0, le=604800, description="length of the history kept in memory [s]"
    )


class WebConfig(Table):
    """[web]: where REST, metrics and the page are served."""

    host: Text = Field("127.0.0.1", description="address to listen on; 0.0.0.0 for all interfaces")
    port: Annotated[int, Field(strict=True)] = Field(
        8080, ge=0, le=65535, description="TCP port; 0 for any free one"
    )


class BusConfig(Table):
    """[[bus]]: one CAN bus."""

    name: Name = Field(description="name by which axes refer to the bus: letters, digits, - and _")
    interface: Text = Field("socketcan", description="python-can interface: socketcan, virtual, pcan, ...")
    channel: Text = Field(description="channel of that interface, e.g. can0")
    dbc: FilePath = Field(description="DBC file of the messages on the bus, relative to this file")
    queue_frames: Annotated[int, Field(strict=True)] = Field(
        100_000,
        ge=100,
        le=10_000_000,
        description="frames that may wait for the worker before some are dropped",
    )
    options: dict[str, Any] = Field(
        default_factory=dict, description="passed to python-can as they are: bitrate, fd, ..."
    )


class SignalConfig(Table):
    """[robot.axis.torque], .angle, .speed: where a quantity comes from; without a bus only ``column`` is given."""

    message: Text = Field("", description="name of the message in the DBC")
    signal: Text = Field("", description="name of the signal in that message")
    factor: Real = Field(1.0, description="SI value = factor * signal + offset; negative turns the direction")
    offset: Real = Field(0.0, description="SI value = factor * signal + offset")
    column: Text | None = Field(None, description="column (.csv, .parquet) or variable (.mat) in records")


_RESOLUTION = (
    "step of the encoder, in the unit of the signal, before the factor; gives a default of output_noise"
)


class AngleConfig(SignalConfig):
    """[robot.axis.angle]: the motor angle."""

    wraps_at: Positive | None = Field(
        None,
        description="the signal starts again after so much, in its own unit, before the factor: 360, 65536, 6.2831853",
    )
    resolution: Positive | None = Field(None, description=_RESOLUTION)


class SpeedConfig(SignalConfig):
    """[robot.axis.speed]: the motor speed."""

    averaged: bool = Field(
        False,
        strict=True,
        description="the drive sends the mean of the speed over each sample interval, not the speed at the sample",
    )
    resolution: Positive | None = Field(None, description=_RESOLUTION)


class FurtherConfig(Table):
    """[[robot.axis.signal]]: a further signal beside torque and motion: of the axis, of another one, of the robot."""

    name: Name = Field(description="name by which the configuration refers to it: letters, digits, - and _")
    axis: Text | None = Field(
        None, description="it is the angle (or speed) of this other axis of the robot, in place of a message"
    )
    message: Text | None = Field(None, description="name of the message in the DBC")
    signal: Text | None = Field(None, description="name of the signal in that message")
    column: Text | None = Field(None, description="column (.csv, .parquet) or variable (.mat) in records")
    factor: Real = Field(1.0, description="value = factor * signal + offset")
    offset: Real = Field(0.0, description="value = factor * signal + offset")
    maximum_age_s: Positive = Field(
        10.0, description="a value received longer ago than this is no longer believed [s]"
    )


class GateConfig(Table):
    """[[robot.axis.gate]]: when the axis may be watched; the signal is one of [[robot.axis.signal]]."""

    signal: Text = Field(description="name of a signal; estimates and tests wait while it has another value")
    equals: tuple[Real, ...] | None = Field(
        None, min_length=1, description="open while the signal is one of these"
    )
    above: Real | None = Field(None, description="open while the signal is greater than this")
    below: Real | None = Field(None, description="open while the signal is less than this")


class TimeConfig(Table):
    """[robot.axis.time]: where the time of a sample comes from."""

    column: Text | None = Field(
        None, description="column of the time [s] in records; without it rows are sample_interval_s apart"
    )
    counter_message: Text | None = Field(None, description="message that carries the sample counter")
    counter_signal: Text | None = Field(
        None, description="sample counter; with it sample times are whole intervals, free of receipt jitter"
    )
    clock: Literal["receipt", "cyclic"] = Field(
        "receipt",
        description='without a counter: "receipt", the times of receipt, or "cyclic", the controller sends every'
        " sample_interval_s by its own clock, which is fitted to them",
    )


class VaryingConfig(Table):
    """[[robot.axis.model.varying]]: nominal value = that of the model + slope * (signal - reference)."""

    parameter: Text = Field(description='a monitored parameter, or its reciprocal: "fm", "Ja"')
    signal: Text = Field(
        description="a signal of [[robot.axis.signal]], or cos, sin or square of one: cos(angle2)"
    )
    slope: Real = Field(description="change of the parameter for each unit of the signal, in its SI unit")
    reference: Real = Field(description="where the signal is when the parameter has the value of the model")
    range: tuple[Real, Real] | None = Field(
        None, description="[lowest, highest] of the signal; a tenth of it beyond, nothing is estimated"
    )


def _one_or_two(value: object) -> object:
    return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value


Limits = Annotated[tuple[Real, ...], BeforeValidator(_one_or_two), Field(min_length=1, max_length=2)]
"""A limit, above or below the nominal value, or [lower, upper]."""


class ModelConfig(Table):
    """[robot.axis.model]: the drive, its nominal values, and what is watched."""

    drive: DriveName = Field(
        "three-mass", description='name of a drive that comes with the program, or a file "....mo"'
    )
    drive_model: Text | None = Field(None, description="which model, of a Modelica file with more than one")
    components: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="the drive drawn here, in place of one by name: name = { type, at, ... }",
    )
    monitor: tuple[Text, ...] = Field(
        min_length=1, description='parameters to estimate, e.g. ["kT", "1/Ja", "fm"]'
    )
    friction_speed_scale: Positive = Field(
        1.0, description="Coulomb friction is fc tanh(speed at its flange / friction_speed_scale) [rad/s]"
    )
    nominal: dict[str, Real] = Field(
        default_factory=dict,
        description="value of every parameter of the drive, SI; goes before a drawing's own",
    )
    nominal_file: FilePath | None = Field(
        None,
        description="what `axiswatch identify` wrote: nominal values with their gain; relative to this file",
    )
    thresholds_file: FilePath | None = Field(
        None,
        description="what `axiswatch calibrate` wrote: thresholds of the tests; relative to this file",
    )
    scales: dict[str, Positive] = Field(
        default_factory=dict, description="size of a monitored parameter, where |nominal| is not it"
    )
    bounds: dict[str, tuple[Real, Real]] = Field(
        default_factory=dict, description="name = [lower, upper]: the estimate stays between them"
    )
    limits: dict[str, Limits] = Field(
        default_factory=dict,
        description="name = limit, or [lower, upper], of a monitored parameter or its reciprocal: when it will be"
        " reached is foretold",
    )
    varying: tuple[VaryingConfig, ...] = Field(
        (), description="nominal values that follow signals, beside those of the nominal_file"
    )
    conditions: Literal["followed", "gated", "others stand still"] | None = Field(
        None,
        description="how the pose of the other axes, payload and temperature are dealt with: nominal values follow"
        " them, gates keep them the same, or they do not change",
    )


def _none_or_three(value: float) -> float:
    if value != 0 and value < 3:  # noise alone is there often
        raise ValueError("must be 0 or at least 3")
    return value


DEFAULT_MEMORY_S = 1.0
FEWEST_SAMPLES = 10
"""In a memory."""


class EstimatorConfig(Table):
    """[robot.axis.estimator]: the recursive prediction error method."""

    predictor: Literal["innovations", "output-error"] = Field(
        "innovations", description='"innovations" (Kalman gain) or "output-error" (the paper; speed only)'
    )
    memory_s: Positive | None = Field(
        None, description="memory of the estimates [s]: older samples count little; default 1 s"
    )
    forgetting: Real | None = Field(
        None,
        gt=0.5,
        lt=1,
        description="in place of memory_s: lambda per sample, memory is 1/(1 - lambda) samples",
    )
    least_information: Real = Field(
        0.05,
        ge=0,
        le=0.5,
        description="share of the information at commissioning that is never forgotten; 0: the paper's, without",
    )
    least_excitation: Real = Field(
        0.05,
        ge=0,
        le=0.5,
        description="share of the usual excitation below which nothing is estimated; 0: the paper's, always",
    )
    outlier_limit: Annotated[Real, AfterValidator(_none_or_three)] = Field(
        6.0,
        le=1000,
        description="an innovation beyond so many standard deviations is passed over, if few are; 0: none is",
    )
    joint_state: bool | None = Field(
        None,
        strict=True,
        description="the state moves with the estimates, as in a joint Kalman filter; by default where the memory is"
        " short: below 2.5 slowest time constants of the predictor",
    )
    random_walk: bool = Field(
        False,
        strict=True,
        description="parameters are followed as a random walk, each for itself, as in a Kalman filter: for many",
    )
    torque_noise: Positive | None = Field(
        None, description="standard deviation of the torque per sample [N m], for the Kalman gain"
    )
    output_noise: Positive | None = Field(
        None, description="standard deviation of the measured angle [rad] or speed [rad/s]"
    )
    speed_noise: Positive | None = Field(
        None,
        description="standard deviation of the measured speed [rad/s] beside an angle, whose is output_noise then",
    )
    innovation_variance: Positive | None = Field(
        None, description="lambda_0 [rad^2 or (rad/s)^2]; default from the noises"
    )
    gain: tuple[Real, ...] = Field(
        (), description="filter gain K, one number per state; default from the noises"
    )
    initial_p: dict[str, Positive] = Field(
        default_factory=dict, description="diagonal of P(0) by parameter; default from the first samples"
    )


class DetectorConfig(Table):
    """[robot.axis.detector]: which detector alarms, and the CUSUM tests."""

    kind: Literal["bank", "cusum"] | None = Field(
        None,
        description='whose alarms count: "bank" (hypotheses) or "cusum" (the paper\'s); default the bank where the'
        " thresholds_file has thresholds for it",
    )
    beside: bool = Field(
        True, strict=True, description="the bank runs beside the CUSUM tests where these alarm, and looks on"
    )
    budget_s: Real = Field(
        31557600.0,
        ge=60,
        description="mean time between false alarms [s] that the bank's threshold guarantees for an exact model, where"
        " it has none from a thresholds_file",
    )
    alpha_1: Real = Field(3.0, ge=0, description="drift nu = alpha_1 standard deviations")
    alpha_2: Positive = Field(20.0, description="threshold h = alpha_2 times the size of the parameter")
    widening: Real = Field(
        0.0,
        ge=0,
        le=1e6,
        description="after an alarm P_ii is at least so many times P(0)_ii: the estimate converges faster; 0: it stays",
    )


def _time(value: object) -> object:
    if not isinstance(value, str):
        raise ValueError('must be a time in quotes, such as "14 days"')
    return seconds_in(value)


class TrendConfig(Table):
    """[robot.axis.trend]: the slow course of the parameters, and forecasts."""

    interval_s: Positive = Field(
        3600.0,
        le=86400,
        description="operating time [s] of one mean of the slow history; forecasts need 120 times as long",
    )
    warn_before: Annotated[Positive, BeforeValidator(_time)] = Field(
        "14 days",
        validate_default=True,
        description='an alarm is raised when a limit may be reached within this time, such as "14 days"',
    )


class AxisConfig(Table):
    """[[robot.axis]]: one axis, where its samples come from and how they are watched."""

    name: Name = Field(description="name of the axis: letters, digits, - and _")
    bus: Text = Field("", description="name of a [[bus]]")
    sample_interval_s: Positive = Field(ge=1e-5, le=1, description="nominal sample interval [s]")
    pairing_tolerance_s: Positive = Field(
        default_factory=_intervals(0.4),
        description="torque and angle (or speed) further apart than this are no sample [s]",
    )
    maximum_gap_s: Positive = Field(
        default_factory=_intervals(10), description="a longer interval starts the predictor afresh [s]"
    )
    settling_time_s: Annotated[Real, Field(ge=0)] | None = Field(
        None, description="no estimation for so long after such a start [s]; default from the model"
    )
    torque_delay_s: Real = Field(
        0.0, ge=0, description="torque acts so much later than its sample [s], at most one interval"
    )
    torque: SignalConfig = Field(description="motor torque; factor and offset make it N m")
    angle: AngleConfig | None = Field(None, description="motor angle; factor and offset make it rad")
    speed: SpeedConfig | None = Field(None, description="motor speed; factor and offset make it rad/s")
    time: TimeConfig = Field(default_factory=TimeConfig, description="time of the samples")
    signal: tuple[FurtherConfig, ...] = Field(
        (),
        description="further signals: temperature, mode, angle of another axis, ..., [[robot.axis.signal]]",
    )
    gate: tuple[GateConfig, ...] = Field(
        (), description="the axis is watched only while all of these are open, [[robot.axis.gate]]"
    )
    least_speed: Positive | None = Field(
        None, description="the axis is not watched while its motor turns more slowly than this [rad/s]"
    )
    model: ModelConfig = Field(description="drive, nominal values and monitored parameters")
    estimator: EstimatorConfig = Field(default_factory=EstimatorConfig, description="recursive estimator")
    detector: DetectorConfig = Field(default_factory=DetectorConfig, description="change detector")
    trend: TrendConfig = Field(default_factory=TrendConfig, description="slow course and forecasts")

    @property
    def records_only(self) -> bool:
        """It is on no bus: nobody watches it, it is only to be identified from tables."""
        return not self.bus

    @property
    def forgetting(self) -> float:
        """lambda, per sample."""
        e = self.estimator
        if e.forgetting is not None:
            return e.forgetting
        memory = e.memory_s or max(DEFAULT_MEMORY_S, FEWEST_SAMPLES * self.sample_interval_s)
        return 1 - self.sample_interval_s / memory

    @property
    def averaged(self) -> bool:
        """The output is the mean of the speed over each interval, as the drive takes it."""
        speed = self.speed if present(self, "speed") else None
        return speed is not None and present(speed, "averaged") and speed.averaged and not self.both

    @property
    def both(self) -> bool:
        """Angle and speed are measured, and used together."""
        return present(self, "angle", "speed") and self.angle is not None and self.speed is not None

    @property
    def second(self) -> SpeedConfig | None:
        """The signal of the speed beside an angle."""
        return self.speed if self.both else None

    @property
    def with_one_output(self) -> "AxisConfig":
        """The axis without the speed beside its angle."""
        return self.model_copy(update={"speed": None}) if self.both else self

    @property
    def motion(self) -> AngleConfig | SpeedConfig:
        """The signal of the angle, or, where that is not measured, of the speed."""
        given = [signal for signal in (self.angle, self.speed) if signal is not None]
        if not given:
            raise Absent("angle or speed")
        return given[0]

    @property
    def output(self) -> Output:
        """What is measured besides torque; with angle and speed it is the angle, and the speed is ``second``."""
        return "angle" if self.motion is self.angle else "speed"


class RobotConfig(Table):
    """[[robot]]: a name for a group of axes."""

    name: Name = Field(description="name of the robot: letters, digits, - and _")
    axis: tuple[AxisConfig, ...] = Field(min_length=1, description="axes of the robot, [[robot.axis]]")


class NamedAxis(NamedTuple):
    """An axis with the name it has everywhere outside, "robot.axis"."""

    id: str
    robot: str
    config: AxisConfig
    sources: tuple[Source, ...] = ()
    """Its further signals"""


class Config(Table):
    """The whole file."""

    service: ServiceConfig = Field(
        default_factory=lambda: ServiceConfig.model_validate({}), description="what the daemon keeps"
    )
    web: WebConfig = Field(default_factory=WebConfig, description="where it is served")
    bus: tuple[BusConfig, ...] = Field(
        (), description="CAN buses, [[bus]]; without any, axes are only identified from tables"
    )
    robot: tuple[RobotConfig, ...] = Field(min_length=1, description="robots, [[robot]]")

    @property
    def axes(self) -> tuple[NamedAxis, ...]:
        """All axes in the order of the file."""
        return tuple(
            NamedAxis(f"{robot.name}.{axis.name}", robot.name, axis, tuple(sources_of(axis, robot.axis)))
            for robot in self.robot
            for axis in robot.axis
        )
