"""Writes alarms to the journal.  An alarm that the disk refuses is shown at once, as not yet recorded."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from time import monotonic
from types import MappingProxyType
from typing import NamedTuple

import structlog

from monitor_core.detection import Alarm, AlarmKey
from monitor_core.monitoring import AlarmEvent, AlarmLife, AlarmRules, returns_us, transition
from monitor_core.wording import sentence
from service.pipeline.axes.axis_alarms import AxisAlarm, JournalQuantity
from service.pipeline.persistence.wall_clock import WallClock
from service.store.alarm_entries import AlarmEntry, lived
from service.store.alarm_statistics import StateCount
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note
from service.store.database import StoreError
from service.store.journal import Journal
from service.texts.alarm_words import episode_words
from service.texts.instants import iso

RETRY_S = 1.0
_PLAIN = AlarmRules()

log = structlog.get_logger(__name__)


def as_recorded(entry: AlarmEntry, alarm_id: int = 0, recorded: bool = True) -> RecordedAlarm:
    """The row that the journal will hold for an alarm; ``alarm_id`` 0: the id is not known yet."""
    ended_us, note = entry.alarm.ended_us, entry.acknowledged
    courses = [(True, entry.alarm.raised_us), *([] if ended_us is None else [(False, ended_us)])]
    life = [AlarmLife(), *(t.after for t, _ in lived(AlarmLife(), courses, entry.rules, note))][-1]
    own = {field.name: getattr(entry.alarm, field.name) for field in fields(Alarm)}
    return RecordedAlarm(
        **own,
        id=alarm_id,
        axis=entry.axis,
        unit=entry.unit,
        nominal=entry.nominal,
        state=life.state,
        returns_to=life.returns_to,
        priority=entry.rules.priority,
        recorded=recorded,
        work_order="" if note is None else note.work_order,
    )


class AlarmsSnapshot(NamedTuple):
    """States of the alarms at one moment, for API, metrics and page."""

    standing: tuple[RecordedAlarm, ...] = ()
    """Recorded alarms that are active or hidden"""
    unrecorded: tuple[RecordedAlarm, ...] = ()
    """Alarms that are not in the journal yet, oldest first, with the ids that the journal will give them (0: not
    known)"""
    waiting: int = 0
    """Number of alarms with changes that are not in the journal yet"""
    states: tuple[StateCount, ...] = ()
    """Number of recorded alarms by state and priority"""
    removed: Mapping[str, Note] = MappingProxyType({})
    """Axes that a person has taken out of service, and that person's note"""


NO_ALARMS = AlarmsSnapshot()


@dataclass(slots=True)
class _WaitingChange:
    """A change of an alarm that is not in the journal yet."""

    change: AxisAlarm
    refused: bool = False
    """Writing it has failed at least once, and that was logged"""
    reserved_id: int = 0
    """The id that a new alarm will have in the journal; 0: not known"""
    acknowledged: Note | None = None
    """The acknowledgement, if the alarm was acknowledged before it was recorded; None: not acknowledged"""


class AlarmRecorder:
    """Writes alarm changes to the journal, knows which alarms are open, and ends shelving when its time is over.

    A change that cannot be written waits, and writing is retried without limit.  Changes wait in the order in which
    they happened.  Only the latest change of each alarm waits, so the number of alarms bounds the queue.  A new alarm
    counts as open before it is recorded.  The end of an alarm, or a new cause for it, counts only once it is recorded.

    Args:
        journal: where alarms are kept.
        quantities: unit and nominal value by axis and cause.
        clock: monotonic clock [s], for the time between two tries.
        rules: configured alarm rules by axis and cause.
        wall: the clock of the samples.  If it is set while an alarm is open, the recorded duration of the alarm is
            still right.
    """

    def __init__(
        self,
        journal: Journal,
        quantities: Mapping[tuple[str, str], JournalQuantity],
        clock: Callable[[], float] = monotonic,
        rules: Mapping[tuple[str, str], AlarmRules] | None = None,
        wall: WallClock | None = None,
    ) -> None:
        self._journal, self._quantities, self._clock = journal, dict(quantities), clock
        self._rules, self._wall = dict(rules or {}), wall or WallClock()
        self._set_by_us: dict[tuple[str, AlarmKey], int] = {}
        """For each open alarm: the sum of all clock steps [us] at the time when it was raised"""
        self._open: dict[tuple[str, AlarmKey], AxisAlarm] = {}
        self._waiting: dict[tuple[str, AlarmKey], _WaitingChange] = {}
        self._next_try = self._next_read = -RETRY_S
        self._revision = -1
        self._recorded = NO_ALARMS
        self.problem: str | None = None
        """Message to the operator: why alarms are not recorded yet; None: all are recorded."""

    @property
    def clock_message(self) -> str | None:
        """Message to the operator that the clock was set; None: it was not."""
        return self._wall.message

    def adopt(self, open_alarms: Iterable[AxisAlarm]) -> None:
        """Adopt alarms that are open in the journal from an earlier run."""
        self._open |= {change.key: change for change in open_alarms}

    def waits_for_journal(self, axis_id: str) -> bool:
        """Try to write all changes; returns whether some alarms of the axis are still not in the journal."""
        self.record(())
        return any(key[0] == axis_id for key in self._waiting)

    def change(
        self,
        axis_ids: Collection[str],
        quantities: Mapping[tuple[str, str], JournalQuantity],
        rules: Mapping[tuple[str, str], AlarmRules],
    ) -> None:
        """Replace the quantities and rules of these axes, and forget their alarms.

        They have new nominal values and no open alarm in the journal, or they are no longer configured.
        """
        self._open = {key: change for key, change in self._open.items() if key[0] not in axis_ids}
        self._waiting = {key: waiting for key, waiting in self._waiting.items() if key[0] not in axis_ids}
        known = {key: q for key, q in self._quantities.items() if key[0] not in axis_ids}
        self._quantities = {**known, **quantities}
        self._rules = {key: own for key, own in self._rules.items() if key[0] not in axis_ids} | {**rules}

    def rules_of(self, axis_id: str) -> dict[str, AlarmRules]:
        """The configured alarm rules of an axis, by cause."""
        return {cause: rules for (axis, cause), rules in self._rules.items() if axis == axis_id}

    def open(self, axis_id: str) -> tuple[Alarm, ...]:
        """The open alarms of an axis, recorded or not."""
        changes = [*self._open.values(), *(waiting.change for waiting in self._unrecorded())]
        own = [change for change in changes if change.axis_id == axis_id]
        return tuple(change.alarm for change in own if change.alarm.ended_us is None)

    def record(self, changes: Iterable[AxisAlarm]) -> None:
        """Add changes and write all that wait, unless the last try failed less than ``RETRY_S`` ago."""
        for change in changes:
            corrected = self._with_true_duration(change)
            self._waiting.setdefault(change.key, _WaitingChange(corrected)).change = corrected
        if self._waiting and self._clock() >= self._next_try:
            self._write()

    def finish(self) -> None:
        """Write all that wait, however shortly ago the last try failed: afterwards they are only in the log."""
        if self._waiting:
            self._write()
        for key, waiting in self._waiting.items():
            note = waiting.acknowledged
            log.error(
                "the last change of a recorded alarm could not be recorded until the end"
                if key in self._open
                else "alarm lost: it could not be recorded until the end",
                **self._facts(waiting.change),
                raised=iso(waiting.change.alarm.raised_us),
                acknowledged=None if note is None else note._asdict(),
                reason=self.problem,
            )

    def snapshot(self, now_us: int) -> AlarmsSnapshot:
        """The states of all alarms now, with everything that persons have done up to now.

        Args:
            now_us: the present time; shelving and off-delays that are over by then are ended.
        """
        over = any(self._is_over(alarm, now_us) for alarm in self._recorded.standing)
        if self._clock() >= self._next_read and (over or self._revision != self._journal.revision):
            self._read_states(now_us, over)
        unrecorded = tuple(map(self._shown_alarm, self._unrecorded()))
        return self._recorded._replace(unrecorded=unrecorded, waiting=len(self._waiting))

    def acknowledge(self, alarm_id: int, note: Note) -> RecordedAlarm | None:
        """Acknowledge an alarm that is not recorded yet; the journal will get the alarm and the acknowledgement.

        Returns the acknowledged alarm; None: no unrecorded alarm has this id.

        Raises:
            AlarmTransitionError: an alarm in this state cannot be acknowledged.
        """
        for waiting in self._unrecorded():
            if waiting.reserved_id == alarm_id:
                transition(self._shown_alarm(waiting).life, AlarmEvent.ACKNOWLEDGE)
                waiting.acknowledged = note
                return self._shown_alarm(waiting)
        return None

    def removed(self, axis_id: str) -> Note | None:
        """Author, time and reason of taking an axis out of service; None: in service."""
        return self._recorded.removed.get(axis_id)

    def _is_over(self, alarm: RecordedAlarm, now_us: int) -> bool:
        """Whether shelving or the off-delay of an alarm is over, but the journal does not know that yet."""
        rules = self._rules.get((alarm.axis, alarm.parameter), _PLAIN)
        at_us = returns_us(alarm.life, alarm.ended_us, rules)
        return alarm.life.at(now_us) != alarm.life or (at_us is not None and at_us <= now_us)

    def _read_states(self, now_us: int, over: bool) -> None:
        """Read the alarm states from the journal; a failure is retried later.

        ``over``: some shelving or off-delay is over, so the journal ends it first.
        """
        try:
            if over:
                self._journal.end_shelves(now_us)
            revision = self._journal.revision
            standing, states = self._journal.standing(), self._journal.state_counts()
            removed = self._journal.services.removed()
        except StoreError as error:
            if self._next_read < 0:
                log.error("the states of the alarms are not up to date", reason=str(error))
            self._next_read = self._clock() + RETRY_S
            return
        self._recorded = AlarmsSnapshot(tuple(standing), states=tuple(states), removed=removed)
        self._revision, self._next_read = revision, -RETRY_S

    def _unrecorded(self) -> list[_WaitingChange]:
        return [waiting for key, waiting in self._waiting.items() if key not in self._open]

    def _write(self) -> None:
        every = list(self._waiting.values())
        try:
            self._journal.record([self._entry(waiting) for waiting in every])
        except StoreError as error:
            self._next_try = self._clock() + RETRY_S
            if new := [waiting for waiting in every if not waiting.refused]:
                log.error("alarms cannot be recorded", reason=str(error), alarms=f"alarm of {_names(new)}")
                for waiting in new:
                    waiting.refused = True
            self._reserve_ids()
            self.problem = sentence(
                "alarm not recorded",
                "alarm of {alarms}: cannot be recorded yet, is tried again: {why}",
                alarms=_names(every),
                why=error.args[0],
            )
            return
        self._waiting.clear()
        self.problem = None
        for waiting in every:
            self._apply(waiting.change)

    def _reserve_ids(self) -> None:
        """Give unrecorded alarms the ids that they will have in the journal."""
        new = [waiting for waiting in self._unrecorded() if not waiting.reserved_id]
        try:
            last = max([self._journal.last_id(), *(waiting.reserved_id for waiting in self._waiting.values())])
        except StoreError:
            return
        for number, waiting in enumerate(new, last + 1):
            waiting.reserved_id = number

    def _apply(self, change: AxisAlarm) -> None:
        """Update the open alarms with a recorded change, and log it."""
        key, alarm = change.key, change.alarm
        before = self._open.pop(key, None)
        if alarm.ended_us is not None:
            self._set_by_us.pop(key, None)
            log.info("alarm ended", **self._facts(change))
            return
        self._open[key] = change
        if before is None:
            reopened = alarm.reopened_us is not None
            log.warning("alarm reopened" if reopened else "alarm raised", **self._facts(change))
        elif _name(before.alarm) != _name(alarm):
            log.warning("alarm named", **self._facts(change))

    def _with_true_duration(self, change: AxisAlarm) -> AxisAlarm:
        """The change, with times that the clock would have shown if it had not been set since the alarm was raised."""
        adopted = change.key in self._open
        set_by = self._wall.set_by_us
        step = set_by - self._set_by_us.setdefault(change.key, 0 if adopted else set_by)
        if not step:
            return change
        alarm = change.alarm
        ended = None if alarm.ended_us is None else alarm.ended_us - step
        return change._replace(alarm=replace(alarm, updated_us=alarm.updated_us - step, ended_us=ended))

    def _entry(self, waiting: _WaitingChange) -> AlarmEntry:
        axis_id, alarm = waiting.change
        unit, nominal = self._quantities[axis_id, alarm.parameter]
        rules = self._rules.get((axis_id, alarm.parameter), _PLAIN)
        return AlarmEntry(axis_id, unit, nominal, alarm, rules, waiting.reserved_id, waiting.acknowledged)

    def _shown_alarm(self, waiting: _WaitingChange) -> RecordedAlarm:
        """The row that the journal will hold; it also says whether a person has taken the axis out of service."""
        entry = self._entry(waiting)
        if entry.axis in self._recorded.removed:
            entry = entry._replace(rules=entry.rules._replace(out_of_service=True))
        return as_recorded(entry, entry.reserved_id, recorded=False)

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
    """The onset and the ends of its interval, those that are known."""
    times = {"best": e.onset_us, "low": e.onset_low_us, "high": e.onset_high_us}
    return {name: iso(t_us) for name, t_us in times.items() if t_us is not None}


def _names(waiting: Iterable[_WaitingChange]) -> str:
    alarms = (w.change for w in waiting)
    names = (f"{axis_id} {alarm.parameter} {alarm.direction}" for axis_id, alarm in alarms)
    return ", ".join(dict.fromkeys(names))
