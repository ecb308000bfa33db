"""The alarm journal: alarms, their states and transitions on the disk."""

import sqlite3
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from monitor_core.detection import Alarm
from monitor_core.monitoring import (
    AlarmEvent,
    AlarmRules,
    check_shelf,
    due,
    is_present,
    returns_us,
    transition,
)
from service.store.alarm_entries import AlarmEntry, record_entry, shelved_alike
from service.store.alarm_filter import EVERY_ALARM, AlarmFilter
from service.store.alarm_statistics import (
    GROUP,
    AlarmStatistics,
    StateCount,
    state_counts,
    statistics,
)
from service.store.alarm_table import MIGRATIONS as TABLE_MIGRATIONS
from service.store.alarm_table import STANDING, RecordedAlarm, alarm_by_id, not_ended, select_alarms
from service.store.alarm_transitions import (
    IDENTITY_MIGRATION,
    MIGRATION,
    SERVICE,
    Note,
    NumberedTransition,
    RecordedTransition,
    end_shelf,
    take,
    taken,
    taken_after,
)
from service.store.audit import AuditEntry, Place, audited
from service.store.axis_services import SERVICE_MIGRATION, AxisServices, removal
from service.store.database import Store
from service.store.epochs import EPOCH_MIGRATION, Epochs

MIGRATIONS = (*TABLE_MIGRATIONS, MIGRATION, IDENTITY_MIGRATION, EPOCH_MIGRATION, SERVICE_MIGRATION)


class UnknownAlarmError(LookupError):
    """The journal has no alarm with this id."""


class Journal(Store):
    """Alarms with their states and transitions."""

    def __init__(self, path: Path) -> None:
        self._groups: dict[str, str] = {}
        super().__init__(path, MIGRATIONS, "FULL", {GROUP: self._group})
        with self._db.read() as connection:
            self.identity = str(connection.execute("SELECT identity FROM journal_identity").fetchone()[0])
            """Random identity of this file, which stays when the file is moved"""
        self.epochs = Epochs(self._db, _end_open)
        """Epochs of the axes; in the same file, as they change in one transaction with the alarms"""
        self.services = AxisServices(self._db, self._apply_service)
        """Axes that a person has taken out of service; in the same file, as they change in one transaction with the
        alarms"""
        self._rules: dict[tuple[str, str], AlarmRules] = {}

    def record(self, entries: Iterable[AlarmEntry]) -> list[int]:
        """Insert alarms, or update open alarms of the same axis, parameter and direction; all or none.

        Returns their ids; the alarms are on the disk then.
        """
        with self._db.write() as connection:
            return [record_entry(connection, entry) for entry in entries]

    def open_alarms(self, axis: str) -> list[Alarm]:
        """The alarms of an axis that have not ended, oldest first."""
        with self._db.read() as connection:
            return [alarm.monitored for alarm in not_ended(connection, axis)]

    def ended_alarms(self, axis: str, limit: int) -> list[Alarm]:
        """The last ``limit`` ended alarms of the present epoch of an axis, oldest first, without forecasts."""
        last = (
            "WHERE axis = :axis AND ended_us IS NOT NULL AND kind <> 'forecast' AND raised_us >= coalesce((SELECT"
            " in_force_us FROM epoch WHERE axis = :axis AND source <> 'configuration' AND state IN"
            " ('verifying', 'current')), raised_us) ORDER BY ended_us DESC, id DESC LIMIT :limit"
        )
        with self._db.read() as connection:
            found = select_alarms(connection, last, {"axis": axis, "limit": limit})
            return [alarm.monitored for alarm in reversed(found)]

    def close_unmonitored(self, axis: str, monitored: Iterable[str], at_us: int) -> list[RecordedAlarm]:
        """End the open alarms of parameters that the axis no longer monitors; returns them."""
        names = set(monitored)
        with self._db.write() as connection:
            stale = [alarm for alarm in not_ended(connection, axis) if alarm.parameter not in names]
            return _end(connection, stale, Note(at_us, SERVICE), {})

    def group(self, groups: Mapping[str, str]) -> None:
        """Set the group of each axis, in which the first of several alarms is determined; default: the robot."""
        self._groups = dict(groups)

    def _group(self, axis: str) -> str:
        return self._groups.get(axis) or axis.partition(".")[0]

    def apply_rules(self, rules: Mapping[tuple[str, str], AlarmRules], at_us: int) -> None:
        """Apply the configured rules, which may have changed, to active and hidden alarms.

        Args:
            rules: by axis and parameter; other alarms stay as they are.
            at_us: the present time.
        """
        self._rules |= rules
        with self._db.write() as connection:
            self._end_delays(connection, at_us)
            for alarm in select_alarms(connection, STANDING):
                own = rules.get((alarm.axis, alarm.parameter))
                if own is not None:
                    connection.execute("UPDATE alarm SET priority = ? WHERE id = ?", [own.priority, alarm.id])
                    _apply(connection, alarm, own, Note(at_us, SERVICE))

    def _apply_service(self, connection: sqlite3.Connection, axis: str, note: Note) -> None:
        """Apply a removal from service, or a return, to the alarms of an axis."""
        for alarm in select_alarms(connection, f"{STANDING} AND axis = ?", [axis]):
            own = self._rules.get((axis, alarm.parameter), AlarmRules())
            _apply(connection, alarm, own, note, note.who)

    def act(self, alarm_id: int, event: AlarmEvent, note: Note, until_us: int | None = None) -> RecordedAlarm:
        """Record an action of a person on an alarm; returns the alarm after it.

        Shelving applies to an axis, parameter and direction: the next alarm with the same name is also shelved, until
            the
        same time, and unshelving one of them unshelves all.

        Raises:
            UnknownAlarmError: there is no such alarm.
            AlarmTransitionError: the action is not possible in the present state of the alarm.
            ShelfEndError: the alarm cannot be shelved until that time.
        """
        if event is AlarmEvent.SHELVE:
            assert until_us is not None
            check_shelf(until_us, note.at_us)
        with self._db.write() as connection:
            alarm = alarm_by_id(connection, alarm_id)
            if alarm is None:
                raise UnknownAlarmError(alarm_id)
            life = end_shelf(connection, alarm_id, alarm.life, note.at_us)
            take(connection, alarm_id, [transition(life, event, until_us)], note)
            if event is AlarmEvent.UNSHELVE:
                for other in shelved_alike(connection, alarm, note.at_us):
                    take(connection, other.id, [transition(other.life, event)], note)
            after = alarm_by_id(connection, alarm_id)
            assert after is not None
            return after

    def end_shelves(self, now_us: int) -> None:
        """Record the end of every shelving and every off-delay that is over."""
        with self._db.write() as connection:
            for alarm in select_alarms(connection, "WHERE state = 'shelved'"):
                end_shelf(connection, alarm.id, alarm.life, now_us)
            self._end_delays(connection, now_us)

    def _end_delays(self, connection: sqlite3.Connection, now_us: int) -> None:
        for alarm in select_alarms(connection, f"{STANDING} AND ended_us IS NOT NULL"):
            own = self._rules.get((alarm.axis, alarm.parameter), AlarmRules())
            at_us = returns_us(alarm.life, alarm.ended_us, own)
            if at_us is not None and at_us <= now_us:
                _apply(connection, alarm, own, Note(at_us, SERVICE))

    def statistics(self, since_us: int, until_us: int) -> AlarmStatistics:
        """Statistics of the alarms raised in this period."""
        with self._db.read() as connection:
            return statistics(connection, since_us, until_us)

    def state_counts(self) -> list[StateCount]:
        """Number of alarms by state and priority."""
        with self._db.read() as connection:
            return state_counts(connection)

    @property
    def revision(self) -> int:
        """A number that changes with every write."""
        return self._db.revision

    def last_id(self) -> int:
        """Id of the alarm that was inserted last; 0: there is none."""
        with self._db.read() as connection:
            found = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'alarm'").fetchone()
            return int(found[0]) if found else 0

    def standing(self) -> list[RecordedAlarm]:
        """Active and hidden alarms, oldest first."""
        with self._db.read() as connection:
            return select_alarms(connection, f"{STANDING} ORDER BY raised_us, id")

    def transitions(self, alarm_id: int) -> list[RecordedTransition]:
        """The transitions of an alarm, oldest first."""
        with self._db.read() as connection:
            return taken(connection, alarm_id)

    def audit(self, limit: int, after: Place | None = None) -> list[AuditEntry]:
        """The latest changes by persons and configurations, newest first; ``after``: only those before this place."""
        with self._db.read() as connection:
            return audited(connection, limit, after)

    def transitions_after(self, number: int, limit: int) -> list[NumberedTransition]:
        """The first ``limit`` transitions of all alarms after this number, in the order of their commits."""
        with self._db.read() as connection:
            return taken_after(connection, number, limit)

    def last_transition(self) -> int:
        """Number of the last transition; 0: there is none."""
        with self._db.read() as connection:
            return int(connection.execute("SELECT coalesce(max(id), 0) FROM alarm_transition").fetchone()[0])

    def get(self, alarm_id: int) -> RecordedAlarm | None:
        """The alarm with this id; None: there is none."""
        with self._db.read() as connection:
            return alarm_by_id(connection, alarm_id)

    def query(
        self,
        wanted: AlarmFilter = EVERY_ALARM,
        *,
        limit: int = 100,
        after: tuple[int, int] | None = None,
        now_us: int = 0,
    ) -> tuple[list[RecordedAlarm], int]:
        """The wanted alarms, latest first, and the number of all of them without the limit.

        Args:
            wanted: conditions that they meet.
            limit: most alarms to return.
            after: only alarms that follow, in this order, the one with this time of raising and id.
            now_us: the present time, for stale alarms.
        """
        where, values = wanted.where(now_us)
        with self._db.read() as connection:
            total = connection.execute(f"SELECT count(*) FROM alarm {where}", values).fetchone()[0]
            rest = f"{where or 'WHERE TRUE'} AND (raised_us, id) < (?, ?) ORDER BY raised_us DESC, id DESC LIMIT ?"
            alarms = select_alarms(connection, rest, [*values, *(after or _BEFORE_ALL), limit])
        return alarms, int(total)


_BEFORE_ALL = (2**63 - 1, 2**63 - 1)


def _apply(
    connection: sqlite3.Connection, alarm: RecordedAlarm, rules: AlarmRules, note: Note, by: str | None = None
) -> None:
    """Record the transitions that are due at the time of the note; ``by``: who has changed the service of the axis."""
    own, removed_by = removal(connection, alarm.axis, rules)
    changes = due(alarm.life, is_present(alarm.life, alarm.ended_us, note.at_us, own), own)
    take(connection, alarm.id, changes, note, by or removed_by)


def _end_open(connection: sqlite3.Connection, axis: str, note: Note, rules: Mapping[str, AlarmRules]) -> None:
    _end(connection, not_ended(connection, axis), note, rules)


def _end(
    connection: sqlite3.Connection,
    alarms: Iterable[RecordedAlarm],
    note: Note,
    rules: Mapping[str, AlarmRules],
) -> list[RecordedAlarm]:
    """End open alarms; returns them.  ``rules``: by parameter."""
    ended = [replace(alarm, ended_us=max(note.at_us, alarm.updated_us)) for alarm in alarms]
    for alarm in ended:
        connection.execute("UPDATE alarm SET ended_us = ? WHERE id = ?", [alarm.ended_us, alarm.id])
        changes = due(alarm.life, False, rules.get(alarm.parameter, AlarmRules()))
        take(connection, alarm.id, changes, note._replace(at_us=alarm.ended_us or note.at_us))
    return ended
