"""The alarm journal: every alarm is written to the disk before it is shown."""

import json
import math
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from monitor_core.detection import Alarm, Cause, Name, Reach
from monitor_core.monitoring import (
    AlarmEvent,
    AlarmLife,
    AlarmRules,
    AlarmState,
    Priority,
    Transition,
    check_shelf,
    due,
    is_present,
    returns_us,
    transition,
)
from service.store.alarm_statistics import (
    ACTIVE,
    CHATTERING,
    FOLLOWED,
    FOLLOWS,
    GROUP,
    STALE,
    STALE_S,
    AlarmStatistics,
    StateCount,
    state_counts,
    statistics,
)
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
from service.store.database import Database
from service.store.epochs import EPOCH_MIGRATION, Epochs

MIGRATIONS = (
    """
    CREATE TABLE alarm (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        axis TEXT NOT NULL,
        parameter TEXT NOT NULL,
        direction TEXT NOT NULL CHECK (direction IN ('up', 'down')),
        unit TEXT NOT NULL,
        nominal REAL,
        onset_us INTEGER NOT NULL,
        raised_us INTEGER NOT NULL,
        updated_us INTEGER NOT NULL,
        ended_us INTEGER,
        size REAL,
        size_sd REAL,
        crossings INTEGER NOT NULL
    ) STRICT;
    CREATE UNIQUE INDEX alarm_open ON alarm (axis, parameter, direction) WHERE ended_us IS NULL;
    CREATE INDEX alarm_by_time ON alarm (raised_us);
    """,
    # Alarms are raised, then named: an alarm is known by its first crossing, as its parameter may be corrected.
    """
    DROP INDEX alarm_open;
    ALTER TABLE alarm ADD COLUMN stage TEXT NOT NULL DEFAULT 'changed' CHECK (stage IN ('changed', 'named'));
    ALTER TABLE alarm ADD COLUMN causes TEXT NOT NULL DEFAULT '[]';
    ALTER TABLE alarm ADD COLUMN doubt TEXT NOT NULL DEFAULT '';
    ALTER TABLE alarm ADD COLUMN onset_low_us INTEGER;
    ALTER TABLE alarm ADD COLUMN onset_high_us INTEGER;
    ALTER TABLE alarm ADD COLUMN kind TEXT NOT NULL DEFAULT '';
    ALTER TABLE alarm ADD COLUMN past TEXT NOT NULL DEFAULT '[]';
    ALTER TABLE alarm ADD COLUMN first_parameter TEXT NOT NULL DEFAULT '';
    ALTER TABLE alarm ADD COLUMN first_direction TEXT NOT NULL DEFAULT '';
    UPDATE alarm SET first_parameter = parameter, first_direction = direction;
    CREATE INDEX alarm_open ON alarm (axis) WHERE ended_us IS NULL;
    """,
    # Forecasts: the limit that is about to be reached, and when.
    """
    ALTER TABLE alarm ADD COLUMN reaches TEXT NOT NULL DEFAULT '[]';
    """,
    # Whether an alarm was raised in the conditions of the calibration; unknown of those of before.
    """
    ALTER TABLE alarm ADD COLUMN inside_calibration INTEGER;
    """,
    # An alarm whose cause comes back soon is reopened.
    """
    ALTER TABLE alarm ADD COLUMN reopened_us INTEGER;
    """,
    # The life cycle: acknowledged, shelved, suppressed.
    MIGRATION,
    # Plant links know the journal by it.
    IDENTITY_MIGRATION,
    EPOCH_MIGRATION,
    SERVICE_MIGRATION,
)


AlarmFilter = AlarmState | Literal["active", "stale", "chattering"]
"""A state; or: the cause is there; or for more than 24 hours; or raised three times within ten minutes."""


# --- What the journal has, and what it is given -----------------------------------------------------------------------


class UnknownAlarmError(LookupError):
    """The journal has no alarm of that id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedAlarm(Alarm):
    """An alarm in the journal.  Times in microseconds since 1970; nominal and size in ``unit``."""

    id: int
    axis: str
    unit: str
    nominal: float
    recorded: bool = True
    """Whether the journal has it"""
    state: AlarmState = AlarmState.NORMAL
    returns_to: AlarmState | None = None
    """Of a hidden alarm: the state below"""
    shelved_until_us: int | None = None
    priority: Priority = "medium"
    work_order: str = ""
    """The last one that was given; empty: none"""
    follows: int | None = None
    """The alarm of its group that was there when it was raised, the first one; None: there was none"""
    followed: bool = False
    """Whether another axis of its group has an alarm that was raised soon after it"""

    @property
    def first_out(self) -> bool:
        """Whether it is the first of alarms of several axes of its group."""
        return self.followed and self.follows is None

    @property
    def life(self) -> AlarmLife:
        """Its state in its life cycle."""
        return AlarmLife(self.state, self.returns_to, self.shelved_until_us)

    @property
    def active(self) -> bool:
        """Whether the alarm has not ended, or is latched."""
        return self.life.active


_STANDING = "WHERE state <> 'normal' AND state <> 'returned'"
_DERIVED = {"follows": FOLLOWS, "followed": FOLLOWED}
_NAMES = tuple(f.name for f in fields(RecordedAlarm) if f.name not in {"recorded", *_DERIVED})
_OWN = {"id", "axis", "unit", "nominal", "state", "returns_to", "shelved_until_us", "priority", "work_order"}
"""Columns that an alarm of a monitor does not have"""
_COLUMNS = ", ".join([*_NAMES, *_DERIVED.values()])
_LISTS: dict[str, Callable[[Sequence[Any]], Cause | Name | Reach]] = {
    "causes": Cause.read,
    "past": Name._make,
    "reaches": Reach._make,
}
"""Kept as JSON, each entry read by one of these."""


class Entry(NamedTuple):
    """An alarm of an axis, to be recorded; the rules are those of its parameter."""

    axis: str
    unit: str
    nominal: float
    alarm: Alarm
    rules: AlarmRules = AlarmRules()
    promised: int = 0
    """The id that a new alarm gets: it was shown before the disk took it; 0: the next one"""
    acknowledged: Note | None = None
    """Who has acknowledged it before the disk took it"""


# --- The journal ------------------------------------------------------------------------------------------------------


class Journal:
    """Alarms in an SQLite file, one writer; may be read from any thread at any time.

    Every method raises StoreError where the file cannot be read or written.

    Raises:
        StoreInUseError: another daemon writes to this file.
        StoreError: the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._groups: dict[str, str] = {}
        self._db = Database(path, MIGRATIONS, "FULL", {GROUP: self._group})
        self.messages = self._db.messages
        with self._db.read() as connection:
            self.identity = str(connection.execute("SELECT identity FROM journal_identity").fetchone()[0])
            """Of this file, in whatever folder: random"""
        self.epochs = Epochs(self._db, _end_open)
        """Nominal values and thresholds of the axes; with their alarms, as both change in one transaction"""
        self.services = AxisServices(self._db, self._obey_service)
        """Which axes persons have taken out of service; in one transaction with their alarms"""
        self._rules: dict[tuple[str, str], AlarmRules] = {}

    def record(self, entries: Iterable[Entry]) -> list[int]:
        """Insert alarms, or update the open one of the same axis, parameter and direction: all or none of them.

        Returns their ids; they are on the disk then.
        """
        with self._db.write() as connection:
            return [_record(connection, entry) for entry in entries]

    def open_alarms(self, axis: str) -> list[Alarm]:
        """The alarms of an axis that have not ended, oldest first."""
        with self._db.read() as connection:
            return [_episode(alarm) for alarm in _open(connection, axis)]

    def ended_alarms(self, axis: str, limit: int) -> list[Alarm]:
        """The alarms of its present epoch that have ended last, the oldest first; forecasts are left out."""
        last = (
            "WHERE axis = :axis AND ended_us IS NOT NULL AND kind <> 'forecast' AND raised_us >= coalesce((SELECT"
            " in_force_us FROM epoch WHERE axis = :axis AND source <> 'configuration' AND state IN"
            " ('verifying', 'current')), raised_us) ORDER BY ended_us DESC, id DESC LIMIT :limit"
        )
        with self._db.read() as connection:
            found = _select(connection, last, {"axis": axis, "limit": limit})
            return [_episode(alarm) for alarm in reversed(found)]

    def close_unmonitored(self, axis: str, monitored: Iterable[str], at_us: int) -> list[RecordedAlarm]:
        """End the open alarms of parameters that the axis no longer monitors; returns them."""
        names = set(monitored)
        with self._db.write() as connection:
            stale = [alarm for alarm in _open(connection, axis) if alarm.parameter not in names]
            return _end(connection, stale, Note(at_us, SERVICE), {})

    def group(self, groups: Mapping[str, str]) -> None:
        """Look for the first of several alarms among axes of one group: by axis; others belong to their robot."""
        self._groups = dict(groups)

    def _group(self, axis: str) -> str:
        return self._groups.get(axis) or axis.partition(".")[0]

    def obey(self, rules: Mapping[tuple[str, str], AlarmRules], at_us: int) -> None:
        """Let the alarms that are active or hidden obey the configuration, which may have changed.

        Args:
            rules: by axis and parameter; other alarms stay as they are.
            at_us: the time now.
        """
        self._rules |= rules
        with self._db.write() as connection:
            self._end_delays(connection, at_us)
            for alarm in _select(connection, _STANDING):
                own = rules.get((alarm.axis, alarm.parameter))
                if own is not None:
                    connection.execute("UPDATE alarm SET priority = ? WHERE id = ?", [own.priority, alarm.id])
                    _obey(connection, alarm, own, Note(at_us, SERVICE))

    def _obey_service(self, connection: sqlite3.Connection, axis: str, note: Note) -> None:
        """Let the alarms of an axis obey what a person has made of its service."""
        for alarm in _select(connection, f"{_STANDING} AND axis = ?", [axis]):
            own = self._rules.get((axis, alarm.parameter), AlarmRules())
            _obey(connection, alarm, own, note, note.who)

    def act(self, alarm_id: int, event: AlarmEvent, note: Note, until_us: int | None = None) -> RecordedAlarm:
        """Record what a person has done about an alarm; returns the alarm then.

        Shelved is an alarm of an axis, parameter and direction: the next one of that name is shelved, too, until the
        same time, and to unshelve one of them unshelves all.

        Raises:
            UnknownAlarmError: there is no such alarm.
            AlarmTransitionError: that is not possible in its present state.
            ShelfEndError: it cannot be shelved until that time.
        """
        if event is AlarmEvent.SHELVE:
            assert until_us is not None
            check_shelf(until_us, note.at_us)
        with self._db.write() as connection:
            alarm = _get(connection, alarm_id)
            if alarm is None:
                raise UnknownAlarmError(alarm_id)
            life = end_shelf(connection, alarm_id, alarm.life, note.at_us)
            take(connection, alarm_id, [transition(life, event, until_us)], note)
            if event is AlarmEvent.UNSHELVE:
                for other in _shelved_alike(connection, alarm, note.at_us):
                    take(connection, other.id, [transition(other.life, event)], note)
            after = _get(connection, alarm_id)
            assert after is not None
            return after

    def end_shelves(self, now_us: int) -> None:
        """Record the end of every shelf and every off-delay that is over."""
        over = "WHERE state = 'shelved' AND shelved_until_us <= ?"
        with self._db.write() as connection:
            for alarm in _select(connection, over, [now_us]):
                end_shelf(connection, alarm.id, alarm.life, now_us)
            self._end_delays(connection, now_us)

    def _end_delays(self, connection: sqlite3.Connection, now_us: int) -> None:
        for alarm in _select(connection, f"{_STANDING} AND ended_us IS NOT NULL"):
            own = self._rules.get((alarm.axis, alarm.parameter), AlarmRules())
            at_us = returns_us(alarm.life, alarm.ended_us, own)
            if at_us is not None and at_us <= now_us:
                _obey(connection, alarm, own, Note(at_us, SERVICE))

    def statistics(self, since_us: int, until_us: int) -> AlarmStatistics:
        """How much the alarms raised in this time ask of an operator."""
        with self._db.read() as connection:
            return statistics(connection, since_us, until_us)

    def state_counts(self) -> list[StateCount]:
        """Number of alarms by state and priority."""
        with self._db.read() as connection:
            return state_counts(connection)

    @property
    def revision(self) -> int:
        """Changes whenever something has been written."""
        return self._db.revision

    def last_id(self) -> int:
        """Id of the alarm that was inserted last; 0: there was none."""
        with self._db.read() as connection:
            found = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'alarm'").fetchone()
            return int(found[0]) if found else 0

    def standing(self) -> list[RecordedAlarm]:
        """The alarms that are active or hidden, oldest first."""
        with self._db.read() as connection:
            return _select(connection, f"{_STANDING} ORDER BY raised_us, id")

    def transitions(self, alarm_id: int) -> list[RecordedTransition]:
        """What has happened to an alarm, oldest first."""
        with self._db.read() as connection:
            return taken(connection, alarm_id)

    def audit(self, limit: int, after: Place | None = None) -> list[AuditEntry]:
        """The latest changes by persons and files, or those before a place, from the newest to the oldest."""
        with self._db.read() as connection:
            return audited(connection, limit, after)

    def transitions_after(self, number: int, limit: int) -> list[NumberedTransition]:
        """The first transitions of all alarms after that number, in the order in which they were committed."""
        with self._db.read() as connection:
            return taken_after(connection, number, limit)

    def last_transition(self) -> int:
        """Number of the last transition; 0: there is none."""
        with self._db.read() as connection:
            return int(connection.execute("SELECT coalesce(max(id), 0) FROM alarm_transition").fetchone()[0])

    def get(self, alarm_id: int) -> RecordedAlarm | None:
        """The alarm of that id."""
        with self._db.read() as connection:
            return _get(connection, alarm_id)

    def query(
        self,
        axis: str | None = None,
        parameter: str | None = None,
        active: bool | None = None,
        since_us: int | None = None,
        until_us: int | None = None,
        limit: int = 100,
        after: tuple[int, int] | None = None,
        state: AlarmFilter | None = None,
        now_us: int = 0,
    ) -> tuple[list[RecordedAlarm], int]:
        """Alarms that match all given conditions, the last raised first, and their number without the limit.

        Args:
            axis: of this axis.
            parameter: of this parameter.
            active: True: not ended, or latched; False: ended.
            since_us: raised at this time or later.
            until_us: raised before this time.
            limit: at most this number.
            after: only those behind the alarm that was raised at this time and has this id.
            state: in this state, or stale or chattering.
            now_us: the time now, for the stale ones.
        """
        equal: dict[str, _Value] = {"axis = ?": axis, "parameter = ?": parameter}
        if state == "stale":
            equal[STALE] = now_us - round(STALE_S * 1e6)
        elif state not in (None, "active", "chattering"):
            equal["state = ?"] = state
        within: dict[str, _Value] = {"raised_us >= ?": since_us, "raised_us < ?": until_us}
        given = {text: value for text, value in (equal | within).items() if value is not None}
        activity = [] if active is None else [ACTIVE if active else f"NOT {ACTIVE}"]
        activity += {"active": [ACTIVE], "chattering": [CHATTERING]}.get(state or "", [])
        conditions = [*given, *activity]
        where = f"WHERE {' AND '.join(conditions)}" if conditions else ""
        values = list(given.values())
        with self._db.read() as connection:
            total = connection.execute(f"SELECT count(*) FROM alarm {where}", values).fetchone()[0]
            rest = f"{where or 'WHERE TRUE'} AND (raised_us, id) < (?, ?) ORDER BY raised_us DESC, id DESC LIMIT ?"
            alarms = _select(connection, rest, [*values, *(after or _BEFORE_ALL), limit])
        return alarms, int(total)

    def close(self) -> None:
        """Close the file."""
        self._db.close()


_Value = str | int | float | None
_BEFORE_ALL = (2**63 - 1, 2**63 - 1)


# --- Since the last start: other rules, and axes that are no more -----------------------------------------------------


def _obey(
    connection: sqlite3.Connection,
    alarm: RecordedAlarm,
    rules: AlarmRules,
    note: Note,
    by: str | None = None,
) -> None:
    """Let an alarm agree with its cause and its rules at the time of the note; ``by``: who has changed its service."""
    own, removed_by = removal(connection, alarm.axis, rules)
    changes = due(alarm.life, is_present(alarm.life, alarm.ended_us, note.at_us, own), own)
    take(connection, alarm.id, changes, note, by or removed_by)


def _end_open(connection: sqlite3.Connection, axis: str, note: Note, rules: Mapping[str, AlarmRules]) -> None:
    _end(connection, _open(connection, axis), note, rules)


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


# --- An alarm and what becomes of it ----------------------------------------------------------------------------------


def _record(connection: sqlite3.Connection, entry: Entry) -> int:
    known = _known(connection, entry)
    alarm_id = _insert(connection, entry) if known is None else _update(connection, entry, known)
    life = AlarmLife() if known is None else known.life
    rules, removed_by = removal(connection, entry.axis, entry.rules)
    if known is not None and _is_named_anew(known, entry.alarm):
        e = entry.alarm
        at_us = e.past[-1].until_us if e.past else e.updated_us
        take(connection, alarm_id, [transition(life, AlarmEvent.NAME)], Note(at_us, SERVICE))
    for change, note in lived(life, _courses(known, entry.alarm, rules), rules, entry.acknowledged):
        take(connection, alarm_id, [change], note, removed_by)
        life = change.after
    if life.active and not life.hidden:
        _shelve_with_others(connection, alarm_id, life)
    return alarm_id


def lived(
    life: AlarmLife, courses: Iterable[tuple[bool, int]], rules: AlarmRules, acknowledged: Note | None
) -> Iterator[tuple[Transition, Note]]:
    """The transitions of an alarm whose cause is there or not, each since a time, and which a person acknowledges."""
    for present, at_us in courses:
        if acknowledged is not None and acknowledged.at_us < at_us and life.state in _OPEN_TO_ACKNOWLEDGE:
            yield (change := transition(life, AlarmEvent.ACKNOWLEDGE)), acknowledged
            life, acknowledged = change.after, None
        for change in due(life, present, rules):
            yield change, Note(at_us, SERVICE)
            life = change.after
    if acknowledged is not None and life.state in _OPEN_TO_ACKNOWLEDGE:
        yield transition(life, AlarmEvent.ACKNOWLEDGE), acknowledged


_OPEN_TO_ACKNOWLEDGE = (AlarmState.UNACKNOWLEDGED, AlarmState.RETURNED, AlarmState.LATCHED)


def _update(connection: sqlite3.Connection, entry: Entry, known: RecordedAlarm) -> int:
    e = entry.alarm
    changed = _columns_of(entry)
    if known.raised_us != e.raised_us:
        # The first onset and time are kept: a monitor that lost its state raises the same alarm again.
        changed = {name: changed[name] for name in ("updated_us", "ended_us", "size", "size_sd")}
    else:
        del changed["raised_us"]
    texts = [f"{name} = :{name}" for name in changed]
    texts.append("crossings = max(crossings, :again)")
    values = changed | {"again": e.crossings, "id": known.id}
    connection.execute(f"UPDATE alarm SET {', '.join(texts)} WHERE id = :id", values)
    return known.id


def _is_named_anew(known: RecordedAlarm, e: Alarm) -> bool:
    """Whether the cause of an alarm has been found since its last record, or is another one than was found."""
    same = known.raised_us == e.raised_us and e.stage == "named"
    return same and any(
        getattr(known, n) != getattr(e, n) for n in ("stage", "parameter", "direction", "doubt")
    )


def _courses(known: RecordedAlarm | None, e: Alarm, rules: AlarmRules) -> Iterator[tuple[bool, int]]:
    """Whether the cause was there, and since when, from the last record to this one.

    Less than the off-delay without it does not count, nor does its end before the off-delay is over.
    """
    if known is None:
        yield True, e.raised_us
    again, same = e.reopened_us, known is None or known.raised_us == e.raised_us
    if again is not None and same and (known is None or known.reopened_us != again):
        away_us = None
        if known is not None:
            away_us = known.updated_us if known.ended_us is None else known.ended_us
        if known is None or not is_present(known.life, away_us, again, rules):
            yield False, again
            yield True, again
    if e.ended_us is None:
        yield True, e.updated_us
    elif not rules.off_delay_s:
        yield False, e.ended_us


def _shelve_with_others(connection: sqlite3.Connection, alarm_id: int, life: AlarmLife) -> None:
    """Shelve an alarm while another one of its axis, parameter and direction is shelved."""
    alarm = _get(connection, alarm_id)
    assert alarm is not None
    for other in _shelved_alike(connection, alarm, alarm.updated_us)[:1]:
        change = transition(life, AlarmEvent.SHELVE, other.shelved_until_us)
        comment = f"as alarm {other.id}, which is shelved"
        take(connection, alarm_id, [change], Note(alarm.updated_us, SERVICE, comment))


def _shelved_alike(connection: sqlite3.Connection, alarm: RecordedAlarm, now_us: int) -> list[RecordedAlarm]:
    """The other alarms of its axis, parameter and direction that are shelved, the longest first."""
    alike = (
        "WHERE axis = ? AND parameter = ? AND direction = ? AND (kind = 'forecast') = ? AND id <> ?"
        " AND state = 'shelved' AND shelved_until_us > ? ORDER BY shelved_until_us DESC"
    )
    name: list[_Value] = [alarm.axis, alarm.parameter, alarm.direction, alarm.kind == "forecast"]
    return _select(connection, alike, [*name, alarm.id, now_us])


def _known(connection: sqlite3.Connection, entry: Entry) -> RecordedAlarm | None:
    """The alarm that the entry belongs to: the same alarm, or else an open one of the same name.

    A forecast is something else than a change of the same parameter, and belongs only to itself.  So does an alarm that
    has ended, so that recording it again cannot end a later one, and an alarm that has been renamed: another one of
    that name is about to end.
    """
    e = entry.alarm
    parameter, direction = e.first
    values: dict[str, _Value] = {
        "axis": entry.axis,
        "parameter": parameter,
        "direction": direction,
        "raised": e.raised_us,
        "forecast": e.kind == "forecast",
    }
    itself = (
        "WHERE axis = :axis AND first_parameter = :parameter AND first_direction = :direction"
        " AND raised_us = :raised AND (kind = 'forecast') = :forecast ORDER BY id DESC LIMIT 1"
    )
    found = _select(connection, itself, values)
    if not found and e.ended_us is None and e.stage == "changed":
        alike = (
            "WHERE axis = :axis AND parameter = :parameter AND direction = :direction AND ended_us IS NULL"
            " AND kind <> 'forecast' LIMIT 1"
        )
        found = _select(connection, alike, values)
    return found[0] if found else None


# --- Rows of the table ------------------------------------------------------------------------------------------------


def _insert(connection: sqlite3.Connection, entry: Entry) -> int:
    e = entry.alarm
    values = _columns_of(entry) | {"crossings": e.crossings}
    values |= dict(zip(("first_parameter", "first_direction"), e.first, strict=True))
    if entry.promised and _get(connection, entry.promised) is None:
        values["id"] = entry.promised
    places = ", ".join(f":{name}" for name in values)
    cursor = connection.execute(f"INSERT INTO alarm ({', '.join(values)}) VALUES ({places})", values)
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def _columns_of(entry: Entry) -> dict[str, _Value]:
    """The columns that may change between records; crossings only grow."""
    e = entry.alarm
    own: dict[str, _Value] = {
        "axis": entry.axis,
        "unit": entry.unit,
        "nominal": entry.nominal,
        "priority": entry.rules.priority,
    }
    shared = [name for name in _NAMES if name not in {"crossings", *_OWN, *_LISTS}]
    lists: dict[str, _Value] = {name: json.dumps(getattr(e, name)) for name in _LISTS}
    return own | {name: getattr(e, name) for name in shared} | lists


def _get(connection: sqlite3.Connection, alarm_id: int) -> RecordedAlarm | None:
    return next(iter(_select(connection, "WHERE id = ?", [alarm_id])), None)


def _open(connection: sqlite3.Connection, axis: str) -> list[RecordedAlarm]:
    return _select(connection, "WHERE axis = ? AND ended_us IS NULL ORDER BY raised_us, id", [axis])


def _select(
    connection: sqlite3.Connection, rest: str, values: Sequence[_Value] | Mapping[str, _Value] = ()
) -> list[RecordedAlarm]:
    return [_alarm(row) for row in connection.execute(f"SELECT {_COLUMNS} FROM alarm {rest}", values)]


def _alarm(row: tuple[Any, ...]) -> RecordedAlarm:
    values: dict[str, Any] = dict(zip((*_NAMES, *_DERIVED), row, strict=True))
    if values["nominal"] is None:  # SQLite keeps NaN as NULL
        values["nominal"] = math.nan
    inside = values["inside_calibration"]
    values["inside_calibration"] = None if inside is None else bool(inside)
    values["followed"] = bool(values["followed"])
    values["state"] = AlarmState(values["state"])
    values["returns_to"] = values["returns_to"] and AlarmState(values["returns_to"])
    for name, read in _LISTS.items():
        values[name] = tuple(read(entry) for entry in json.loads(values[name]))
    return RecordedAlarm(**values)


def _episode(a: RecordedAlarm) -> Alarm:
    return Alarm(**{field.name: getattr(a, field.name) for field in fields(Alarm)})
