"""Alarms on their way to the journal: an alarm is shown once it is on the disk."""

from collections.abc import Callable, Iterable, Mapping
from time import monotonic
from typing import NamedTuple

import structlog

from monitor_core.detection import Alarm, AlarmKey
from monitor_core.monitoring import AxisMonitor
from service.store.database import StoreError
from service.store.journal import Entry, Journal
from service.texts import episode_words, iso

RETRY_S = 1.0

log = structlog.get_logger(__name__)


class AxisAlarm(NamedTuple):
    """An alarm of an axis that was raised, changed or ended, in its present form."""

    axis_id: str
    alarm: Alarm

    @property
    def key(self) -> tuple[str, AlarmKey]:
        """Of the alarm, whatever becomes of it."""
        return self.axis_id, self.alarm.key


class Quantity(NamedTuple):
    """Unit and nominal value of a cause, for the journal."""

    unit: str
    nominal: float


def quantities(monitors: Mapping[str, AxisMonitor]) -> dict[tuple[str, str], Quantity]:
    """Units and nominal values of all causes that an alarm may name."""
    found = {
        (axis_id, p.name): Quantity(p.unit, float(nominal))
        for axis_id, monitor in monitors.items()
        for p, nominal in zip(monitor.model.parameters, monitor.model.theta0, strict=True)
    }
    for axis_id, monitor in monitors.items():
        if monitor.multimodel is not None:
            for cause in monitor.multimodel.causes:
                nominal, unit, _ = monitor.multimodel.quantity(cause)
                found.setdefault((axis_id, cause), Quantity(unit, nominal))
    return found


class Alarms:
    """Writes changes to the journal and knows which alarms are open there.

    A change that cannot be written waits and is tried again without limit.  Changes wait in the order of their events;
    of each alarm only the last change waits, so their number is bounded by the number of alarms.

    Args:
        journal: where alarms are kept.
        quantities: by axis and parameter.
        clock: seconds, for the time between two tries.
    """

    def __init__(
        self,
        journal: Journal,
        quantities: Mapping[tuple[str, str], Quantity],
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self._journal, self._quantities, self._clock = journal, quantities, clock
        self._open: dict[tuple[str, AlarmKey], AxisAlarm] = {}
        self._waiting: dict[tuple[str, AlarmKey], AxisAlarm] = {}
        self._next_try = -RETRY_S
        self.problem: str | None = None
        """Why alarms wait, for the operator; None while none wait."""

    def adopt(self, open_alarms: Iterable[AxisAlarm]) -> None:
        """Adopt alarms that are open in the journal from an earlier run."""
        self._open |= {change.key: change for change in open_alarms}

    def open(self, axis_id: str) -> tuple[Alarm, ...]:
        """The alarms of an axis that are open in the journal."""
        return tuple(change.alarm for key, change in self._open.items() if key[0] == axis_id)

    def record(self, changes: Iterable[AxisAlarm]) -> None:
        """Add changes, and write all waiting ones, unless the last try has failed a moment ago."""
        for change in changes:
            self._waiting[change.key] = change
        if self._waiting and self._clock() >= self._next_try:
            self._write()

    def _write(self) -> None:
        changes = list(self._waiting.values())
        try:
            self._journal.record([self._entry(change) for change in changes])
        except StoreError as error:
            self._next_try = self._clock() + RETRY_S
            if self.problem is None:
                log.error("alarms cannot be recorded", reason=str(error), alarms=_words(changes))
            self.problem = f"{_words(changes)}: cannot be recorded yet, is tried again: {error}"
            return
        self._waiting.clear()
        self.problem = None
        for change in changes:
            self._show(change)

    def _show(self, change: AxisAlarm) -> None:
        """Show the alarm as it is in the journal, and log the change."""
        key, alarm = change.key, change.alarm
        before = self._open.pop(key, None)
        if alarm.ended_us is not None:
            log.info("alarm ended", **self._facts(change))
            return
        self._open[key] = change
        if before is None:
            again = alarm.reopened_us is not None
            log.warning("alarm reopened" if again else "alarm raised", **self._facts(change))
        elif _name(before.alarm) != _name(alarm):
            log.warning("alarm named", **self._facts(change))

    def _entry(self, change: AxisAlarm) -> Entry:
        unit, nominal = self._quantities[change.axis_id, change.alarm.parameter]
        return Entry(change.axis_id, unit, nominal, change.alarm)

    def _facts(self, change: AxisAlarm) -> dict[str, object]:
        e, quantity = change.alarm, self._quantities[change.axis_id, change.alarm.parameter]
        return {
            "axis": change.axis_id,
            "parameter": e.parameter,
            "direction": e.direction,
            "size": e.size,
            "size_sd": e.size_sd,
            "onset": _onset(e),
            "nominal": quantity.nominal,
            "unit": quantity.unit,
            "stage": e.stage,
            "causes": {cause.parameter: round(cause.probability, 3) for cause in e.causes},
            "words": episode_words(e, quantity.nominal, quantity.unit),
        }


def _name(e: Alarm) -> tuple[str, ...]:
    return e.stage, e.parameter, e.direction, e.doubt


def _onset(e: Alarm) -> dict[str, str]:
    """The onset with the ends of its interval, as far as they are known."""
    times = {"best": e.onset_us, "low": e.onset_low_us, "high": e.onset_high_us}
    return {name: iso(t_us) for name, t_us in times.items() if t_us is not None}


def _words(changes: Iterable[AxisAlarm]) -> str:
    names = (f"{c.axis_id} {c.alarm.parameter} {c.alarm.direction}" for c in changes)
    return f"alarm of {', '.join(dict.fromkeys(names))}"
