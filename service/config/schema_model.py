"""The keys of the model of an axis and its monitoring: drive, values, limits; estimator, detectors, trend, alarms."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from monitor_core.monitoring import REOPEN_MEMORIES, AlarmRules, Priority
from monitor_core.wording import seconds_in
from service.config.base_table import (
    DriveName,
    Name,
    NotNegative,
    Positive,
    Reading,
    Real,
    Table,
    Text,
    from_folder,
)
from service.config.found_file import read_found
from service.config.nominal_file import NominalFile
from service.config.thresholds_file import ThresholdsFile


class ScheduleConfig(Table):
    """[[robot.axis.model.schedule]]: nominal value = that of the model + slope * (signal - reference)."""

    parameter: Text
    """a monitored parameter, such as "fm" or "Ja", or its reciprocal"""
    signal: Text
    """a signal of [[robot.axis.signal]]; cos, sin or square of one or of a sum, cos(angle2 + angle3); a product,
    payload * cos(angle2)"""
    slope: Real
    """change of the parameter for each unit of the signal, in its SI unit"""
    reference: Real
    """where the signal is when the parameter has the value of the model"""
    range: tuple[Real, Real] | None = None
    """[lowest, highest] of the signal; a tenth of it beyond, nothing is estimated"""


def _one_or_two(value: object) -> object:
    return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value


Limits = Annotated[tuple[Real, ...], BeforeValidator(_one_or_two), Field(min_length=1, max_length=2)]
"""A limit, above or below the nominal value, or [lower, upper]."""


def _nominal_file(value: object, info: ValidationInfo) -> NominalFile:
    return read_found(NominalFile, from_folder(value, info))


def _thresholds_file(value: object, info: ValidationInfo) -> ThresholdsFile | None:
    if isinstance(info.context, Reading) and not info.context.thresholds:
        return None
    return read_found(ThresholdsFile, from_folder(value, info))


class ModelConfig(Table):
    """[robot.axis.model]: the drive, its nominal values, and the monitored parameters."""

    drive: DriveName = "three-mass"
    """name of a drive that comes with the program, or "....mo", a file"""
    drive_model: Text | None = None
    """which model, of a Modelica file with more than one"""
    monitor: tuple[Text, ...] = Field(min_length=1)
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
    """size of a monitored parameter, where |nominal| is not it"""
    bounds: dict[str, tuple[Real, Real]] = Field(default_factory=dict)
    """name = [lower, upper]: the estimate stays between them"""
    limits: dict[str, Limits] = Field(default_factory=dict)
    """name = limit, or [lower, upper], of a monitored parameter or its reciprocal: when it will be reached is
    foretold"""
    schedule: tuple[ScheduleConfig, ...] = ()
    """nominal values that follow signals, beside those of the nominal_file"""
    conditions: Literal["others stand still"] | None = None
    """the pose of the other axes, payload and temperature do not change, so nothing follows them"""


REPLACED_BY_NOMINAL_FILE = {
    "model": ("nominal", "friction_speed_scale"),
    "estimator": ("predictor", "torque_noise", "output_noise", "innovation_variance", "initial_p"),
}
REPLACED_BY_THRESHOLDS_FILE = {"detector": ("alpha_1", "alpha_2", "budget_s")}
"""Keys of an axis by table."""


def _none_or_three(value: float) -> float:
    if value != 0 and value < 3:  # noise alone exceeds it often
        raise ValueError("must be 0 or at least 3")
    return value


class EstimatorConfig(Table):
    """[robot.axis.estimator]: the recursive prediction error method."""

    predictor: Literal["innovations", "output-error"] = "innovations"
    """prediction of the output: "innovations" (Kalman gain) or "output-error" (the paper; speed only)"""
    memory_s: Positive | None = None
    """memory of the estimates [s]: older samples count little; default 1 s"""
    information_floor: Real = Field(0.05, ge=0, le=0.5)
    """share of the information at commissioning that is never forgotten; 0: the paper's, without"""
    min_excitation: Real = Field(0.05, ge=0, le=0.5)
    """share of the usual excitation below which nothing is estimated; 0: the paper's, always"""
    outlier_limit: Annotated[Real, AfterValidator(_none_or_three)] = Field(6.0, le=1000)
    """an innovation beyond this number of standard deviations is rejected, if these are few; 0: never"""
    joint_state: bool | None = Field(None, strict=True)
    """the state moves with the estimates, as in a joint Kalman filter; by default where the memory is short: below
    2.5 slowest time constants of the predictor"""
    random_walk: bool = Field(False, strict=True)
    """parameters are followed as a random walk, each for itself, as in a Kalman filter: for many"""
    torque_noise: Positive | None = None
    """standard deviation of the torque per sample [N m], for the Kalman gain"""
    output_noise: Positive | None = None
    """standard deviation of the measured angle [rad] or speed [rad/s]"""
    innovation_variance: Positive | None = None
    """lambda_0 [rad^2 or (rad/s)^2]; default from the noises"""
    initial_p: dict[str, Positive] = Field(default_factory=dict)
    """diagonal of P(0) by parameter; default from the first samples"""


class DetectorConfig(Table):
    """[robot.axis.detector]: the alarm source, and the CUSUM tests."""

    alarm_source: Literal["multimodel", "cusum"] | None = None
    """which detector alarms: "multimodel" (parallel hypotheses) or "cusum" (the paper's tests); default multimodel
    where the thresholds_file has thresholds for it and nominal values follow no measured signals"""
    shadow: bool = Field(True, strict=True)
    """where the CUSUM tests alarm, the multi-model detector runs in shadow mode"""
    budget_s: Real = Field(31557600.0, ge=60)
    """mean time between false alarms [s] that the threshold of the multi-model detector guarantees for an exact
    model, where it has none from a thresholds_file"""
    alpha_1: Real = Field(3.0, ge=0)
    """drift nu = alpha_1 standard deviations"""
    alpha_2: Positive = 20.0
    """threshold h = alpha_2 times the size of the parameter"""
    outside_calibration: Literal["report", "wait", "widen"] = "report"
    """where speed or signals are outside their range in the calibration records: "report" (tests go on, alarms are
    marked), "wait" (nothing is tested), or "widen": as "report", and where friction follows the heat of the axis the
    CUSUM tests go on beyond the heat of the records, with a wider allowance, instead of waiting"""
    covariance_reset: Real = Field(0.0, ge=0, le=1e6)
    """after an alarm P_ii is at least this many times P(0)_ii: faster convergence; 0: P stays"""


def _time(value: object) -> object:
    if not isinstance(value, str):
        raise ValueError('must be a time in quotes, such as "14 days"')
    return seconds_in(value)


class TrendConfig(Table):
    """[robot.axis.trend]: the long-term trend of the parameters, and forecasts."""

    interval_s: Positive = Field(3600.0, le=86400)
    """operating time [s] of one mean of the slow history; forecasts need 120 times as long"""
    lead_time: Annotated[Positive, BeforeValidator(_time)] = Field("14 days", validate_default=True)
    """an alarm is raised when a limit may be reached within this time: "14 days", for example"""


DEFAULT_OFF_DELAY_S = 60.0
"""Off-delays that ISA-18.2 suggests to begin with go up to a minute."""


class AlarmsConfig(Table):
    """[robot.axis.alarms]: priority of the alarms of an axis, and which ones are latched or hidden."""

    priority: Priority = "medium"
    """priority of its alarms: "low", "medium" or "high" """
    priorities: dict[str, Priority] = Field(default_factory=dict)
    """name = priority, of a monitored parameter or a sensor fault that has another one"""
    latched: tuple[Text, ...] = ()
    """parameters or sensor faults whose alarm stays active until it is acknowledged, though its cause is gone"""
    suppressed: tuple[Text, ...] = ()
    """parameters or sensor faults whose alarms are recorded, but not announced"""
    out_of_service: bool = Field(False, strict=True)
    """while the axis is maintained: all of its alarms are recorded, but not announced"""
    group: Name | None = None
    """of the alarms of the axes of one group the first is marked; default: the name of the robot"""
    off_delay_s: NotNegative | None = None
    """an alarm returns when its cause has been away for that long [s]; one that is back sooner is no new alarm"""

    def rules(self, cause: str, memory_s: float) -> AlarmRules:
        """Those of the alarms of a parameter or of a sensor fault, of an axis with this memory [s]."""
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
