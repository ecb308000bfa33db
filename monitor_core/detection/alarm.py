"""Alarms: what a monitor reports of a change of its axis, and the form in which open alarms are saved.

An alarm has two stages.  When a test crosses its threshold, something has *changed*.  The cause is *named* later, when
there is enough evidence: of large changes, the first test that crosses is often not that of the changed parameter.
"""

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

DetectorName = Literal["cusum", "multimodel"]
"""cusum: the paper's two tests of each parameter; multimodel: parallel hypotheses, one predictor for each."""

Direction = Literal["up", "down"]
DIRECTIONS: tuple[Direction, Direction] = ("up", "down")

Stage = Literal["changed", "named"]
"""changed: something has changed; named: the cause is known."""

Kind = Literal["", "step", "drift", "forecast"]
"""step: the change was sudden; drift: it was gradual; empty: not known.  forecast: nothing has changed yet, but a drift
is about to reach a limit."""

Doubt = Literal["", "several", "model", "sign", "still"]
"""several: no single parameter explains the change; model: the model no longer holds, so a sensor fault is more likely
than any parameter; sign: as if torque or motion had changed its sign, or were stuck; still: the axis does not move when
torque is applied."""

NO_PARAMETER: tuple[Doubt, ...] = ("model", "sign", "still")
"""With these doubts a sensor or a wire is a more likely cause than any parameter."""

MAX_EARLIER_NAMES = 20

MIN_PROBABILITY = 0.01
"""Causes below this probability are not reported."""


class Cause(NamedTuple):
    """A possible cause.  ``alike`` lists causes that produce the same data: it is this one or one of those."""

    parameter: str
    probability: float
    alike: tuple[str, ...] = ()

    @classmethod
    def read(cls, entry: Sequence[Any]) -> "Cause":
        """A cause from its JSON form."""
        parameter, probability, *alike = entry
        return cls(parameter, probability, tuple(alike[0]) if alike else ())


class Reach(NamedTuple):
    """When a parameter reaches a limit that the user has set; see monitor_core.trend.limit_forecast."""

    name: str
    unit: str
    limit: float
    above: bool
    """The limit is an upper one"""
    state: str
    low_us: int
    high_us: int | None


class Name(NamedTuple):
    """An earlier name of an alarm, valid until a time."""

    until_us: int
    stage: Stage
    parameter: str
    direction: Direction


class Onset(NamedTuple):
    """Time of a change [us] with its 90 % interval; None: that end is unknown.  Fields as in ``Alarm``."""

    onset_us: int
    onset_low_us: int | None
    onset_high_us: int | None


class Leading(NamedTuple):
    """The cause whose test is nearest its threshold, and its evidence g / h; an empty cause: no sample yet."""

    cause: str
    evidence: float


AlarmKey = tuple[int, str, Direction]
"""Identity of an alarm: time at which it was raised, parameter and direction of its first name."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm of one axis.  Times in microseconds since 1970, sizes in the unit of the parameter.

    ``parameter`` is the best name so far; ``size`` is theta - theta_0 with its standard deviation.
    """

    parameter: str
    direction: Direction
    onset_us: int
    raised_us: int
    updated_us: int
    ended_us: int | None
    size: float
    size_sd: float
    crossings: int
    stage: Stage = "changed"
    causes: tuple[Cause, ...] = ()
    """The likeliest first; causes below one percent are left out"""
    doubt: Doubt = ""
    onset_low_us: int | None = None
    """The onset lies between these two with a probability of 90 %; None: unknown"""
    onset_high_us: int | None = None
    kind: Kind = ""
    past: tuple[Name, ...] = ()
    """Earlier names"""
    reaches: tuple[Reach, ...] = ()
    """Of a forecast: the limit"""
    inside_calibration: bool | None = None
    """Whether it was raised in the conditions of the calibration; None: unknown"""

    @property
    def first(self) -> tuple[str, Direction]:
        """Parameter and direction of the first name, which never change."""
        if self.past:
            return self.past[0].parameter, self.past[0].direction
        return self.parameter, self.direction

    @property
    def key(self) -> AlarmKey:
        """Identity: it stays the same whatever the alarm is renamed to."""
        return self.raised_us, *self.first

    @property
    def onset(self) -> Onset:
        """Onset with its interval."""
        return Onset(self.onset_us, self.onset_low_us, self.onset_high_us)

    def detected_again(self, time_us: int, crossings: int = 1) -> "Alarm":
        """The alarm after its tests have crossed their thresholds again."""
        return replace(self, updated_us=time_us, crossings=self.crossings + crossings)

    def named(self, time_us: int, parameter: str, size: float, **changes: Any) -> "Alarm":
        """The alarm with its likeliest cause as its name from now on; ``changes``: of further fields."""
        direction = direction_of(size)
        same = (self.stage, self.parameter, self.direction) == ("named", parameter, direction)
        name = {"stage": "named", "parameter": parameter, "direction": direction, "size": size}
        past = self.past if same else self._earlier_names(time_us)
        return replace(self, updated_us=time_us, past=past, **(name | changes))  # type: ignore[arg-type]

    def resized(self, time_us: int, direction: Direction, size: float, size_sd: float) -> "Alarm":
        """The alarm with a better size."""
        past = self.past if direction == self.direction else self._earlier_names(time_us)
        return replace(self, updated_us=time_us, direction=direction, size=size, size_sd=size_sd, past=past)

    def ended(self, time_us: int) -> "Alarm":
        """The alarm when its cause is gone, or when it turns out to belong to another one."""
        return replace(self, ended_us=time_us)

    def _earlier_names(self, until_us: int) -> tuple[Name, ...]:
        """The earlier names and the present one, valid until a time; the first name is always kept."""
        names = (*self.past, Name(until_us, self.stage, self.parameter, self.direction))
        return names if len(names) <= MAX_EARLIER_NAMES else (names[0], *names[2 - MAX_EARLIER_NAMES :])


def direction_of(size: float) -> Direction:
    """Direction of a change; up where there is no size (NaN)."""
    return "down" if size < 0 else "up"


def alarms_to_array(alarms: Iterable[Alarm]) -> NDArray[np.generic]:
    """Alarms as the bytes of a JSON text (N,), for checkpoints."""
    return np.frombuffer(json.dumps([asdict(alarm) for alarm in alarms]).encode(), np.uint8)


def alarms_from_array(array: NDArray[np.generic], causes: Collection[str]) -> list[Alarm]:
    """Alarms from the bytes that ``alarms_to_array`` made; those of other causes than ``causes`` are left out.

    Raises:
        ValueError: the array does not hold alarms.
    """
    try:
        alarms = [_alarm(fields) for fields in json.loads(np.asarray(array, np.uint8).tobytes())]
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"no alarms: {error}") from error
    return [alarm for alarm in alarms if alarm.parameter in causes]


def _alarm(fields: dict[str, Any]) -> Alarm:
    causes = tuple(Cause.read(cause) for cause in fields.pop("causes"))
    past = tuple(Name(*name) for name in fields.pop("past"))
    reaches = tuple(Reach(*reach) for reach in fields.pop("reaches", ()))
    return Alarm(**fields, causes=causes, past=past, reaches=reaches)
