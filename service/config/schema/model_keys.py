"""Schema of the model and the monitoring of an axis: drive, values, limits, estimator, detectors, trend, alarms."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from monitor_core.monitoring import REOPEN_MEMORIES, AlarmRules, Priority
from monitor_core.wording import seconds_in
from service.config.schema.base_table import (
    DriveName,
    NonEmptyText,
    NotNegative,
    PlainName,
    Positive,
    ReadingContext,
    Real,
    TomlTable,
    from_folder,
)
from service.config.schema.found_file import read_found
from service.config.schema.nominal_file import NominalFile
from service.config.schema.thresholds_file import ThresholdsFile


class ScheduleConfig(TomlTable):
    """[[robot.axis.model.schedule]]: nominal value = value of the model + slope * (signal - reference)."""

    parameter: NonEmptyText
    """a monitored parameter, such as "fm" or "Ja", or its reciprocal"""
    signal: NonEmptyText
    """a signal of [[robot.axis.signal]]; cos, sin or square of a signal or a sum, as in cos(angle2 + angle3); or a
    product, as in payload * cos(angle2)"""
    slope: Real
    """change of the parameter, in its SI unit, for each unit of the signal"""
    reference: Real
    """value of the signal at which the parameter has the value of the model"""
    range: tuple[Real, Real] | None = None
    """[lowest, highest] of the signal; more than a tenth of the range outside, nothing is estimated"""


def _one_or_two(value: object) -> object:
    return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value


Limits = Annotated[tuple[Real, ...], BeforeValidator(_one_or_two), Field(min_length=1, max_length=2)]
"""One limit, above or below the nominal value, or [lower, upper]."""


def _nominal_file(value: object, info: ValidationInfo) -> NominalFile:
    return read_found(NominalFile, from_folder(value, info))


def _thresholds_file(value: object, info: ValidationInfo) -> ThresholdsFile | None:
    if isinstance(info.context, ReadingContext) and not info.context.thresholds:
        return None
    return read_found(ThresholdsFile, from_folder(value, info))


class ModelConfig(TomlTable):
    """[robot.axis.model]: the drive, its nominal values, and the monitored parameters."""

    drive: DriveName = "three-mass"
    """name of a library drive, or of a Modelica file, "....mo" """
    drive_model: NonEmptyText | None = None
    """name of the model, if the Modelica file has more than one"""
    monitor: tuple[NonEmptyText, ...] = Field(min_length=1)
    """parameters to estimate, e.g. ["kT", "1/Ja", "fm"]"""
    friction_speed_scale: Positive = 1.0
    """Coulomb friction is fc tanh(speed at its flange / friction_speed_scale) [rad/s]"""
    nominal: dict[str, Real] = Field(default_factory=dict)
    """value of every parameter of the drive, SI; takes precedence over the drawing's"""
    nominal_file: Annotated[NominalFile | None, BeforeValidator(_nominal_file)] = None
    """what `axiswatch identify` wrote: nominal values with their gain; relative to this file"""
    thresholds_file: Annotated[ThresholdsFile | None, BeforeValidator(_thresholds_file)] = None
    """what `axiswatch calibrate` wrote: thresholds of the tests; relative to this file"""
    scales: dict[str, Positive] = Field(default_factory=dict)
    """size of a monitored parameter, if it is not |nominal|"""
    bounds: dict[str, tuple[Real, Real]] = Field(default_factory=dict)
    """name = [lower, upper]: bounds of the estimate"""
    limits: dict[str, Limits] = Field(default_factory=dict)
    """name = limit, or [lower, upper], of a monitored parameter or its reciprocal; the time at which the trend reaches
    it is forecast"""
    schedule: tuple[ScheduleConfig, ...] = ()
    """nominal values that follow signals, besides those of the nominal_file"""
    conditions: Literal["others stand still"] | None = None
    """pose of the other axes, payload and temperature do not change, so that no parameter follows them"""


REPLACED_BY_NOMINAL_FILE = {
    "model": ("nominal", "friction_speed_scale"),
    "estimator": ("predictor", "torque_noise", "output_noise", "innovation_variance", "initial_p"),
}
REPLACED_BY_THRESHOLDS_FILE = {"detector": ("alpha_1", "alpha_2", "budget_s")}
"""Keys of an axis, by table, that these files replace."""


def _none_or_three(value: float) -> float:
    if value != 0 and value < 3:  # noise alone exceeds it often
        raise ValueError("must be 0 or at least 3")
    return value


class EstimatorConfig(TomlTable):
    """[robot.axis.estimator]: the recursive prediction error method."""

    predictor: Literal["innovations", "output-error"] = "innovations"
    """prediction of the output: "innovations" (Kalman gain) or "output-error" (the paper; speed only)"""
    memory_s: Positive | None = None
    """memory of the estimates [s]: older samples count little; default 1 s"""
    information_floor: Real = Field(0.05, ge=0, le=0.5)
    """share of the information at commissioning that is never forgotten; 0: none, as in the paper"""
    min_excitation: Real = Field(0.05, ge=0, le=0.5)
    """share of the usual excitation below which nothing is estimated; 0: always estimate, as in the paper"""
    outlier_limit: Annotated[Real, AfterValidator(_none_or_three)] = Field(6.0, le=1000)
    """an innovation larger than this number of standard deviations is rejected, if there are few such; 0: never"""
    joint_state: bool | None = Field(None, strict=True)
    """whether the state moves with the estimates, as in a joint Kalman filter; default: if the memory is shorter than
    2.5 times the slowest time constant of the predictor"""
    torque_noise: Positive | None = None
    """standard deviation of the torque per sample [N m], for the Kalman gain"""
    output_noise: Positive | None = None
    """standard deviation of the measured angle [rad] or speed [rad/s]"""
    innovation_variance: Positive | None = None
    """lambda_0 [rad^2 or (rad/s)^2]; default from the noises"""
    initial_p: dict[str, Positive] = Field(default_factory=dict)
    """diagonal of P(0) by parameter; default from the first samples"""


class DetectorConfig(TomlTable):
    """[robot.axis.detector]: the alarm source, and the CUSUM tests."""

    alarm_source: Literal["multimodel", "cusum"] | None = None
    """detector that raises alarms: "multimodel" (parallel hypotheses) or "cusum" (the paper's tests); default:
    multimodel, if the thresholds_file has thresholds for it and nominal values follow no measured signals"""
    shadow: bool = Field(True, strict=True)
    """whether the multi-model detector runs in shadow mode if the CUSUM tests raise the alarms"""
    budget_s: Real = Field(31557600.0, ge=60)
    """mean time between false alarms [s] that the threshold of the multi-model detector guarantees for an exact model;
    used if there is no thresholds_file for it"""
    alpha_1: Real = Field(3.0, ge=0)
    """drift nu = alpha_1 standard deviations"""
    alpha_2: Positive = 20.0
    """threshold h = alpha_2 times the size of the parameter"""
    outside_calibration: Literal["report", "wait", "widen"] = "report"
    """if speed or signals are outside their range in the calibration records: "report" (tests continue, alarms are
    marked; beyond the heat of the records with a wider allowance), "wait" (nothing is tested, nor in the hour after a
    start at an unknown heat), or "widen" (as "report", also with a nominal_file of an earlier version, which has no
    ambient_w); in poses that no record has nothing is tested in any case"""
    covariance_reset: Real = Field(0.0, ge=0, le=1e6)
    """after an alarm P_ii is at least this many times P(0)_ii: faster convergence; 0: P stays"""


def _time(value: object) -> object:
    if not isinstance(value, str):
        raise ValueError('must be a time in quotes, such as "14 days"')
    return seconds_in(value)


class TrendConfig(TomlTable):
    """[robot.axis.trend]: the long-term trend of the parameters, and forecasts."""

    interval_s: Positive = Field(3600.0, le=86400)
    """operating time of each mean in the long-term history [s]; forecasts need 120 times as long"""
    lead_time: Annotated[Positive, BeforeValidator(_time)] = Field("14 days", validate_default=True)
    """an alarm is raised when a limit may be reached within this time: "14 days", for example"""


DEFAULT_OFF_DELAY_S = 60.0
"""The off-delays that ISA-18.2 suggests as first values are up to a minute."""


class AlarmsConfig(TomlTable):
    """[robot.axis.alarms]: priority of the alarms of an axis, and which ones are latched or hidden."""

    priority: Priority = "medium"
    """priority of its alarms: "low", "medium" or "high" """
    priorities: dict[str, Priority] = Field(default_factory=dict)
    """name = priority, of monitored parameters or sensor faults with another priority"""
    latched: tuple[NonEmptyText, ...] = ()
    """parameters or sensor faults whose alarm stays active until it is acknowledged, even if its cause is gone"""
    suppressed: tuple[NonEmptyText, ...] = ()
    """parameters or sensor faults whose alarms are recorded, but not announced"""
    out_of_service: bool = Field(False, strict=True)
    """for maintenance: all alarms of the axis are recorded, but not announced"""
    group: PlainName | None = None
    """name of a group of axes; the first of several alarms in a group is marked; default: the name of the robot"""
    off_delay_s: NotNegative | None = None
    """an alarm returns to normal when its cause has been absent for this time [s]; if the cause is back sooner, that is
    no new alarm"""

    def rules(self, cause: str, memory_s: float) -> AlarmRules:
        """The alarm rules of a parameter or sensor fault of an axis with this memory [s]."""
        off_delay_s = self.off_delay_s
        if off_delay_s is None:
            off_delay_s = min(DEFAULT_OFF_DELAY_S, REOPEN_MEMORIES * memory_s)
        return AlarmRules(
            self.priorities.get(cause, self.priority),
            latched=cause in self.latched,
            suppressed=cause in self.suppressed,
            out_of_service=self.out_of_service,
            off_delay_s=off_delay_s,
        )
