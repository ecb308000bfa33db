"""Bodies of alarms and of actions on alarms."""

from typing import Literal, Self

from pydantic import Field, model_validator

from monitor_core.detection import ChangeKind, Direction, Doubt, Stage
from monitor_core.monitoring import AlarmEvent, AlarmState, Priority
from service.web.models.bodies import (
    SENTENCES,
    Body,
    GivenText,
    GivenTime,
    Number,
    Sentence,
    TextOrNull,
    Time,
)
from service.web.models.history_bodies import Reach


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
    same_payload: list[str] = Field(
        description="the other axes of its robot whose alarms, raised within ten minutes, the same change of the"
        " payload explains: that is likelier than a fault of each drive; of an alarm that does not tell of a payload,"
        " those that name a load or an inertia and began together with it; empty: there are none"
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
    causes: list[Cause] = Field(description="possible causes, most probable first; empty before the alarm is named")
    doubt: Doubt = Field(
        description="why it may be none of the causes; several: no single parameter explains it; model: the model no "
        "longer holds, as with a sensor fault; sign: torque or motion seems to have changed its sign; still: no motion "
        "follows the torque; empty: no doubt"
    )
    inside_calibration: bool | None = Field(
        description="whether it was raised in the conditions of the calibration records; false: the false-alarm budget "
        "is not kept there; null: unknown"
    )
    kind: ChangeKind = Field(
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
    """A transition of an alarm."""

    at: Time = Field(description="UTC")
    event: AlarmEvent
    from_state: AlarmState
    to_state: AlarmState
    until: Time | None = Field(description="end of the shelf, UTC; null: it is not shelved then")
    who: str = Field(description="a person; axiswatch: the monitor; configuration: its [robot.axis.alarms]")
    comment: TextOrNull
    work_order: TextOrNull


class ReplayReport(Body):
    """State of the replay report of an alarm."""

    state: Literal["none", "running", "made", "failed"]
    problem: TextOrNull = Field(description="why it failed; null: it did not")
    sentences: list[Sentence] = Field(description=SENTENCES)


class AlarmRecord(Alarm):
    """An alarm with its transitions."""

    transitions: list[AlarmTransition] = Field(description="oldest first")
    report: ReplayReport | None = Field(
        description="of the replay of its recording, made by POST; null: there is no recording, or none is made"
    )


class AlarmChange(Body):
    """The data of an event `alarm`."""

    alarm: Alarm = Field(description="as it is when the event is sent")
    transition: AlarmTransition


class AlarmMessage(AlarmTransition):
    """Message of a webhook or over MQTT: a transition of an alarm, and the alarm at the time of sending."""

    id: str = Field(description="the same whenever it is sent again: a receiver drops what it has had")
    alarm: Alarm


class AlarmNote(Body):
    """A note of a person about an alarm; both fields may be left out."""

    comment: GivenText = Field("", max_length=2000)
    work_order: GivenText = Field("", max_length=100, description="number of a work order in the plant's system")


class AlarmComment(AlarmNote):
    """A comment, a work order, or both."""

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if not self.comment and not self.work_order:
            raise ValueError("give comment, work_order or both")
        return self


class AlarmShelf(AlarmNote):
    """End of the shelving of an alarm: either until or duration_s."""

    until: GivenTime | None = Field(None, description="ISO 8601 with time zone; at most seven days from now")
    duration_s: float | None = Field(None, allow_inf_nan=False, description="from now on [s]; at most seven days")

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        if (self.until is None) == (self.duration_s is None):
            raise ValueError("give one of until and duration_s")
        return self


class AlarmFrequency(Body):
    """How often alarms with the same axis, parameter and direction were raised."""

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
    """Alarm load of an operator (EEMUA 191, ISA-18.2)."""

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
