"""Alarms: reports of a change of an axis, and the form in which open alarms are saved.

An alarm has two stages.  When a test crosses its threshold, something has *changed*.  The cause is *named* later, when
there is enough evidence: after a large change, the first test that crosses often belongs to another parameter.
"""

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import finite
from monitor_core.drive import DELAY, LOAD

DetectorName = Literal["cusum", "multimodel"]
"""cusum: the paper's two tests of each parameter; multimodel: parallel hypotheses, one predictor for each."""

Direction = Literal["up", "down"]
DIRECTIONS: tuple[Direction, Direction] = ("up", "down")

Stage = Literal["changed", "named"]
"""changed: something has changed; named: the cause is known."""

ChangeKind = Literal["", "step", "drift", "forecast"]
"""step: the change was sudden; drift: it was gradual; empty: not known.  forecast: nothing has changed yet, but a drift
is about to reach a limit."""

Doubt = Literal["", "several", "model", "sign", "still"]
"""several: no single parameter explains the change; model: the model no longer holds, so a sensor fault is more likely
than any parameter; sign: the data look as if torque or motion had changed its sign, or were stuck; still: the axis does
not move when torque is applied."""

NO_PARAMETER: tuple[Doubt, ...] = ("model", "sign", "still")
"""With these doubts a sensor or a wire is a more likely cause than any parameter."""

MAX_EARLIER_NAMES = 20

MODEL_ERROR = 0.03
"""Error of a size, as a share of it, because no model is exact; part of each reported standard deviation.  With
it sizes of axes of five masses that are watched with three lie within their 90 % about as often as that."""

MIN_PROBABILITY = 0.01
"""Causes below this probability are not reported."""


# --- Causes: the monitored parameters, another payload, and faults of sensors -----------------------------------------


TORQUE_CONSTANT = "kT"

TORQUE_SCALE, OUTPUT_SCALE = "torque scale", "output scale"
TORQUE_SIGN, OUTPUT_SIGN = "torque sign", "output sign"
TORQUE_OFFSET, OUTPUT_OFFSET = "torque offset", "output offset"
TORQUE_STUCK, TORQUE_LOST = "torque stuck", "torque lost"
OUTPUT_STUCK, OUTPUT_NOISE = "output stuck", "output noise"
INERTIA = "inertia"
"""Ratio of the inertia on the arm side to its nominal value, if no inertia is monitored.  On an axis that bears no
weight, another payload changes nothing else; without this cause it would be reported as another fault.  An axis that
bears a weight has the cause LOAD for this, if the weight is not monitored."""
SENSOR_FAULTS = (
    *(TORQUE_SCALE, OUTPUT_SCALE, TORQUE_SIGN, OUTPUT_SIGN, TORQUE_OFFSET, OUTPUT_OFFSET),
    *(TORQUE_STUCK, TORQUE_LOST, OUTPUT_STUCK, OUTPUT_NOISE, DELAY),
)


class Cause(NamedTuple):
    """A possible cause.  ``alike``: other causes that produce the same data; any of them may be the true one."""

    parameter: str
    probability: float
    alike: tuple[str, ...] = ()

    @classmethod
    def read(cls, entry: Sequence[Any]) -> "Cause":
        """A cause from its JSON form."""
        parameter, probability, *alike = entry
        return cls(parameter, probability, tuple(alike[0]) if alike else ())


class Reach(NamedTuple):
    """Forecast of when a parameter reaches a limit of the user; see monitor_core.trend.limit_forecast."""

    name: str
    unit: str
    limit: float
    above: bool
    """True for an upper limit"""
    state: str
    low_us: int
    high_us: int | None


class FormerName(NamedTuple):
    """An earlier name of an alarm, valid until a time."""

    until_us: int
    stage: Stage
    parameter: str
    direction: Direction


class Onset(NamedTuple):
    """Time of a change [us] with its 90 % interval; an unknown end of the interval is None.  Fields as in ``Alarm``."""

    onset_us: int
    onset_low_us: int | None
    onset_high_us: int | None

    @classmethod
    def within(cls, best_us: int, low_us: int | None, high_us: int | None) -> "Onset":
        """An onset with the likeliest time moved into its interval; if low is above high, low becomes high."""
        if high_us is not None:
            best_us = min(best_us, high_us)
            low_us = None if low_us is None else min(low_us, high_us)
        return cls(best_us if low_us is None else max(best_us, low_us), low_us, high_us)

    def until(self, latest_us: int) -> "Onset":
        """The onset, limited to ``latest_us``, at which the change was already present.

        If the whole interval is later, only this limit is known.
        """
        if self.onset_low_us is not None and self.onset_low_us > latest_us:
            return Onset(latest_us, None, latest_us)
        high_us = None if self.onset_high_us is None else min(self.onset_high_us, latest_us)
        return Onset.within(min(self.onset_us, latest_us), self.onset_low_us, high_us)


class Leading(NamedTuple):
    """The cause whose test is nearest its threshold, and its evidence g / h; an empty cause: no sample yet."""

    cause: str
    evidence: float


AlarmKey = tuple[int, str, Direction]
"""Identity of an alarm: time at which it was raised, parameter and direction of its first name."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm of one axis.  Times in microseconds since 1970, sizes in the unit of the parameter.

    Attributes:
        parameter: the best name so far: a monitored parameter, or another cause, such as "torque offset".
        direction: of the change: "up" or "down".
        onset_us: likeliest time of the change.
        raised_us: time of the first detection.
        updated_us: time of the last crossing, name or evidence.
        ended_us: time of the end; None: the alarm is open.
        size: theta - theta_0; None: not known yet, or the cause has no size.
        size_sd: standard deviation of ``size``; None as there.
        crossings: number of times that a test has crossed its threshold.
        stage: "changed": something has changed; "named": the cause is known.
        causes: possible causes, the likeliest first; causes below one percent are left out.
        doubt: why the name may be wrong, see ``Doubt``; empty: no doubt.
        onset_low_us: the onset lies between low and high with a probability of 90 %; None: unknown.
        onset_high_us: the other end of that interval.
        kind: "step", "drift" or "forecast", see ``ChangeKind``; empty: not known.
        past: earlier names.
        reaches: the limit, for a forecast.
        inside_calibration: whether the alarm was raised within the calibrated conditions; None: unknown.
        reopened_us: time at which the cause was detected again after the end; None: the alarm was not reopened.
    """

    parameter: str
    direction: Direction
    onset_us: int
    raised_us: int
    updated_us: int
    ended_us: int | None
    size: float | None
    size_sd: float | None
    crossings: int
    stage: Stage = "changed"
    causes: tuple[Cause, ...] = ()
    doubt: Doubt = ""
    onset_low_us: int | None = None
    onset_high_us: int | None = None
    kind: ChangeKind = ""
    past: tuple[FormerName, ...] = ()
    reaches: tuple[Reach, ...] = ()
    inside_calibration: bool | None = None
    reopened_us: int | None = None

    @property
    def since_us(self) -> int:
        """Time of the last detection of the cause: the reopening, or else the first detection."""
        return self.raised_us if self.reopened_us is None else self.reopened_us

    @property
    def first(self) -> tuple[str, Direction]:
        """Parameter and direction of the first name, which never change."""
        if self.past:
            return self.past[0].parameter, self.past[0].direction
        return self.parameter, self.direction

    @property
    def key(self) -> AlarmKey:
        """Identity of the alarm, which does not change when the alarm is renamed."""
        return self.raised_us, *self.first

    @property
    def onset(self) -> Onset:
        """Onset with its interval."""
        return Onset(self.onset_us, self.onset_low_us, self.onset_high_us)

    def onset_by(self, estimate: Onset) -> Onset:
        """The onset after a later estimate of it; the present one if the estimate belongs to another change.

        A change that began after the alarm was raised did not raise it.  Such an estimate comes from a cause that
        explains more only later, or from the same cause when it is back.  An alarm that was reopened without a name may
        get that of another change.
        """
        later = estimate.onset_low_us is not None and estimate.onset_low_us > self.since_us
        is_back = self.reopened_us is not None and self.stage == "named"
        return self.onset if later or is_back else estimate.until(self.since_us)

    def detected_again(self, time_us: int, crossings: int = 1) -> "Alarm":
        """The alarm after its tests have crossed their thresholds again."""
        return replace(self, updated_us=time_us, crossings=self.crossings + crossings)

    def named(self, time_us: int, parameter: str, direction: Direction, **changes: Any) -> "Alarm":
        """The alarm, named after its likeliest cause from now on; ``changes``: values of further fields."""
        same = (self.stage, self.parameter, self.direction) == ("named", parameter, direction)
        name: dict[str, Any] = {"stage": "named", "parameter": parameter, "direction": direction}
        past = self.past if same else self._earlier_names(time_us)
        return replace(self, updated_us=time_us, past=past, **(name | changes))

    def turned(self, time_us: int, direction: Direction) -> "Alarm":
        """The alarm with this direction of the change."""
        if direction == self.direction:
            return self
        return replace(self, updated_us=time_us, direction=direction, past=self._earlier_names(time_us))

    def ended(self, time_us: int) -> "Alarm":
        """The alarm, ended because its cause is gone, or because it belongs to another alarm."""
        return replace(self, ended_us=time_us)

    def reopened(self, again: "Alarm") -> "Alarm":
        """This ended alarm, reopened by the new alarm ``again`` of the same cause; it keeps its onset and names."""
        now = {name: getattr(again, name) for name in ("updated_us", "size", "size_sd", "causes", "doubt")}
        crossings = self.crossings + again.crossings
        return replace(self, ended_us=None, reopened_us=again.raised_us, crossings=crossings, **now)

    def _earlier_names(self, until_us: int) -> tuple[FormerName, ...]:
        """The earlier names and the present one, valid until a time; the first name is always kept."""
        names = (*self.past, FormerName(until_us, self.stage, self.parameter, self.direction))
        return names if len(names) <= MAX_EARLIER_NAMES else (names[0], *names[2 - MAX_EARLIER_NAMES :])


def direction_of(size: float) -> Direction:
    """Direction of a change; up for an unknown size (NaN)."""
    return "down" if size < 0 else "up"


def alarms_to_array(alarms: Iterable[Alarm]) -> NDArray[np.generic]:
    """Alarms as the bytes of a JSON text (N,), for checkpoints."""
    return np.frombuffer(json.dumps([asdict(alarm) for alarm in alarms]).encode(), np.uint8)


def alarms_from_array(array: NDArray[np.generic], causes: Collection[str]) -> list[Alarm]:
    """Alarms from the bytes of ``alarms_to_array``; alarms whose cause is not in ``causes`` are left out.

    Raises:
        ValueError: the array does not hold alarms.
    """
    try:
        alarms = [_alarm(fields) for fields in json.loads(np.asarray(array, np.uint8).tobytes())]
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"no alarms: {error}") from error
    return [alarm for alarm in alarms if alarm.parameter in causes]


def _alarm(fields: dict[str, Any]) -> Alarm:
    fields |= {name: finite(fields[name]) for name in ("size", "size_sd")}  # earlier versions have saved NaN
    causes = tuple(Cause.read(cause) for cause in fields.pop("causes"))
    past = tuple(FormerName(*name) for name in fields.pop("past"))
    reaches = tuple(Reach(*reach) for reach in fields.pop("reaches", ()))
    return Alarm(**fields, causes=causes, past=past, reaches=reaches)


# --- Another payload, which is no fault: all axes of the robot that carry it show it at the same time -----------------


PAYLOAD_WITHIN_S = 600.0
"""Time within which all axes that carry another payload detect it; up to 277 s were measured (docs/trials.md)."""


def payload_change(alarm: Alarm) -> Direction | None:
    """Change of the payload that may have caused an alarm: up for a heavier one.

    None: the payload is not a possible cause, or the cause is not known yet.  That no single parameter explains all of
    the change is no reason against a payload: one at the tip changes the weights of several links.
    """
    if alarm.stage != "named" or alarm.doubt in NO_PARAMETER or alarm.kind == "forecast":
        return None
    if alarm.parameter in (LOAD, INERTIA):
        return alarm.direction
    if alarm.parameter not in (TORQUE_CONSTANT, TORQUE_SCALE):
        return None
    if not any(LOAD in (cause.parameter, *cause.alike) for cause in alarm.causes):
        return None
    # A heavier weight needs more torque, as a weaker motor does.
    return "down" if alarm.direction == "up" else "up"


def same_payload(alarm: Alarm, others: Iterable[tuple[str, Alarm]]) -> tuple[str, ...]:
    """The other axes whose alarms the same change of the payload explains.

    One change of the payload is likelier than a fault of each drive.  A payload that an axis no longer showed when the
    change of another one began is not the same.  Where the alarm itself does not tell of a payload, these are the axes
    that surely show one, if their changes and its own began together: what a base feels of the payload that it turns
    may look like any fault.

    Args:
        alarm: alarm of an axis.
        others: alarms of the other axes of its robot, each with its axis.
    """
    within_us, change = PAYLOAD_WITHIN_S * 1e6, payload_change(alarm)
    near = [(axis, other) for axis, other in others if abs(other.raised_us - alarm.raised_us) <= within_us]
    if change is None:
        sure = ((axis, other) for axis, other in near if other.parameter in (LOAD, INERTIA) and payload_change(other))
        return tuple(sorted({axis for axis, other in sure if _began_together(alarm, other)}))
    same = ((axis, other) for axis, other in near if payload_change(other) == change)
    return tuple(sorted({axis for axis, a in same if not (_is_over_before(a, alarm) or _is_over_before(alarm, a))}))


def _began_together(alarm: Alarm, other: Alarm) -> bool:
    """Whether both began at once, as far as their onsets are known: a drift has no such second."""
    begins = [(a.onset_low_us, a.onset_high_us) for a in (alarm, other) if a.kind in ("", "step")]
    lows, highs = [low for low, _ in begins if low is not None], [high for _, high in begins if high is not None]
    return len(lows) == len(highs) == 2 and max(lows) <= min(highs)


def _is_over_before(earlier: Alarm, later: Alarm) -> bool:
    """Whether an alarm had ended before the change of another one can have begun."""
    ended_us, begin_us = earlier.ended_us, later.onset_low_us
    return ended_us is not None and begin_us is not None and ended_us < begin_us
