"""Transitions of recorded alarms in SQLite: each is a row, written in one transaction with the new state."""

import sqlite3
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from monitor_core.monitoring import AlarmEvent, AlarmLife, AlarmState, Priority, Transition, transition

MIGRATION = """
    ALTER TABLE alarm ADD COLUMN state TEXT NOT NULL DEFAULT 'normal';
    ALTER TABLE alarm ADD COLUMN returns_to TEXT;
    ALTER TABLE alarm ADD COLUMN shelved_until_us INTEGER;
    ALTER TABLE alarm ADD COLUMN priority TEXT NOT NULL DEFAULT 'medium';
    ALTER TABLE alarm ADD COLUMN work_order TEXT NOT NULL DEFAULT '';
    CREATE TABLE alarm_transition (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        alarm_id INTEGER NOT NULL REFERENCES alarm (id),
        at_us INTEGER NOT NULL,
        event TEXT NOT NULL,
        from_state TEXT NOT NULL,
        to_state TEXT NOT NULL,
        until_us INTEGER,
        who TEXT NOT NULL,
        comment TEXT NOT NULL,
        work_order TEXT NOT NULL
    ) STRICT;
    CREATE INDEX alarm_transition_by_alarm ON alarm_transition (alarm_id);
    CREATE INDEX alarm_transition_by_time ON alarm_transition (event, at_us);
    CREATE INDEX alarm_by_state ON alarm (state, priority) WHERE state <> 'normal';
    UPDATE alarm SET state = 'unacknowledged' WHERE ended_us IS NULL;
    INSERT INTO alarm_transition
        (alarm_id, at_us, event, from_state, to_state, who, comment, work_order)
        SELECT id, raised_us, 'raise', 'normal', 'unacknowledged', 'axiswatch', '', ''
        FROM alarm WHERE ended_us IS NULL;
"""
"""Active alarms of an earlier version become unacknowledged."""

IDENTITY_MIGRATION = """
    CREATE TABLE journal_identity (identity TEXT NOT NULL) STRICT;
    INSERT INTO journal_identity VALUES (lower(hex(randomblob(8))));
"""
"""A random identity of the file: a journal that replaces a damaged one numbers its transitions from 1 again."""

SERVICE = "axiswatch"
CONFIGURATION = "configuration"
"""Authors of transitions that no person has made."""

_BY_RULE = dict.fromkeys((AlarmEvent.SUPPRESS, AlarmEvent.UNSUPPRESS), CONFIGURATION)
_SERVICE_EVENTS = (AlarmEvent.REMOVE, AlarmEvent.RETURN)


class Note(NamedTuple):
    """When and by whom a transition was made, with comment and work order."""

    at_us: int
    who: str
    comment: str = ""
    work_order: str = ""


def control_character(text: str) -> str | None:
    """The first control character in a text other than tab and line break, which could move a terminal's cursor.

    None: there is none.
    """
    return next((c for c in text if unicodedata.category(c) == "Cc" and c not in "\t\n\r"), None)


class RecordedTransition(NamedTuple):
    """A transition in the journal.  ``until_us``: end of the shelving."""

    at_us: int
    event: AlarmEvent
    from_state: AlarmState
    to_state: AlarmState
    until_us: int | None
    who: str
    comment: str
    work_order: str


class NumberedTransition(NamedTuple):
    """A transition with its alarm and its number in the journal; numbers increase in the order of commits."""

    number: int
    alarm_id: int
    priority: Priority
    transition: RecordedTransition


def take(
    connection: sqlite3.Connection,
    alarm_id: int,
    changes: Iterable[Transition],
    note: Note,
    removed_by: str = CONFIGURATION,
) -> None:
    """Record transitions of an alarm and its new state; ``removed_by``: who has taken its axis out of service."""
    for change in changes:
        after = change.after
        values = {
            "alarm": alarm_id,
            "at": note.at_us,
            "event": change.event,
            "before": change.before.state,
            "after": after.state,
            "until": after.until_us,
            "below": after.returns_to,
            "who": _BY_RULE.get(change.event, removed_by if change.event in _SERVICE_EVENTS else note.who),
            "comment": note.comment,
            "work_order": note.work_order,
        }
        connection.execute(
            "INSERT INTO alarm_transition"
            " (alarm_id, at_us, event, from_state, to_state, until_us, who, comment, work_order)"
            " VALUES (:alarm, :at, :event, :before, :after, :until, :who, :comment, :work_order)",
            values,
        )
        connection.execute(
            "UPDATE alarm SET state = :after, returns_to = :below, shelved_until_us = :until,"
            " work_order = CASE :work_order WHEN '' THEN work_order ELSE :work_order END WHERE id = :alarm",
            values,
        )


def taken(connection: sqlite3.Connection, alarm_id: int) -> list[RecordedTransition]:
    """The transitions of an alarm, oldest first."""
    query = f"SELECT {_COLUMNS} FROM alarm_transition WHERE alarm_id = ? ORDER BY id"
    return [_read(row) for row in connection.execute(query, [alarm_id])]


def taken_after(connection: sqlite3.Connection, number: int, limit: int) -> list[NumberedTransition]:
    """The first ``limit`` transitions of all alarms after this number, oldest first."""
    query = (
        f"SELECT t.id, alarm_id, priority, {', '.join(f't.{name}' for name in RecordedTransition._fields)}"
        " FROM alarm_transition t JOIN alarm a ON a.id = alarm_id WHERE t.id > ? ORDER BY t.id LIMIT ?"
    )
    rows = connection.execute(query, [number, limit])
    return [NumberedTransition(found, alarm_id, priority, _read(row)) for found, alarm_id, priority, *row in rows]


_COLUMNS = ", ".join(RecordedTransition._fields)


def _read(row: Sequence[Any]) -> RecordedTransition:
    at_us, event, before, after, *rest = row
    return RecordedTransition(at_us, AlarmEvent(event), AlarmState(before), AlarmState(after), *rest)


def end_shelf(connection: sqlite3.Connection, alarm_id: int, life: AlarmLife, now_us: int) -> AlarmLife:
    """Record the end of a shelving that is over; returns the state after it."""
    if life.at(now_us) == life:
        return life
    ended = transition(life, AlarmEvent.SHELF_ENDED)
    take(connection, alarm_id, [ended], Note(min(life.until_us or now_us, now_us), SERVICE))
    return ended.after
