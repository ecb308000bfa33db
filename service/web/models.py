"""Bodies of the REST answers.  The descriptions state the units; a number that is not finite is null."""

import math
import re
from collections.abc import Iterable
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    model_validator,
)

from monitor_core import wording
from monitor_core.detection import DetectorName, Doubt, Kind, Stage
from monitor_core.monitoring import AlarmEvent, AlarmState, NotTested, Observation, Priority, Status
from service.store.history_store import Resolution
from service.texts import control_character, iso


def finite(value: float | None) -> float | None:
    """The number, or None where it is not finite."""
    return value if value is not None and math.isfinite(value) else None


def _iso(value: object) -> object:
    return iso(value) if isinstance(value, int) else value


_DATE_AND_TIME = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d")


def _date_and_time(given: object) -> object:
    """A text that begins as a time does; pydantic takes a number for seconds or milliseconds since 1970.

    Raises:
        ValueError: it does not.
    """
    if given is not None and not (isinstance(given, str) and _DATE_AND_TIME.match(given)):
        raise ValueError("must be ISO 8601 with time zone: 2026-03-01T12:00:00Z, or +01:00 as %2B01:00")
    return given


def _written(text: str) -> str:
    """A text that moves no cursor of a terminal, where a command prints it.

    Raises:
        ValueError: it is none.
    """
    if (wrong := control_character(text)) is not None:
        raise ValueError(f"must be a text without control characters; it has U+{ord(wrong):04X}")
    return text


GivenTime = Annotated[AwareDatetime, BeforeValidator(_date_and_time)]
"""In a request"""
GivenText = Annotated[str, AfterValidator(_written)]
"""In a request"""
Number = Annotated[float | None, BeforeValidator(finite)]
Time = Annotated[str, BeforeValidator(_iso), Field(json_schema_extra={"format": "date-time"})]
"""Given as text, or in microseconds since 1970"""
TextOrNull = Annotated[str | None, BeforeValidator(lambda text: text or None)]
"""An empty text becomes null"""
Direction = Literal["up", "down"]


class Body(BaseModel):
    """Base of all bodies: immutable, no unknown fields; a body within another is read from an object's attributes."""

    model_config = ConfigDict(extra="forbid", frozen=True, from_attributes=True)


class Sentence(Body):
    """A text for a person, with what another language needs to say it."""

    words: str = Field(description="the text, in English, as it stands in other fields")
    kind: str = Field(description="which sentence it is; joined: its values, one after the other")
    values: "dict[str, str | Sentence]" = Field(description="what is in it")


def sentences(texts: Iterable[str | None]) -> list[dict[str, object]]:
    """Fields of models.Sentence of those texts that are sentences of a kind, each once."""
    return [_sentence(text) for text in dict.fromkeys(texts) if isinstance(text, wording.Sentence)]


def _sentence(text: wording.Sentence) -> dict[str, object]:
    values = {name: _sentence(v) if isinstance(v, wording.Sentence) else v for name, v in text.values.items()}
    return {"words": text, "kind": text.kind, "values": values}


def sentence_bodies(texts: Iterable[str | None]) -> list[Sentence]:
    """Those of them that are sentences of a kind, each once."""
    return [Sentence.model_validate(found) for found in sentences(texts)]


SENTENCES = "the texts above that are sentences of a kind: with it, so that another language can say them"

# --- Axes: estimates, model, state -----------------------------------------------------------------------------------


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
    threshold: Number = Field(
        description="h, in the parameter's unit times samples: an alarm when g exceeds it"
    )
    tolerance: Number = Field(
        description="nu, in the parameter's unit: deviation per sample that does not increase g"
    )
    status: Status = Field(
        description="waiting: no sample yet; settling: the predictor has just (re)started; "
        "seeding: P(0) is being determined; tracking; weakly observed, not observed: the present motion contains "
        "little or no information about it; "
        "invalid: the model does not hold, there is no estimate; alarm: an alarm is active"
    )
    observation: Observation = Field(
        description="information in the last samples relative to commissioning; while it is not observed, the "
        "estimate is the last observed one and its CUSUM is frozen"
    )
    tested: bool = Field(
        description="whether a change of it would be found now; false: the absence of an alarm says nothing of it"
    )
    not_tested_reason: NotTested | None = Field(
        description="why it is not tested now; null: it is tested. no sample; settling: after a start or a gap; "
        "warm-up state: it is not known yet how warm the axis is; "
        "operating conditions: a gate is closed, or a signal is unknown or out of range; unidentifiable: the record of "
        "the nominal values does not determine them; seeding: P(0) is being found, in ten memories of motion; not "
        "observed, uncertain: no or hardly any information in the motion; blocked: P(0) is not found, because another "
        "parameter is uncertain; no threshold: the detector that alarms has "
        "none for it"
    )
    tested_s: Number = Field(description="time for which it has been tested since the start of its state [s]")


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
    """Scatter of the time stamps of an axis."""

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
    """How warm an axis is whose friction follows its heat, which nobody measures."""

    heat_w: Number = Field(description="friction power that would keep the axis as warm as it is [W]")
    sd_w: Number = Field(description="its standard deviation [W]")
    known: bool = Field(description="whether it is known well enough to test the parameters that follow it")


class AxisEpoch(Body):
    """Which nominal values of an axis are in force, and what is under way."""

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
    """An axis is maintained: its alarms are recorded, but not announced."""

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
    parameters: list[Parameter]
    innovation_variance: Number = Field(description="running lambda_0, in the square of innovation_unit")
    innovation_unit: str = Field(description="unit of the output: rad or rad/s")
    samples: int = Field(description="samples received since the start, used or not")
    confounded: list[str] = Field(description="sentences on parameters that are not observed now")
    gated_by: TextOrNull = Field(
        description="operating condition that excluded the last sample, e.g. mode = 2; null: none"
    )
    counters: dict[str, int] = Field(
        description="number of samples by their use; gated: excluded by operating conditions"
    )
    dropped: dict[str, int] = Field(
        description="number of decoded values that did not become a sample, by reason"
    )
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
    """A monitored parameter as MQTT has it: fields of Parameter, and the deviation."""

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
    """An axis as MQTT has it: fields of Axis."""

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


# --- History and slow trend ------------------------------------------------------------------------------------------


class HistoryColumn(Body):
    """A quantity over time, one number for each entry of ``time``; null where n is 0, or it is not finite."""

    unit: str
    mean: list[Number] = Field(description="in unit, over all points of the row")
    min: list[Number] = Field(description="in unit")
    max: list[Number] = Field(description="in unit")


class ParameterHistory(Body):
    """History of a parameter in columns; one row for each entry of ``time``."""

    name: str
    unit: str
    nominal: Number = Field(
        description="present value, in the parameter's unit; null: it is no longer monitored"
    )
    n: list[int] = Field(
        description="points in the row; 0: none, as there were no samples, or the axis was learning or paused, or the"
        " estimate was invalid"
    )
    estimate: HistoryColumn
    deviation: HistoryColumn = Field(description="estimate - nominal value of that time")
    standard_deviation: HistoryColumn = Field(description="of the estimate")
    cusum_up: HistoryColumn = Field(description="g for an increase")
    cusum_down: HistoryColumn = Field(description="g for a decrease")
    threshold: HistoryColumn = Field(description="h of both")
    observability: HistoryColumn = Field(
        description="1 as at commissioning, 0.5 weak, 0 not observed; then the estimate is the last that was observed"
    )


class History(Body):
    """The history of an axis, oldest first; a row without any point is the beginning of a gap."""

    axis: str
    resolution: Resolution = Field(description="what the rows were made of: points, minutes, hours, days")
    step_s: Number = Field(description="length of a row [s]")
    next: Time | None = Field(
        description="with resolution: there are more rows, from this time on: ask again with it as since; null: all"
    )
    time: list[Time] = Field(description="begin of each row, UTC")
    parameters: list[ParameterHistory]


class Reach(Body):
    """When a limit is reached."""

    name: str = Field(description="the limited quantity: the parameter, or its reciprocal")
    limit: Number = Field(description="in unit")
    unit: str = Field(description="1 for a ratio")
    above: bool = Field(description="true: an upper limit; false: a lower limit")
    state: Literal["ahead", "open", "far", "beyond"] = Field(
        description="ahead: reached between low and high with a probability of 90 %; open: after low, perhaps "
        "never; far: not before low, the end of the forecast; beyond: it was reached between low and high"
    )
    low: Time = Field(description="UTC; reached earlier with a probability of 5 %")
    high: Time | None = Field(
        description="UTC; reached later with a probability of 5 %; null: the interval is open"
    )
    words: str = Field(
        description="the same as a sentence, relative to the last entry or to the last update of the alarm"
    )


class Drift(Body):
    """Result of the trend analysis of a parameter."""

    time: Time = Field(description="last entry that was used, UTC")
    since: Time = Field(description="first entry that was used, UTC")
    steady: Number = Field(description="probability that the parameter is steady")
    drift: Number = Field(description="probability that it drifts, from the beginning or since some time")
    step: Number = Field(description="probability that it stepped")
    both: Number = Field(description="probability that it stepped and has drifted since")
    level: Number = Field(description="present level, in the parameter's unit")
    level_sd: Number = Field(description="its standard deviation")
    slope_per_day: Number = Field(description="averaged over these models, in the parameter's unit per day")
    slope_per_day_sd: Number = Field(description="its standard deviation")
    changed: Time = Field(
        description="when the likeliest kind of change began, UTC; of a steady one the begin"
    )
    change: Number = Field(description="by how much it has changed since then, in the parameter's unit")
    change_sd: Number = Field(description="its standard deviation")
    scatter: Number = Field(
        description="standard deviation of an entry about the trend, in the parameter's unit"
    )


class LongTermHistory(Body):
    """Long-term history of a parameter in columns, oldest first: means over hours of operation, later over days."""

    name: str
    unit: str
    nominal: Number = Field(description="commissioned value, in the parameter's unit")
    words: str
    drift: Drift | None = Field(description="null: too few entries yet")
    limits: list[Reach]
    time: list[Time] = Field(description="middle of each entry, UTC")
    mean: list[Number] = Field(
        description="in the parameter's unit; at the reference conditions where its nominal value is scheduled"
    )
    standard_deviation: list[Number] = Field(description="of the mean, from P: a lower bound")
    operating_s: list[Number] = Field(description="operating time in which it was observed [s]")


class Trend(Body):
    """Long-term trends of an axis."""

    axis: str
    interval_s: Number = Field(description="operating time of a complete entry [s]")
    lost: int = Field(description="histories that could not be restored at the start")
    parameters: list[LongTermHistory]


# --- Alarms ----------------------------------------------------------------------------------------------------------


class Cause(Body):
    """A possible cause of an alarm."""

    parameter: str = Field(description="a monitored parameter, or a sensor fault, e.g. torque sign")
    probability: Number = Field(
        description="among all single causes; CUSUM tests: with prior odds of 8 to 1 for the first that crossed; causes"
        " below 0.01 are left out"
    )
    alike: list[str] = Field(
        default=[], description="causes that produce the same data and cannot be distinguished from this one"
    )


class PastName(Body):
    """An earlier name of an alarm."""

    until: Time = Field(description="UTC")
    stage: Stage
    parameter: str
    direction: Direction


class Alarm(Body):
    """An alarm, from the first crossing of the threshold until the parameter is back at nominal."""

    id: int | None = Field(description="null: it is not yet recorded, and not known")
    recorded: bool = Field(
        description="false: the journal does not have it yet, as the disk refuses it; it is tried again"
    )
    recording: TextOrNull = Field(
        description="name of the file with the raw frames around it, see /api/v1/recordings; null: there is none (yet)"
    )
    axis: str
    state: AlarmState = Field(
        description="state of ISA-18.2. normal: it is over; unacknowledged, acknowledged: it is active; returned: its"
        " cause is gone, nobody has acknowledged it; latched: its cause is gone, it stays active until it is"
        " acknowledged; shelved: hidden by a person for a time; suppressed: hidden by the configuration;"
        " out-of-service: hidden while its axis is maintained"
    )
    returns_to: AlarmState | None = Field(
        description="of a shelved, suppressed or out-of-service alarm: the state without that; else null"
    )
    shelved_until: Time | None = Field(description="end of the shelf, UTC; null: it is not shelved")
    priority: Priority
    work_order: TextOrNull = Field(description="the last one that was given; null: none")
    first_out: bool = Field(
        description="whether it was raised first of alarms of several axes of its group, each raised within ten minutes"
        " after another one; while it is shown and active, and others are"
    )
    follows: int | None = Field(
        description="id of the alarm of its group that was there when it was raised, the first one; null: none was"
    )
    parameter: str = Field(
        description="the most probable name now; causes states how certain it is. A monitored parameter, or, from"
        " the multi-model detector, a sensor fault: torque or output scale, sign, offset or stuck, torque lost, output"
        " noise, delay"
    )
    direction: Direction
    stage: Stage = Field(
        description="changed: something has changed, parameter is the first that crossed; named: enough evidence was "
        "collected, three memory lengths after the first crossing"
    )
    causes: list[Cause] = Field(
        description="possible causes, most probable first; empty before the alarm is named"
    )
    doubt: Doubt = Field(
        description="why it may be none of the causes; several: no single parameter explains it; model: the model no "
        "longer holds, as with a sensor fault; sign: torque or motion seems to have changed its sign; still: no motion "
        "follows the torque; empty: no doubt"
    )
    inside_calibration: bool | None = Field(
        description="whether it was raised in the conditions of the calibration records; false: the false-alarm budget "
        "is not kept there; null: unknown"
    )
    kind: Kind = Field(
        description="step or drift; empty: unknown, or not known yet; forecast: a long-term drift that will reach a "
        "limit soon, or has reached it"
    )
    reaches: list[Reach] = Field(description="of a forecast: the limit and when it is reached")
    words: str = Field(description="the alarm as a sentence, e.g. the torque frame is 0.5 ms late: ..")
    active: bool = Field(description="true: it has not ended, or is latched")
    unit: str = Field(description="of nominal, size and size_sd; 1 for a ratio")
    nominal: Number = Field(description="commissioned value, in unit")
    size: Number = Field(
        description="estimate - nominal, mean since the alarm was raised, in unit; null: not known yet, or the cause"
        " has no size"
    )
    size_sd: Number = Field(description="standard deviation of the size, in unit; null together with it")
    onset: Time = Field(
        description="most probable time of the change, UTC; before it is named the last time that g was zero"
    )
    onset_low: Time | None = Field(
        description="it changed later with a probability of 95 %, UTC; null: not known yet, or before the evidence"
    )
    onset_high: Time | None = Field(
        description="it changed earlier with a probability of 95 %, UTC; null: not known yet"
    )
    raised: Time = Field(description="when the threshold was crossed for the first time, UTC")
    updated: Time = Field(description="when it was crossed for the last time, UTC")
    ended: Time | None = Field(
        description="when the parameter was found to be back: its tests had not crossed for three memory lengths, and "
        "it was much nearer to its nominal value than to the size, UTC; the alarm returns when the off-delay is over"
    )
    reopened: Time | None = Field(
        description="when the same cause was detected again soon after the alarm had ended, UTC; null: it was not"
    )
    crossings: int = Field(description="number of times a threshold was crossed")
    past: list[PastName] = Field(description="earlier names of the alarm, oldest first")


class AlarmTransition(Body):
    """What has happened to an alarm."""

    at: Time = Field(description="UTC")
    event: AlarmEvent
    from_state: AlarmState
    to_state: AlarmState
    until: Time | None = Field(description="end of the shelf, UTC; null: it is not shelved then")
    who: str = Field(description="a person; axiswatch: the monitor; configuration: its [robot.axis.alarms]")
    comment: TextOrNull
    work_order: TextOrNull


class ReplayReport(Body):
    """Whether the report of a replay is there."""

    state: Literal["none", "running", "made", "failed"]
    problem: TextOrNull = Field(description="why it failed; null: it did not")
    sentences: list[Sentence] = Field(description=SENTENCES)


class AlarmRecord(Alarm):
    """An alarm with all that has happened to it."""

    transitions: list[AlarmTransition] = Field(description="oldest first")
    report: ReplayReport | None = Field(
        description="of the replay of its recording, made by POST; null: there is no recording, or none can be made"
    )


class AlarmChange(Body):
    """The data of an event `alarm`."""

    alarm: Alarm = Field(description="as it is when the event is sent")
    transition: AlarmTransition


class AlarmMessage(AlarmTransition):
    """What a webhook and MQTT deliver: a transition of an alarm, and the alarm as it is now."""

    id: str = Field(description="the same whenever it is sent again: a receiver drops what it has had")
    alarm: Alarm


class AlarmNote(Body):
    """What a person writes about an alarm; both may be left out."""

    comment: GivenText = Field("", max_length=2000)
    work_order: GivenText = Field(
        "", max_length=100, description="number of a work order in the plant's system"
    )


class AlarmComment(AlarmNote):
    """A comment, a work order, or both."""

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if not self.comment and not self.work_order:
            raise ValueError("give comment, work_order or both")
        return self


class AlarmShelf(AlarmNote):
    """Until when an alarm is shelved: one of until and duration_s."""

    until: GivenTime | None = Field(None, description="ISO 8601 with time zone; at most seven days from now")
    duration_s: float | None = Field(
        None, allow_inf_nan=False, description="from now on [s]; at most seven days"
    )

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        if (self.until is None) == (self.duration_s is None):
            raise ValueError("give one of until and duration_s")
        return self


class AlarmFrequency(Body):
    """How often the alarms of a name were raised."""

    axis: str
    parameter: str
    direction: Direction
    alarms: int


class AlarmStateCount(Body):
    """Number of alarms in a state now."""

    state: AlarmState
    priority: Priority
    alarms: int


class AlarmStatistics(Body):
    """How much the alarms ask of an operator (EEMUA 191, ISA-18.2)."""

    since: Time = Field(description="UTC")
    until: Time = Field(description="UTC")
    raised: int = Field(
        description="alarms raised in this time; one whose cause is back after the off-delay counts again"
    )
    announced: int = Field(description="those of them that were not shelved, suppressed or out of service")
    mean_per_ten_minutes: Number = Field(description="announced alarms in ten minutes; one is acceptable")
    most_in_ten_minutes: int = Field(description="announced alarms in the worst ten minutes")
    most_at: Time | None = Field(description="when these began, UTC; null: there was no alarm")
    flood_share: Number = Field(description="share of the ten minutes with more than ten announced alarms")
    most_frequent: list[AlarmFrequency] = Field(description="the ten names raised most often")
    states: list[AlarmStateCount] = Field(description="now; those that are normal are left out")


class Alarms(Body):
    """A page of the alarm journal, latest first."""

    total: int = Field(description="alarms that match the filters")
    limit: int
    next: str | None = Field(description="cursor of the next page; null: this is the last one")
    alarms: list[Alarm]


# --- The daemon: buses, links, recordings, readiness -----------------------------------------------------------------


class Bus(Body):
    """A bus and its frames since the start."""

    name: str
    up: bool
    state: str = Field(description="up, or the reason why not")
    reader: str = Field(description="how its frames are received; empty where that is not known")
    frames: int = Field(description="frames received")
    dropped: dict[str, int] = Field(description="number of dropped frames, by reason")


class Link(Body):
    """A plant link; numbers since the start of the daemon."""

    name: str
    kind: Literal["webhook", "mqtt", "smtp", "opcua"]
    connected: bool = Field(description="whether it works: the last try has succeeded")
    problem: TextOrNull = Field(
        description="why it does not, or what the receiver has refused; null: nothing"
    )
    pending: int = Field(description="transitions of alarms that wait")
    delivered: int = Field(description="transitions of alarms that were delivered")
    given_up: dict[str, int] = Field(
        description="number of those that were given up, by reason: age, undeliverable for max_age_s; refused by the"
        " receiver"
    )


class Lack(StrEnum):
    """What is missing so that every axis is monitored and every alarm recorded."""

    WORKER = "worker"
    BUS = "bus"
    RECORD = "record"
    SAMPLES = "samples"


class NotReady(Body):
    """A reason why not every axis is monitored, or why alarms are not recorded."""

    lack: Lack = Field(
        description="what is missing: a report of the worker, a bus, the record of alarms, samples of an axis"
    )
    name: str = Field(description="of the bus or axis")
    state: str = Field(description="of the bus")
    since_s: Number | None = Field(
        description="age of the last sample, or of the last report of the worker, in seconds; null: there is none"
    )
    alarms: int = Field(description="number of alarms that are not recorded")


class Service(Body):
    """The daemon itself."""

    version: str
    ready: bool = Field(description="all buses are up and all axes receive samples")
    reasons: list[str] = Field(description="why it is not ready")
    not_ready: list[NotReady] = Field(description="the same as values")
    messages: list[str] = Field(description="for the operator, e.g. that a checkpoint was quarantined")
    started: Time = Field(description="UTC")
    taken: Time = Field(description="when the worker published this, UTC")
    checkpoint: Time | None = Field(description="when the monitors were saved last, UTC")
    buses: list[Bus]
    links: list[Link] = Field(description="plant links, in the order of the configuration")
    report: str | None = Field(description="address of the report of the commissioning; null: there is none")
    insecure: str | None = Field(
        description="why the daemon is not protected where other machines reach it; null: it is"
    )
    sentences: list[Sentence] = Field(description=SENTENCES)


class Health(Body):
    """Whether the process and its worker are alive."""

    alive: bool
    snapshot_age_s: Number = Field(description="seconds since the worker last reported")
    insecure: bool = Field(description="other machines reach the daemon, and it lacks tokens or TLS")


class Readiness(Body):
    """Whether all axes are being monitored."""

    ready: bool
    reasons: list[str] = Field(description="why not every axis is monitored")


class Recording(Body):
    """A file with the raw frames of some minutes."""

    name: str
    size_bytes: int


class Recordings(Body):
    """All recordings."""

    recordings: list[Recording] = Field(description="oldest first")


class Problem(Body):
    """An error of the request, or of the daemon: problem details of RFC 9457."""

    type: str = "about:blank"
    title: str = Field(description="name of the status")
    status: int = Field(description="the HTTP status")
    detail: str = Field(description="what is wrong, and what would be right")
    sentences: list[Sentence] = Field(default=[], description=SENTENCES)
    known: list[str] = Field(default=[], description="existing resources")
