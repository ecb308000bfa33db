"""Writes an alarm of a monitor to the journal: as a new row or an update, with the transitions that are due."""

import json
import sqlite3
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from monitor_core.detection import Alarm
from monitor_core.monitoring import (
    AlarmEvent,
    AlarmLife,
    AlarmRules,
    AlarmState,
    Transition,
    due,
    is_present,
    transition,
)
from service.store.alarm_table import LISTS, NAMES, OWN, ColumnValue, RecordedAlarm, alarm_by_id, select_alarms
from service.store.alarm_transitions import SERVICE, Note, take
from service.store.axis_services import removal


class AlarmEntry(NamedTuple):
    """An alarm of an axis to record, with the alarm rules of its parameter."""

    axis: str
    unit: str
    nominal: float
    alarm: Alarm
    rules: AlarmRules = AlarmRules()
    reserved_id: int = 0
    """Id for a new alarm that was shown with this id before it could be recorded; 0: the next free id"""
    acknowledged: Note | None = None
    """The acknowledgement, if the alarm was acknowledged before it could be recorded"""


def record_entry(connection: sqlite3.Connection, entry: AlarmEntry) -> int:
    """Insert or update the alarm of an entry, with the transitions that are due; returns its id."""
    known = _known(connection, entry)
    alarm_id = _insert(connection, entry) if known is None else _update(connection, entry, known)
    life = AlarmLife() if known is None else known.life
    rules, removed_by = removal(connection, entry.axis, entry.rules)
    if known is not None and (at_us := _named_us(known, entry.alarm)) is not None:
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
    """The transitions of an alarm, with their notes.

    ``courses``: whether the cause is present, and since when; ``acknowledged``: the acknowledgement by a person, if
    any.
    """
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


def _known(connection: sqlite3.Connection, entry: AlarmEntry) -> RecordedAlarm | None:
    """The recorded alarm that an entry updates: the same alarm, otherwise an open alarm with the same name.

    Only the same alarm is updated by a forecast, as that is no change of the parameter; by an ended alarm, so that
    recording it again cannot end a later alarm; and by a named alarm, as another alarm of that name is about to end.
    """
    e = entry.alarm
    parameter, direction = e.first
    values: dict[str, ColumnValue] = {
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
    found = select_alarms(connection, itself, values)
    if not found and e.ended_us is None and e.stage == "changed":
        alike = (
            "WHERE axis = :axis AND parameter = :parameter AND direction = :direction AND ended_us IS NULL"
            " AND kind <> 'forecast' LIMIT 1"
        )
        found = select_alarms(connection, alike, values)
    return found[0] if found else None


def _insert(connection: sqlite3.Connection, entry: AlarmEntry) -> int:
    e = entry.alarm
    values = _columns_of(entry) | {"crossings": e.crossings}
    values |= dict(zip(("first_parameter", "first_direction"), e.first, strict=True))
    if entry.reserved_id and alarm_by_id(connection, entry.reserved_id) is None:
        values["id"] = entry.reserved_id
    places = ", ".join(f":{name}" for name in values)
    cursor = connection.execute(f"INSERT INTO alarm ({', '.join(values)}) VALUES ({places})", values)
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def _update(connection: sqlite3.Connection, entry: AlarmEntry, known: RecordedAlarm) -> int:
    e = entry.alarm
    changed = _columns_of(entry)
    if known.raised_us != e.raised_us:
        # A monitor that has lost its state raises the same alarm again: keep the first onset and time.
        changed = {name: changed[name] for name in ("updated_us", "ended_us", "size", "size_sd")}
    else:
        del changed["raised_us"]
    texts = [f"{name} = :{name}" for name in changed]
    texts.append("crossings = max(crossings, :again)")
    values = changed | {"again": e.crossings, "id": known.id}
    connection.execute(f"UPDATE alarm SET {', '.join(texts)} WHERE id = :id", values)
    return known.id


def _columns_of(entry: AlarmEntry) -> dict[str, ColumnValue]:
    """The columns that may change from record to record, without ``crossings``, which can only grow."""
    e = entry.alarm
    own: dict[str, ColumnValue] = {
        "axis": entry.axis,
        "unit": entry.unit,
        "nominal": entry.nominal,
        "priority": entry.rules.priority,
    }
    shared = [name for name in NAMES if name not in {"crossings", *OWN, *LISTS}]
    lists: dict[str, ColumnValue] = {name: json.dumps(getattr(e, name)) for name in LISTS}
    return own | {name: getattr(e, name) for name in shared} | lists


def _named_us(known: RecordedAlarm, e: Alarm) -> int | None:
    """When, since the last record, a first or another cause was named, or its doubt changed; None: neither."""
    if known.raised_us != e.raised_us or e.stage != "named":
        return None
    if (known.stage, known.parameter, known.direction) != (e.stage, e.parameter, e.direction):
        return e.past[-1].until_us if e.past else e.updated_us
    return e.updated_us if known.doubt != e.doubt else None


def _courses(known: RecordedAlarm | None, e: Alarm, rules: AlarmRules) -> Iterator[tuple[bool, int]]:
    """Presence of the cause from the last record to this one: whether it was present, and since when.

    An absence shorter than the off-delay is left out, and so is the end of an alarm before its off-delay is over.
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
    """Shelve an alarm if another alarm of its axis, parameter and direction is shelved."""
    alarm = alarm_by_id(connection, alarm_id)
    assert alarm is not None
    for other in shelved_alike(connection, alarm, alarm.updated_us)[:1]:
        change = transition(life, AlarmEvent.SHELVE, other.shelved_until_us)
        comment = f"as alarm {other.id}, which is shelved"
        take(connection, alarm_id, [change], Note(alarm.updated_us, SERVICE, comment))


def shelved_alike(connection: sqlite3.Connection, alarm: RecordedAlarm, now_us: int) -> list[RecordedAlarm]:
    """Other shelved alarms of the same axis, parameter and direction, those shelved longest first."""
    alike = (
        "WHERE axis = ? AND parameter = ? AND direction = ? AND (kind = 'forecast') = ? AND id <> ?"
        " AND state = 'shelved' AND shelved_until_us > ? ORDER BY shelved_until_us DESC"
    )
    name: list[ColumnValue] = [alarm.axis, alarm.parameter, alarm.direction, alarm.kind == "forecast"]
    return select_alarms(connection, alike, [*name, alarm.id, now_us])
