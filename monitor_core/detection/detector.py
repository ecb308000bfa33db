"""What every detector has in common: a name, its causes, its evidence, and the events from which alarms are made.

A detector turns what it has found in the samples into events about alarms: raised, detected again, named, size updated,
ended.  The alarm tracker (monitoring/alarm_tracker.py) applies them, whatever detector they come from.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, TypeVar

from monitor_core.detection.alarm import Alarm, AlarmKey, Cause, Direction, Doubt, Kind

DetectorName = Literal["cusum", "multimodel"]
"""cusum: the paper's two tests of each parameter; multimodel: parallel hypotheses, one predictor for each."""

MIN_PROBABILITY = 0.01
"""Causes below this probability are not reported."""


@dataclass(frozen=True, slots=True)
class Raised:
    """A new alarm."""

    alarm: Alarm


@dataclass(frozen=True, slots=True)
class DetectedAgain:
    """The tests of an open alarm have crossed their thresholds again, ``count`` times."""

    alarm: AlarmKey
    time_us: int
    crossings: int = 1


@dataclass(frozen=True, slots=True)
class CauseNamed:
    """The likeliest cause of an alarm: its name from now on, with size and onset."""

    alarm: AlarmKey
    time_us: int
    parameter: str
    size: float
    size_sd: float
    causes: tuple[Cause, ...]
    doubt: Doubt
    onset: Onset
    kind: Kind


@dataclass(frozen=True, slots=True)
class SizeUpdated:
    """A better size of an alarm; ``causes`` and ``doubt`` are None where they stay the same."""

    alarm: AlarmKey
    time_us: int
    direction: Direction
    size: float
    size_sd: float
    crossings: int = 0
    causes: tuple[Cause, ...] | None = None
    doubt: Doubt | None = None


@dataclass(frozen=True, slots=True)
class Ended:
    """The cause of an alarm is gone, or the alarm belongs to another one."""

    alarm: AlarmKey
    time_us: int


AlarmEvent = Raised | DetectedAgain | CauseNamed | SizeUpdated | Ended


class Onset(NamedTuple):
    """Time of a change [us] with its 90 % interval; None: that end is unknown."""

    time_us: int
    low_us: int | None
    high_us: int | None

    @classmethod
    def of_alarm(cls, alarm: Alarm) -> Onset:
        """The onset as an alarm has it now."""
        return cls(alarm.onset_us, alarm.onset_low_us, alarm.onset_high_us)


class Leading(NamedTuple):
    """The cause whose test is nearest its threshold, and its evidence g / h; an empty cause: no sample yet."""

    cause: str
    evidence: float


E_contra = TypeVar("E_contra", contravariant=True)


class Detector(Protocol[E_contra]):
    """A detector of changes of one axis."""

    @property
    def name(self) -> DetectorName:
        """Which detector it is."""

    @property
    def causes(self) -> tuple[str, ...]:
        """Every cause that its alarms may name."""

    def leading(self) -> Leading:
        """The cause that is nearest its threshold."""

    def interpret(self, event: E_contra, open_alarms: Sequence[Alarm]) -> list[AlarmEvent]:
        """Alarm events that an event of this detector causes, given the open alarms, the oldest first."""

    def adopt(self, alarms: Iterable[Alarm], previous: Iterable[Alarm]) -> None:
        """From now on these alarms are open, in place of the previous ones."""
