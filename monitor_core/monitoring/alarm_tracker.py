"""Open alarms of one axis: events of a detector are applied, changed alarms are returned."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from monitor_core.detection.alarm import Alarm, AlarmKey, direction_of
from monitor_core.detection.detector import (
    AlarmEvent,
    CauseNamed,
    DetectedAgain,
    Raised,
    SizeUpdated,
)


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

    def apply(self, events: Iterable[AlarmEvent]) -> list[Alarm]:
        """Apply events; returns the alarms that they raised, changed or ended, each in its latest form."""
        changed: dict[AlarmKey, Alarm] = {}
        for event in events:
            alarm = self._applied(event)
            changed[alarm.key] = alarm
            if alarm.ended_us is None:
                self._open[alarm.key] = alarm
            else:
                del self._open[alarm.key]
        return list(changed.values())

    def _applied(self, event: AlarmEvent) -> Alarm:
        if isinstance(event, Raised):
            return event.alarm
        alarm = self._open[event.alarm]
        if isinstance(event, DetectedAgain):
            return replace(alarm, updated_us=event.time_us, crossings=alarm.crossings + event.crossings)
        if isinstance(event, CauseNamed):
            return _named(alarm, event)
        if isinstance(event, SizeUpdated):
            return _resized(alarm, event)
        return replace(alarm, ended_us=event.time_us)


def _named(alarm: Alarm, event: CauseNamed) -> Alarm:
    direction = direction_of(event.size)
    unchanged = (alarm.stage, alarm.parameter, alarm.direction) == ("named", event.parameter, direction)
    return replace(
        alarm,
        parameter=event.parameter,
        direction=direction,
        stage="named",
        updated_us=event.time_us,
        size=event.size,
        size_sd=event.size_sd,
        causes=event.causes,
        doubt=event.doubt,
        onset_us=event.onset.time_us,
        onset_low_us=event.onset.low_us,
        onset_high_us=event.onset.high_us,
        kind=event.kind,
        past=alarm.past if unchanged else alarm.earlier_names(event.time_us),
    )


def _resized(alarm: Alarm, event: SizeUpdated) -> Alarm:
    turned = event.direction != alarm.direction
    return replace(
        alarm,
        direction=event.direction,
        updated_us=event.time_us,
        size=event.size,
        size_sd=event.size_sd,
        crossings=alarm.crossings + event.crossings,
        causes=alarm.causes if event.causes is None else event.causes,
        doubt=alarm.doubt if event.doubt is None else event.doubt,
        past=alarm.earlier_names(event.time_us) if turned else alarm.past,
    )
