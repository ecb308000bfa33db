"""The alarm table in SQLite: its migrations, and its rows as recorded alarms."""

import json
import math
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from monitor_core.detection import PAYLOAD_WITHIN_S, Alarm, Cause, FormerName, Reach, payload_change, same_payload
from monitor_core.monitoring import AlarmLife, AlarmState, Priority
from service.store.alarm_statistics import FOLLOWED, FOLLOWS

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
    # Alarms are raised, then named: the first crossing identifies an alarm, as its parameter may be corrected.
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
    # Whether an alarm was raised within the conditions of the calibration; unknown for older alarms.
    """
    ALTER TABLE alarm ADD COLUMN inside_calibration INTEGER;
    """,
    # An alarm is reopened if its cause returns soon.
    """
    ALTER TABLE alarm ADD COLUMN reopened_us INTEGER;
    """,
)
"""The migrations for alarm states follow in ``alarm_transitions``."""

ColumnValue = str | int | float | None
"""Value of a column"""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedAlarm(Alarm):
    """An alarm in the journal.  Times in microseconds since 1970; nominal and size in ``unit``."""

    id: int
    axis: str
    unit: str
    nominal: float
    recorded: bool = True
    """Whether the alarm is in the journal"""
    state: AlarmState = AlarmState.NORMAL
    returns_to: AlarmState | None = None
    """State to which a hidden alarm will return"""
    shelved_until_us: int | None = None
    priority: Priority = "medium"
    work_order: str = ""
    """The work order that was given last; empty: none"""
    follows: int | None = None
    """Id of the first alarm of the group that was open when this one was raised; None: there was none"""
    followed: bool = False
    """Whether another axis of the group has an alarm that was raised soon after this one"""
    same_payload: tuple[str, ...] = ()
    """Other axes of the robot with alarms at about the same time that the same change of the payload explains"""

    @property
    def first_out(self) -> bool:
        """Whether it is the first of the alarms of several axes of the group."""
        return self.followed and self.follows is None

    @property
    def life(self) -> AlarmLife:
        """The state of the alarm as the life-cycle functions use it."""
        return AlarmLife(self.state, self.returns_to, self.shelved_until_us)

    @property
    def monitored(self) -> Alarm:
        """The alarm without the columns of the journal, as a monitor uses it."""
        return Alarm(**{field.name: getattr(self, field.name) for field in fields(Alarm)})

    @property
    def active(self) -> bool:
        """Whether the alarm has not ended, or is latched."""
        return self.life.active


STANDING = "WHERE state <> 'normal' AND state <> 'returned'"
_DERIVED = {"follows": FOLLOWS, "followed": FOLLOWED}
NAMES = tuple(f.name for f in fields(RecordedAlarm) if f.name not in {"recorded", "same_payload", *_DERIVED})
OWN = {"id", "axis", "unit", "nominal", "state", "returns_to", "shelved_until_us", "priority", "work_order"}
"""Columns that are not fields of a monitor's alarm"""
_COLUMNS = ", ".join([*NAMES, *_DERIVED.values()])
LISTS: dict[str, Callable[[Sequence[Any]], Cause | FormerName | Reach]] = {
    "causes": Cause.read,
    "past": FormerName._make,
    "reaches": Reach._make,
}
"""Columns stored as JSON lists, with the function that reads an entry."""


def alarm_by_id(connection: sqlite3.Connection, alarm_id: int) -> RecordedAlarm | None:
    """The alarm with this id; None: there is none."""
    return next(iter(select_alarms(connection, "WHERE id = ?", [alarm_id])), None)


def not_ended(connection: sqlite3.Connection, axis: str) -> list[RecordedAlarm]:
    """The alarms of an axis that have not ended, oldest first."""
    return select_alarms(connection, "WHERE axis = ? AND ended_us IS NULL ORDER BY raised_us, id", [axis])


def select_alarms(
    connection: sqlite3.Connection, rest: str, values: Sequence[ColumnValue] | Mapping[str, ColumnValue] = ()
) -> list[RecordedAlarm]:
    """The alarms that a query finds; ``rest``: its WHERE, ORDER BY and LIMIT; ``values``: values for these."""
    found = [_alarm(row) for row in connection.execute(f"SELECT {_COLUMNS} FROM alarm {rest}", values)]
    return [_with_payload(connection, a) if payload_change(a) or a.onset_low_us is not None else a for a in found]


def _with_payload(connection: sqlite3.Connection, a: RecordedAlarm) -> RecordedAlarm:
    """The alarm with the other axes of the robot that show the same change of the payload."""
    robot, within_us = f"{a.axis.partition('.')[0]}.", round(PAYLOAD_WITHIN_S * 1e6)
    near = "WHERE raised_us BETWEEN ? AND ? AND axis <> ? AND substr(axis, 1, ?) = ?"
    values = [a.raised_us - within_us, a.raised_us + within_us, a.axis, len(robot), robot]
    rows = connection.execute(f"SELECT {_COLUMNS} FROM alarm {near}", values)
    return replace(a, same_payload=same_payload(a, ((other.axis, other) for other in map(_alarm, rows))))


def _alarm(row: tuple[Any, ...]) -> RecordedAlarm:
    values: dict[str, Any] = dict(zip((*NAMES, *_DERIVED), row, strict=True))
    if values["nominal"] is None:  # SQLite stores NaN as NULL
        values["nominal"] = math.nan
    inside = values["inside_calibration"]
    values["inside_calibration"] = None if inside is None else bool(inside)
    values["followed"] = bool(values["followed"])
    values["state"] = AlarmState(values["state"])
    values["returns_to"] = values["returns_to"] and AlarmState(values["returns_to"])
    for name, read in LISTS.items():
        values[name] = tuple(read(entry) for entry in json.loads(values[name]))
    return RecordedAlarm(**values)
