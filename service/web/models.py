"""Bodies of the REST answers.  Units are in the descriptions; a number that is not finite is null."""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from monitor_core.detection.alarm import Doubt, Kind, Stage
from monitor_core.detection.detector_protocol import DetectorName
from monitor_core.monitoring.facts import Observation, Status


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


Number = Annotated[float | None, BeforeValidator(_finite)]
Time = Annotated[str, Field(json_schema_extra={"format": "date-time"})]
Direction = Literal["up", "down"]


class Body(BaseModel):
    """A body: complete, unchangeable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


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
        description="commissioned value, in the parameter's unit; where it follows operating conditions, that of now"
    )
    estimate: Number = Field(description="value now, in the parameter's unit; null where it is invalid")
    standard_deviation: Number = Field(description="of the estimate, in the parameter's unit")
    p_diagonal: Number = Field(description="P_ii of the recursion: variance = lambda_0 P_ii / (1 + lambda)")
    cusum: Cusum
    threshold: Number = Field(
        description="h, in the parameter's unit times samples: an alarm when g exceeds it"
    )
    tolerance: Number = Field(
        description="nu, in the parameter's unit: deviation per sample that is tolerated"
    )
    status: Status = Field(
        description="waiting: no sample yet; settling: the predictor has just (re)started; "
        "seeding: the initial uncertainty is being found; tracking; weakly observed, not observed: the axis moves "
        "too little, or too uniformly, to say much, or anything, of it; "
        "invalid: the model does not hold, there is no estimate; alarm: an alarm is active"
    )
    observation: Observation = Field(
        description="what the last samples say of it, beside those at commissioning; while it is not observed the "
        "estimate is the last that was, and its CUSUM waits"
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
    """How far the time stamps of an axis scatter."""

    clock: Literal["receipt", "cyclic", "counter"] = Field(
        description="that gives the times of the samples: receipt, the controller's cycle as fitted, or its counter"
    )
    scatter_s: Number = Field(
        description="standard deviation of time of receipt minus time of the sample [s]; for receipt, of the "
        "intervals, over the root of two; null: not known yet"
    )
    interval_s: Number = Field(
        description="sample interval of the controller by the clock here [s]; null: not known yet"
    )


class Detector(Body):
    """What a detector says of an axis now."""

    name: DetectorName = Field(
        description="cusum: the tests of each parameter; bank: hypotheses side by side"
    )
    alarms: bool = Field(description="its alarms are those of the axis; else it only looks on")
    leading: str | None = Field(
        description="what is nearest its threshold, a parameter or another cause; null: nothing yet"
    )
    evidence: Number = Field(description="of that, test statistic over threshold")
    open: list[str] = Field(
        description="names of the alarms that are open by what it says, whether they count or not"
    )


class Axis(Body):
    """An axis now."""

    id: str = Field(description="robot.axis")
    robot: str
    name: str
    bus: str
    last_sample: Time | None = Field(description="time of the last sample, UTC; null before the first")
    last_sample_age_s: Number = Field(description="its age in seconds when this was answered")
    parameters: list[Parameter]
    innovation_variance: Number = Field(description="running lambda_0, in the square of innovation_unit")
    innovation_unit: str = Field(description="unit of the output: rad or rad/s")
    samples: int = Field(description="samples received since the start, whatever became of them")
    confounded: list[str] = Field(description="what cannot be told apart, or is not observed, now: in words")
    gated_by: str | None = Field(
        description="which operating condition forbids to learn from the last sample, e.g. mode = 2; null: none does"
    )
    counters: dict[str, int] = Field(
        description="what became of the samples, number by fate; gated: operating conditions forbade to learn from them"
    )
    dropped: dict[str, int] = Field(
        description="decoded values that did not become a sample, number by reason"
    )
    clock: dict[str, int] = Field(
        description="how often the time line of the samples began anew, number by cause"
    )
    stamps: Stamps
    detectors: list[Detector]
    model: Model


class Axes(Body):
    """All axes at one moment."""

    taken: Time = Field(description="when the worker reported this, UTC")
    axes: list[Axis]


class Course(Body):
    """The course of a parameter, a column each; a row for each entry of time."""

    name: str
    unit: str
    nominal: Number = Field(description="now, in the parameter's unit")
    nominals: list[Number] = Field(description="then, in the parameter's unit")
    estimate: list[Number] = Field(description="in the parameter's unit")
    standard_deviation: list[Number] = Field(description="in the parameter's unit")
    cusum_up: list[Number] = Field(description="in the parameter's unit times samples")
    cusum_down: list[Number] = Field(description="in the parameter's unit times samples")


class History(Body):
    """The last points of an axis, oldest first."""

    axis: str
    time: list[Time] = Field(description="UTC")
    parameters: list[Course]


class Reach(Body):
    """When a limit is reached."""

    name: str = Field(description="what has the limit: the parameter, or its reciprocal")
    limit: Number = Field(description="in unit")
    unit: str = Field(description="1 for a ratio")
    above: bool = Field(description="true: it must stay below; false: above")
    state: Literal["ahead", "open", "far", "beyond"] = Field(
        description="ahead: it is reached between low and high with a probability of 90 %; open: after low, perhaps "
        "never; far: not in sight, not before low; beyond: it was reached between low and high"
    )
    low: Time = Field(description="UTC; before it with a probability of 5 %")
    high: Time | None = Field(
        description="UTC; after it with a probability of 5 %; null: the interval is open"
    )
    words: str = Field(
        description="the same in words, counted from the last entry, or from when the alarm was updated"
    )


class Drift(Body):
    """What the slow history of a parameter says."""

    time: Time = Field(description="of the last entry that was looked at, UTC")
    since: Time = Field(description="of the first, UTC")
    steady: Number = Field(description="probability that it has not changed")
    drift: Number = Field(description="probability that it drifts, from the beginning or since some time")
    step: Number = Field(description="probability that it changed at once")
    both: Number = Field(description="probability that it changed at once, and drifts since")
    level: Number = Field(description="now, in the parameter's unit")
    level_sd: Number = Field(description="its standard deviation")
    slope_per_day: Number = Field(description="of all these possibilities, in the parameter's unit per day")
    slope_per_day_sd: Number = Field(description="its standard deviation")
    scatter: Number = Field(
        description="standard deviation of an entry about its course, in the parameter's unit"
    )


class SlowCourse(Body):
    """The slow course of a parameter, a column each, oldest first: means over hours of operation, later of days."""

    name: str
    unit: str
    nominal: Number = Field(description="commissioned value, in the parameter's unit")
    words: str
    drift: Drift | None = Field(description="null: too little is known yet")
    limits: list[Reach]
    time: list[Time] = Field(description="middle of each entry, UTC")
    mean: list[Number] = Field(
        description="in the parameter's unit; where its nominal value follows conditions, at those of reference"
    )
    standard_deviation: list[Number] = Field(description="of the mean, by P: at least so much")
    operating_s: list[Number] = Field(description="time in operation in which it was observed [s]")


class Trend(Body):
    """The slow courses of an axis."""

    axis: str
    interval_s: Number = Field(description="time in operation of a whole entry [s]")
    lost: int = Field(description="histories that could not be put back at the start")
    parameters: list[SlowCourse]


class Cause(Body):
    """What may have changed."""

    parameter: str = Field(description="or a fault of a sensor, e.g. torque sign")
    probability: Number = Field(
        description="of all single causes; of the CUSUM tests, with odds of 8 to 1 for the first that crossed; below"
        " 0.01 it is left out"
    )
    alike: list[str] = Field(
        default=[], description="causes that make the same data: it is this one or one of those"
    )


class PastName(Body):
    """What an alarm was called before."""

    until: Time = Field(description="UTC")
    stage: Stage
    parameter: str
    direction: Direction


class Alarm(Body):
    """An alarm: one from the first crossing of the threshold until the parameter is back at nominal."""

    id: int
    axis: str
    parameter: str = Field(
        description="the best name there is now; causes tells how sure it is. A monitored parameter, or, where the bank"
        " of hypotheses alarms, a fault of a sensor: torque or output scale, sign, offset or stuck, torque lost, output"
        " noise, delay"
    )
    direction: Direction
    stage: Stage = Field(
        description="changed: something has, the parameter is the first that crossed; named: the evidence is in, "
        "three memory lengths after the first crossing"
    )
    causes: list[Cause] = Field(
        description="what may have changed, the likeliest first; empty before it is named"
    )
    doubt: Doubt = Field(
        description="why it may be none of the causes; several: no single parameter explains it; model: the model no "
        "longer holds, as if a sensor were wrong; sign: as if torque or motion had changed its sign; still: no motion "
        "follows the torque; empty: no doubt"
    )
    kind: Kind = Field(
        description="step or drift; empty: it cannot be told, or not yet; forecast: no change, but a slow drift that "
        "is about to reach a limit, or has"
    )
    reaches: list[Reach] = Field(description="of a forecast: the limit, and when it is reached")
    words: str = Field(description="the alarm in a sentence, e.g. the torque frame is 0.5 ms late: ..")
    active: bool = Field(description="it has not ended")
    unit: str = Field(description="of nominal, size and size_sd; 1 for a ratio")
    nominal: Number = Field(description="commissioned value, in unit")
    size: Number = Field(
        description="estimate - nominal when it was updated, in unit; null where the cause has no size"
    )
    size_sd: Number = Field(description="standard deviation of the size, in unit")
    onset: Time = Field(
        description="when it changed, UTC: the likeliest time; before it is named the last time the CUSUM was zero"
    )
    onset_low: Time | None = Field(
        description="it changed after this with a probability of 95 %, UTC; null: not told yet, or earlier than is told"
    )
    onset_high: Time | None = Field(
        description="it changed before this with a probability of 95 %, UTC; null: not told yet"
    )
    raised: Time = Field(description="when the threshold was crossed for the first time, UTC")
    updated: Time = Field(description="when it was crossed for the last time, UTC")
    ended: Time | None = Field(description="when the deviation had been tolerable for long enough, UTC")
    crossings: int = Field(description="number of times a threshold was crossed")
    past: list[PastName] = Field(description="what the alarm was called before, the first name first")


class Alarms(Body):
    """A page of the alarm journal, the last raised first."""

    total: int = Field(description="alarms that fit the filters")
    limit: int
    offset: int
    alarms: list[Alarm]


class Bus(Body):
    """A bus and its frames since the start."""

    name: str
    up: bool
    state: str = Field(description="up, or why not")
    frames: int = Field(description="frames received")
    dropped: dict[str, int] = Field(description="frames dropped, number by reason")


class Service(Body):
    """The daemon itself."""

    version: str
    ready: bool = Field(description="all buses are up and all axes get samples")
    reasons: list[str] = Field(description="why it is not ready")
    messages: list[str] = Field(description="for the operator, e.g. that a checkpoint was set aside")
    started: Time = Field(description="UTC")
    taken: Time = Field(description="when the worker reported this, UTC")
    checkpoint: Time | None = Field(description="when the monitors were last saved, UTC")
    buses: list[Bus]


class Health(Body):
    """Whether the process and its worker are alive."""

    alive: bool
    snapshot_age_s: Number = Field(description="seconds since the worker last reported")


class Readiness(Body):
    """Whether all axes are being monitored."""

    ready: bool
    reasons: list[str] = Field(description="why not")


class Problem(Body):
    """What is wrong with the request, or with the daemon."""

    detail: str
    known: list[str] = Field(default=[], description="what there is instead")
