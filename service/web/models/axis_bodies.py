"""Bodies of axes: estimates, model, state."""

from typing import Literal

from pydantic import Field

from monitor_core.detection import DetectorName
from monitor_core.monitoring import NotTested, Observation, Status
from service.web.models.bodies import SENTENCES, Body, Number, Sentence, TextOrNull, Time


class Cusum(Body):
    """The two one-sided CUSUM statistics g of a parameter."""

    up: Number = Field(description="g for an increase, in the parameter's unit times samples")
    down: Number = Field(description="g for a decrease, in the parameter's unit times samples")


class Parameter(Body):
    """A monitored parameter, in its own unit."""

    name: str = Field(description="e.g. kT, or 1/Ja for the reciprocal of Ja")
    unit: str = Field(description="SI unit; 1 for a ratio")
    meaning: str
    nominal: Number = Field(
        description="commissioned value, in the parameter's unit; the present one where it follows operating conditions"
    )
    estimate: Number = Field(description="present value, in the parameter's unit; null where it is invalid")
    standard_deviation: Number = Field(description="of the estimate, in the parameter's unit")
    p_diagonal: Number = Field(description="P_ii of the recursion: variance = lambda_0 P_ii / (1 + lambda)")
    cusum: Cusum
    threshold: Number = Field(description="h, in the parameter's unit times samples: an alarm when g exceeds it")
    tolerance: Number = Field(description="nu, in the parameter's unit: deviation per sample that does not increase g")
    status: Status = Field(
        description="waiting: no sample yet; silent: the samples have stopped, the estimate is the last one; "
        "settling: the predictor has just (re)started; "
        "seeding: P(0) is being determined; tracking; weakly observed, not observed: the present motion contains "
        "little or no information about it; "
        "invalid: the model does not hold, there is no estimate; alarm: an alarm is active"
    )
    observation: Observation = Field(
        description="information in the last samples relative to commissioning; while it is not observed, the "
        "estimate is the last observed one and its CUSUM is frozen"
    )
    tested: bool = Field(
        description="whether a change of it would be detected now; false: it may have changed without an alarm"
    )
    not_tested_reason: NotTested | None = Field(
        description="why it is not tested now; null: it is tested. no sample: none is received; "
        "settling: after a start or a gap; "
        "warm-up state: it is not known yet how warm the axis is; "
        "operating conditions: a gate is closed, or a signal is unknown or out of range; unidentifiable: the record of "
        "the nominal values does not determine them; seeding: P(0) is being found, in ten memories of motion; not "
        "observed, uncertain: no or hardly any information in the motion; blocked: P(0) is not found, because another "
        "parameter is uncertain; no threshold: the detector that alarms has "
        "none for it"
    )
    tested_s: Number = Field(
        description="time for which it has been tested with these nominal values, over restarts of the daemon [s]"
    )


class Constant(Body):
    """A nominal value of the drive model."""

    name: str
    value: Number = Field(description="in unit")
    unit: str = Field(description="SI unit; 1 for a ratio")


class Model(Body):
    """The drive model of an axis."""

    drive: str = Field(description="structure, e.g. three-mass")
    output: str = Field(
        description="what is measured besides the torque: speed or mean speed [rad/s], or angle [rad], motor side"
    )
    nominal: list[Constant]


class Stamps(Body):
    """Jitter of the time stamps of an axis."""

    clock: Literal["receipt", "cyclic", "counter"] = Field(
        description="source of the sample times: receipt, the fitted cycle of the controller, or its counter"
    )
    scatter_s: Number = Field(
        description="standard deviation of receipt time minus sample time [s]; for receipt, that of the "
        "intervals divided by the square root of two; null: not known yet"
    )
    interval_s: Number = Field(
        description="sample interval of the controller by the clock of this machine [s]; null: not known yet"
    )


class Detector(Body):
    """Present evidence of a detector."""

    name: DetectorName = Field(description="cusum: tests of the estimates; multimodel: parallel hypotheses")
    alarms: bool = Field(description="true: it raises the alarms of the axis; false: it runs in shadow mode")
    leading: TextOrNull = Field(
        description="the cause nearest to its threshold, a parameter or a sensor fault; null: none yet"
    )
    evidence: Number = Field(description="test statistic of that cause divided by its threshold")


class Heat(Body):
    """Warm-up state of an axis whose friction follows its heat, estimated without a thermometer."""

    heat_w: Number = Field(description="friction power that would keep the axis as warm as it is [W]")
    sd_w: Number = Field(description="its standard deviation [W]")
    known: bool = Field(description="whether it is known well enough to test the parameters that follow it")
    ambient_w: Number = Field(description="the part of it due to a hall colder or warmer than in the records [W]")


class AxisEpoch(Body):
    """The epoch in force of an axis, and the progress of a learning or verification window."""

    number: int = Field(description="of the epoch that is in force; see /api/v1/axes/{axis}/epochs")
    state: Literal["learning", "verifying", "current"] = Field(
        description="learning: a window runs whose estimates will be the nominal values of a new epoch, while"
        " monitoring goes on with those of the former one; verifying: a new epoch is in force and is watched; current:"
        " nothing is under way"
    )
    done_s: Number = Field(description="operating time of the window that is under way [s]; null: none is")
    length_s: Number = Field(description="operating time that it needs [s]; null: none is under way")
    words: str = Field(description="what is under way, as a text; empty: nothing is")


class OutOfService(Body):
    """An axis is out of service, e.g. for maintenance: its alarms are recorded, but not announced."""

    since: Time | None = Field(description="UTC; null: the configuration says so")
    who: str = Field(description="a person; configuration: its [robot.axis.alarms]")
    comment: TextOrNull
    work_order: TextOrNull


class Axis(Body):
    """The present state of an axis."""

    id: str = Field(description="robot.axis")
    robot: str
    name: str
    bus: str
    last_sample: Time | None = Field(description="time of the last sample, UTC; null before the first")
    last_sample_age_s: Number = Field(description="its age in seconds when this was answered")
    silent: bool = Field(
        description="whether no samples are received: none for 5 s, or for 10 sample intervals if that is longer"
    )
    parameters: list[Parameter]
    innovation_variance: Number = Field(description="running lambda_0, in the square of innovation_unit")
    innovation_unit: str = Field(description="unit of the output: rad or rad/s")
    samples: int = Field(
        description="samples received with these nominal values, over restarts of the daemon, used or not"
    )
    confounded: list[str] = Field(description="sentences on parameters that are not observed now")
    gated_by: TextOrNull = Field(
        description="operating condition that excluded the last sample, e.g. mode = 2; null: none"
    )
    counters: dict[str, int] = Field(
        description="number of samples by their use; gated: excluded by operating conditions"
    )
    dropped: dict[str, int] = Field(description="number of decoded values that did not become a sample, by reason")
    clock: dict[str, int] = Field(description="restarts of the time base of the samples, by cause")
    stamps: Stamps
    detectors: list[Detector]
    outside_calibration: list[str] = Field(
        description="conditions that are outside their range in the calibration records now, where the false-alarm "
        "budget is not kept; e.g. temperature = 41, calibrated from 20 to 35; empty: none, or no range is known"
    )
    heat: Heat | None = Field(description="null: nothing follows the heat of this axis")
    not_tested: list[str] = Field(
        description="parameters that are not tested now, why, and what would help, in sentences; empty: all are tested"
    )
    open_alarms: list[str] = Field(
        description="causes of the open alarms of the axis, forecasts left out: parameters or sensor faults"
    )
    epoch: AxisEpoch
    out_of_service: OutOfService | None = Field(
        description="null: its alarms are announced; see /api/v1/axes/{axis}/service"
    )
    model: Model
    sentences: list[Sentence] = Field(description=SENTENCES)


class ParameterState(Body):
    """A monitored parameter in MQTT messages: fields of Parameter, and the deviation."""

    name: str
    unit: str
    nominal: Number
    estimate: Number
    deviation: Number = Field(description="estimate - nominal, in unit; null where it is invalid")
    standard_deviation: Number
    status: Status
    observation: Observation
    tested: bool
    not_tested_reason: NotTested | None


class AxisState(Body):
    """An axis in MQTT messages: some fields of Axis."""

    id: str
    last_sample: Time | None
    parameters: list[ParameterState]
    open_alarms: list[str]
    gated_by: TextOrNull
    outside_calibration: list[str]
    not_tested: list[str]
    out_of_service: OutOfService | None


class Axes(Body):
    """All axes at one moment."""

    taken: Time = Field(description="when the worker published this, UTC")
    axes: list[Axis]
