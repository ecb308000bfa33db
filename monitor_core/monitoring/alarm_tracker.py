"""Open alarms of one axis: the alarms that a detector raises, changes or ends, and what became of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Literal, NamedTuple, TypeVar

from monitor_core.detection.alarm import Alarm, AlarmKey

E = TypeVar("E")


class AlarmChange(NamedTuple):
    """What became of an alarm in one update, and the alarm in its latest form."""

    kind: Literal["raised", "renamed", "updated", "ended"]
    alarm: Alarm


class AlarmTracker:
    """The open alarms of one axis, the oldest first."""

    def __init__(self, open_alarms: Iterable[Alarm] = ()) -> None:
        self._open = {alarm.key: alarm for alarm in open_alarms if alarm.ended_us is None}

    @property
    def open(self) -> tuple[Alarm, ...]:
        """The open alarms."""
        return tuple(self._open.values())

    def is_open(self, parameter: str) -> bool:
        """Whether an open alarm names this parameter, or other cause."""
        return any(alarm.parameter == parameter for alarm in self._open.values())

    def update(
        self, events: Iterable[E], interpret: Callable[[E, Sequence[Alarm]], Iterable[Alarm]]
    ) -> list[AlarmChange]:
        """Take the events of a detector, interpreted with the alarms that are open then; each changed alarm once."""
        before, latest = dict(self._open), dict[AlarmKey, Alarm]()
        for event in events:
            for alarm in interpret(event, self.open):
                latest[alarm.key] = alarm
                if alarm.ended_us is None:
                    self._open[alarm.key] = alarm
                else:
                    self._open.pop(alarm.key, None)
        return [_change(before.get(key), alarm) for key, alarm in latest.items()]


def _change(before: Alarm | None, alarm: Alarm) -> AlarmChange:
    if alarm.ended_us is not None:
        return AlarmChange("ended", alarm)
    if before is None:
        return AlarmChange("raised", alarm)
    names = [(a.stage, a.parameter, a.direction) for a in (before, alarm)]
    return AlarmChange("updated" if names[0] == names[1] else "renamed", alarm)
