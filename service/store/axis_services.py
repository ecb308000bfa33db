"""Axes taken out of service by a person, e.g. for maintenance: their alarms are recorded, but not announced.

Each removal and each return is a row, written in one transaction with the transitions of the axis's alarms.
"""

import sqlite3
from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

from monitor_core.monitoring import AlarmEvent, AlarmRules, AlarmTransitionError
from service.store.alarm_transitions import CONFIGURATION, Note
from service.store.database import Database
from service.texts.instants import iso

SERVICE_MIGRATION = """
    CREATE TABLE axis_service (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        axis TEXT NOT NULL,
        at_us INTEGER NOT NULL,
        event TEXT NOT NULL,
        who TEXT NOT NULL,
        comment TEXT NOT NULL,
        work_order TEXT NOT NULL
    ) STRICT;
    CREATE INDEX axis_service_by_axis ON axis_service (axis, id);
"""

ServiceEvent = Literal[AlarmEvent.REMOVE, AlarmEvent.RETURN]


class ServiceStep(NamedTuple):
    """An axis was taken out of service, or returned to it."""

    event: ServiceEvent
    note: Note


ApplyService = Callable[[sqlite3.Connection, str, Note], None]
"""Applies a change of service to the alarms of an axis."""


class AxisServices:
    """Removals of axes from service and returns, in the file of the alarm journal.

    Every method raises StoreError if the file cannot be read or written.
    """

    def __init__(self, db: Database, apply: ApplyService) -> None:
        self._db, self._apply = db, apply

    def removed(self) -> dict[str, Note]:
        """The axes that a person has taken out of service, with the person's note."""
        last = f"SELECT axis, {_COLUMNS} FROM axis_service WHERE id IN (SELECT max(id) FROM axis_service GROUP BY axis)"
        with self._db.read() as connection:
            steps = {axis: _read(row) for axis, *row in connection.execute(last)}
        return {axis: step.note for axis, step in steps.items() if step.event is AlarmEvent.REMOVE}

    def steps(self, axis: str) -> list[ServiceStep]:
        """All removals and returns of an axis, oldest first."""
        query = f"SELECT {_COLUMNS} FROM axis_service WHERE axis = ? ORDER BY id"
        with self._db.read() as connection:
            return [_read(row) for row in connection.execute(query, [axis])]

    def change(self, axis: str, event: ServiceEvent, note: Note) -> None:
        """Take an axis out of service or return it; its alarms change state at once.

        Raises:
            AlarmTransitionError: the axis is already out of service, or already in service.
        """
        with self._db.write() as connection:
            last = _last(connection, axis)
            removed = last is not None and last.event is AlarmEvent.REMOVE
            if removed == (event is AlarmEvent.REMOVE):
                raise AlarmTransitionError(_refusal(axis, last if removed else None))
            connection.execute(
                "INSERT INTO axis_service (axis, event, at_us, who, comment, work_order) VALUES (?, ?, ?, ?, ?, ?)",
                [axis, event, *note],
            )
            self._apply(connection, axis, note)


def removal(connection: sqlite3.Connection, axis: str, rules: AlarmRules) -> tuple[AlarmRules, str]:
    """The rules of an alarm, changed if a person has taken its axis out of service; and who does so."""
    last = _last(connection, axis)
    if last is None or last.event is not AlarmEvent.REMOVE:
        return rules, CONFIGURATION
    return rules._replace(out_of_service=True), last.note.who


_COLUMNS = "event, at_us, who, comment, work_order"


def _last(connection: sqlite3.Connection, axis: str) -> ServiceStep | None:
    query = f"SELECT {_COLUMNS} FROM axis_service WHERE axis = ? ORDER BY id DESC LIMIT 1"
    row = connection.execute(query, [axis]).fetchone()
    return None if row is None else _read(row)


def _read(row: Sequence[Any]) -> ServiceStep:
    event, *note = row
    return ServiceStep(AlarmEvent.REMOVE if event == AlarmEvent.REMOVE else AlarmEvent.RETURN, Note(*note))


def _refusal(axis: str, last: ServiceStep | None) -> str:
    if last is None:
        return f"no person has taken {axis} out of service; [robot.axis.alarms] may, in the configuration"
    return f"{axis} is out of service already, since {iso(last.note.at_us)} by {last.note.who}"
