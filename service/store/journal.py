"""The alarm journal: every alarm is on the disk before anyone is shown it."""

import math
import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

from monitor_core.episodes import Direction, Episode
from service.store.database import Database

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
)


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm of the journal.  Times in microseconds since 1970; nominal and size in ``unit``.

    ``size`` is estimate - nominal at the last crossing, ``size_sd`` its standard deviation.
    """

    id: int
    axis: str
    parameter: str
    direction: Direction
    unit: str
    nominal: float
    onset_us: int
    raised_us: int
    updated_us: int
    ended_us: int | None
    size: float
    size_sd: float
    crossings: int

    @property
    def active(self) -> bool:
        """Whether the alarm has not ended."""
        return self.ended_us is None


_NAMES = tuple(field.name for field in fields(Alarm))
_COLUMNS = ", ".join(_NAMES)
_NUMBERS = ("nominal", "size", "size_sd")
"""SQLite keeps NaN as NULL."""


class Entry(NamedTuple):
    """An episode of an axis, to be recorded."""

    axis: str
    unit: str
    nominal: float
    episode: Episode


class Journal:
    """Alarms in an SQLite file, one writer; may be read from any thread at any time.

    Every method raises StoreError where the file cannot be read or written.

    Raises:
        StoreInUseError: another daemon writes to this file.
        StoreError: the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._db = Database(path, MIGRATIONS, "FULL")
        self.messages = self._db.messages

    def record(self, axis: str, unit: str, nominal: float, episode: Episode) -> int:
        """Insert an alarm, or bring the open one of its axis, parameter and direction up to date.

        Returns its id; it is on the disk then.
        """
        return self.record_many([Entry(axis, unit, nominal, episode)])[0]

    def record_many(self, entries: Iterable[Entry]) -> list[int]:
        """As ``record`` for several, in their order, all or none of them."""
        with self._db.write() as connection:
            return [_record(connection, entry) for entry in entries]

    def open_episodes(self, axis: str) -> list[Episode]:
        """The alarms of an axis that have not ended, oldest first."""
        with self._db.read() as connection:
            return [_episode(alarm) for alarm in _open(connection, axis)]

    def close_unmonitored(self, axis: str, monitored: Iterable[str], at_us: int) -> list[Alarm]:
        """End the open alarms of parameters that the axis no longer monitors; returns them."""
        names = set(monitored)
        with self._db.write() as connection:
            stale = [alarm for alarm in _open(connection, axis) if alarm.parameter not in names]
            for alarm in stale:
                ended_us = max(at_us, alarm.updated_us)
                connection.execute("UPDATE alarm SET ended_us = ? WHERE id = ?", (ended_us, alarm.id))
            return [alarm for alarm in (_get(connection, a.id) for a in stale) if alarm is not None]

    def get(self, alarm_id: int) -> Alarm | None:
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
        offset: int = 0,
    ) -> tuple[list[Alarm], int]:
        """Alarms that fit all that is given, the last raised first, and how many there are without the limit.

        Args:
            axis: of this axis.
            parameter: of this parameter.
            active: True: not ended; False: ended.
            since_us: raised at this time or later.
            until_us: raised before this time.
            limit: at most so many.
            offset: without the first so many.
        """
        equal: dict[str, _Value] = {"axis = ?": axis, "parameter = ?": parameter}
        within: dict[str, _Value] = {"raised_us >= ?": since_us, "raised_us < ?": until_us}
        given = {text: value for text, value in (equal | within).items() if value is not None}
        conditions = [*given, *_activity(active)]
        where = f"WHERE {' AND '.join(conditions)}" if conditions else ""
        values = list(given.values())
        with self._db.read() as connection:
            total = connection.execute(f"SELECT count(*) FROM alarm {where}", values).fetchone()[0]
            order = "ORDER BY raised_us DESC, id DESC LIMIT ? OFFSET ?"
            alarms = _select(connection, f"{where} {order}", [*values, limit, offset])
        return alarms, int(total)

    def close(self) -> None:
        """Close the file."""
        self._db.close()


_Value = str | int | float | None


def _activity(active: bool | None) -> list[str]:
    return [] if active is None else ["ended_us IS NULL" if active else "ended_us IS NOT NULL"]


def _record(connection: sqlite3.Connection, entry: Entry) -> int:
    e = entry.episode
    known = _known(connection, entry)
    if known is None:
        return _insert(connection, entry)
    # The first onset and time stand, should a monitor that lost its state raise the same alarm anew.
    connection.execute(
        "UPDATE alarm SET updated_us = ?, ended_us = ?, size = ?, size_sd = ?, crossings = max(crossings, ?)"
        " WHERE id = ?",
        (e.updated_us, e.ended_us, e.size, e.size_sd, e.crossings, known),
    )
    return known


def _known(connection: sqlite3.Connection, entry: Entry) -> int | None:
    """The alarm that the episode belongs to: the open one, or else this very episode.

    An episode that has ended looks for itself first, so that repeating its record cannot end a later alarm.
    """
    e = entry.episode
    first = "ended_us IS NULL" if e.ended_us is None else "raised_us = :raised"
    row = connection.execute(
        "SELECT id FROM alarm WHERE axis = :axis AND parameter = :parameter AND direction = :direction"
        f" AND (ended_us IS NULL OR raised_us = :raised) ORDER BY {first} DESC, id DESC LIMIT 1",
        {"axis": entry.axis, "parameter": e.parameter, "direction": e.direction, "raised": e.raised_us},
    ).fetchone()
    return None if row is None else int(row[0])


def _insert(connection: sqlite3.Connection, entry: Entry) -> int:
    e = entry.episode
    values: list[_Value] = [entry.axis, e.parameter, e.direction, entry.unit, entry.nominal]
    values += [e.onset_us, e.raised_us, e.updated_us, e.ended_us, e.size, e.size_sd, e.crossings]
    columns = ", ".join(_NAMES[1:])
    places = ", ".join("?" * len(values))
    cursor = connection.execute(f"INSERT INTO alarm ({columns}) VALUES ({places})", values)
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def _open(connection: sqlite3.Connection, axis: str) -> list[Alarm]:
    return _select(connection, "WHERE axis = ? AND ended_us IS NULL ORDER BY raised_us, id", [axis])


def _get(connection: sqlite3.Connection, alarm_id: int) -> Alarm | None:
    return next(iter(_select(connection, "WHERE id = ?", [alarm_id])), None)


def _select(connection: sqlite3.Connection, rest: str, values: Sequence[_Value]) -> list[Alarm]:
    return [_alarm(row) for row in connection.execute(f"SELECT {_COLUMNS} FROM alarm {rest}", values)]


def _alarm(row: tuple[Any, ...]) -> Alarm:
    values: list[Any] = [
        math.nan if value is None and name in _NUMBERS else value
        for name, value in zip(_NAMES, row, strict=True)
    ]
    return Alarm(*values)


def _episode(a: Alarm) -> Episode:
    return Episode(
        parameter=a.parameter,
        direction=a.direction,
        onset_us=a.onset_us,
        raised_us=a.raised_us,
        updated_us=a.updated_us,
        ended_us=a.ended_us,
        size=a.size,
        size_sd=a.size_sd,
        crossings=a.crossings,
    )
