"""The table of alarms in SQLite: its columns as they came, and its rows as recorded alarms."""

import json
import math
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from monitor_core.detection import PAYLOAD_WITHIN_S, Alarm, Cause, Name, Reach, payload_change, same_payload
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
)
"""Those of the life cycle follow in ``alarm_transitions``."""

Value = str | int | float | None
"""Of a column"""


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
    same_payload: tuple[str, ...] = ()
    """The other axes of its robot whose alarms, raised about then, the same change of the payload explains"""

    @property
    def first_out(self) -> bool:
        """Whether it is the first of alarms of several axes of its group."""
        return self.followed and self.follows is None

    @property
    def life(self) -> AlarmLife:
        """Its state in its life cycle."""
        return AlarmLife(self.state, self.returns_to, self.shelved_until_us)

    @property
    def monitored(self) -> Alarm:
        """The alarm as its monitor has it."""
        return Alarm(**{field.name: getattr(self, field.name) for field in fields(Alarm)})

    @property
    def active(self) -> bool:
        """Whether the alarm has not ended, or is latched."""
        return self.life.active


STANDING = "WHERE state <> 'normal' AND state <> 'returned'"
_DERIVED = {"follows": FOLLOWS, "followed": FOLLOWED}
NAMES = tuple(f.name for f in fields(RecordedAlarm) if f.name not in {"recorded", "same_payload", *_DERIVED})
OWN = {"id", "axis", "unit", "nominal", "state", "returns_to", "shelved_until_us", "priority", "work_order"}
"""Columns that an alarm of a monitor does not have"""
_COLUMNS = ", ".join([*NAMES, *_DERIVED.values()])
LISTS: dict[str, Callable[[Sequence[Any]], Cause | Name | Reach]] = {
    "causes": Cause.read,
    "past": Name._make,
    "reaches": Reach._make,
}
"""Kept as JSON, each entry read by one of these."""


def alarm_by_id(connection: sqlite3.Connection, alarm_id: int) -> RecordedAlarm | None:
    """The alarm of that id."""
    return next(iter(select_alarms(connection, "WHERE id = ?", [alarm_id])), None)


def not_ended(connection: sqlite3.Connection, axis: str) -> list[RecordedAlarm]:
    """The alarms of an axis that have not ended, oldest first."""
    return select_alarms(connection, "WHERE axis = ? AND ended_us IS NULL ORDER BY raised_us, id", [axis])


def select_alarms(
    connection: sqlite3.Connection, rest: str, values: Sequence[Value] | Mapping[str, Value] = ()
) -> list[RecordedAlarm]:
    """The alarms that the rest of a query finds: its WHERE, ORDER BY and LIMIT, with their values."""
    found = [_alarm(row) for row in connection.execute(f"SELECT {_COLUMNS} FROM alarm {rest}", values)]
    return [_with_payload(connection, a) if payload_change(a) else a for a in found]


def _with_payload(connection: sqlite3.Connection, a: RecordedAlarm) -> RecordedAlarm:
    """With the axes of its robot that show the same payload."""
    robot, within_us = f"{a.axis.partition('.')[0]}.", round(PAYLOAD_WITHIN_S * 1e6)
    near = "WHERE raised_us BETWEEN ? AND ? AND axis <> ? AND substr(axis, 1, ?) = ?"
    values = [a.raised_us - within_us, a.raised_us + within_us, a.axis, len(robot), robot]
    rows = connection.execute(f"SELECT {_COLUMNS} FROM alarm {near}", values)
    return replace(a, same_payload=same_payload(a, ((other.axis, other) for other in map(_alarm, rows))))


def _alarm(row: tuple[Any, ...]) -> RecordedAlarm:
    values: dict[str, Any] = dict(zip((*NAMES, *_DERIVED), row, strict=True))
    if values["nominal"] is None:  # SQLite keeps NaN as NULL
        values["nominal"] = math.nan
    inside = values["inside_calibration"]
    values["inside_calibration"] = None if inside is None else bool(inside)
    values["followed"] = bool(values["followed"])
    values["state"] = AlarmState(values["state"])
    values["returns_to"] = values["returns_to"] and AlarmState(values["returns_to"])
    for name, read in LISTS.items():
        values[name] = tuple(read(entry) for entry in json.loads(values[name]))
    return RecordedAlarm(**values)
