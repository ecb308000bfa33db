"""The history of all parameters in an SQLite file: points, and their roll-ups by minute, hour and day.

Points and roll-ups are written in one transaction, so a point is in all tables or in none, however the process ends.
"""

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np

from monitor_core.arrays import Ints
from service.store.database import Store
from service.store.history_rows import HistoryRows, joined, merged, packed, points, unpacked

Resolution = Literal["raw", "minute", "hour", "day"]
RESOLUTIONS: tuple[Resolution, ...] = get_args(Resolution)
PERIODS_S: Mapping[Resolution, int] = {"raw": 1, "minute": 60, "hour": 3600, "day": 86400}
"""Length of a row [s]"""

MOST_PRUNED = 2000
"""Most rows of a parameter and a resolution that are deleted in one step, which limits the loss if the clock is wrong
for a moment."""
SHARE_PRUNED = 60
"""After each write, one part in this number of the parameters is pruned."""
MOST_CUTS = 4
"""Most cuts in one step, if the file is too large"""
_CUT = 100
"""A cut deletes one part in this number of the largest table."""
_BYTES_PER_S: Mapping[Resolution, float] = {"raw": 5, "minute": 2.5, "hour": 0.04, "day": 0.002}
"""Approximate growth for each parameter with a point each 10 s; used only to find the largest table"""

_TABLE = """
    CREATE TABLE {} (
        series INTEGER NOT NULL, t INTEGER NOT NULL, n INTEGER NOT NULL, cells BLOB NOT NULL,
        PRIMARY KEY (series, t)
    ) STRICT, WITHOUT ROWID;
"""
MIGRATIONS = (
    """
    CREATE TABLE series (
        id INTEGER PRIMARY KEY,
        axis TEXT NOT NULL,
        parameter TEXT NOT NULL,
        unit TEXT NOT NULL,
        UNIQUE (axis, parameter, unit)
    ) STRICT;
    """
    + "".join(map(_TABLE.format, RESOLUTIONS)),
)


class Bounds(NamedTuple):
    """Limits of the history: largest age of each resolution [s], size of the file [bytes]."""

    age_s: Mapping[Resolution, float]
    size_bytes: float


class HistorySeries(NamedTuple):
    """The parameter that a row belongs to."""

    axis: str
    parameter: str
    unit: str


class HistoryPoint(NamedTuple):
    """The quantities of a parameter at a time [s since 1970], in the order of ``QUANTITIES``."""

    series: HistorySeries
    t: int
    values: Sequence[float]


class HistoryStore(Store):
    """The history of all parameters."""

    def __init__(self, path: Path, bounds: Bounds) -> None:
        super().__init__(path, MIGRATIONS, "NORMAL")
        self._bounds = bounds
        self._ids: dict[HistorySeries, int] = {}
        self._pruned = 0

    def add(self, found: Sequence[HistoryPoint]) -> None:
        """Add points and update their minutes, hours and days, all or none."""
        ids = dict(self._ids)
        with self._db.write() as connection:
            series = np.array([_series_id(connection, ids, point.series) for point in found], np.int64)
            rows = points([point.t for point in found], [point.values for point in found])
            for table in RESOLUTIONS:
                _roll_up(connection, table, series, rows)
        self._ids = ids

    def prune(self, now_s: float) -> None:
        """Delete some of the rows that are too old and, if the file is too large, the oldest rows of the largest table.

        To be called after each ``add``; each call does only a part, so that none takes long.
        """
        with self._db.write() as connection:
            ids = [row[0] for row in connection.execute("SELECT id FROM series ORDER BY id")]
            share = -(-len(ids) // SHARE_PRUNED)
            part = [ids[(self._pruned + k) % len(ids)] for k in range(share)]
            self._pruned += share
            for table, age_s in self._bounds.age_s.items():
                _delete(connection, table, part, now_s - age_s)
            cuts = 0
            while _used_bytes(connection) > self._bounds.size_bytes and cuts < MOST_CUTS:
                _cut(connection, ids)
                cuts += 1

    @contextmanager
    def read(self) -> Iterator["HistoryView"]:
        """A consistent view of the present state."""
        with self._db.read() as connection:
            yield HistoryView(connection)


class HistoryView:
    """A consistent view of the file."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def series(self, axis: str, parameter: str | None) -> dict[int, HistorySeries]:
        """The series of an axis, or of one of its parameters, by id."""
        query = "SELECT id, axis, parameter, unit FROM series WHERE axis = ?1 AND ?2 IN (parameter, '') ORDER BY id"
        return {row[0]: HistorySeries(*row[1:]) for row in self._connection.execute(query, [axis, parameter or ""])}

    def ends(self, ids: Iterable[int]) -> dict[Resolution, tuple[int, int]]:
        """Starts of the oldest and the newest row of these series [s], for each resolution that has rows."""
        return _ends(self._connection, list(ids))

    def rows(self, table: Resolution, series: int, since_s: int, until_s: int, most: int | None = None) -> HistoryRows:
        """The first ``most`` rows of a series that start at or after ``since_s`` and before ``until_s``."""
        query = f"SELECT t, n, cells FROM {table} WHERE series = ? AND t >= ? AND t < ? ORDER BY t LIMIT ?"
        values = [series, since_s, until_s, -1 if most is None else most]
        return unpacked(self._connection.execute(query, values))


def _series_id(connection: sqlite3.Connection, ids: dict[HistorySeries, int], series: HistorySeries) -> int:
    """The id of a series; a new series is inserted."""
    if series not in ids:
        connection.execute("INSERT OR IGNORE INTO series (axis, parameter, unit) VALUES (?, ?, ?)", series)
        query = "SELECT id FROM series WHERE axis = ? AND parameter = ? AND unit = ?"
        ids[series] = int(connection.execute(query, series).fetchone()[0])
    return ids[series]


def _roll_up(connection: sqlite3.Connection, table: Resolution, series: Ints, rows: HistoryRows) -> None:
    """Merge rows with the existing rows of a table."""
    new, owners = merged(rows, PERIODS_S[table], series)
    query = f"SELECT ?, n, cells FROM {table} WHERE series = ? AND t = ?"
    keys = enumerate(zip(owners.tolist(), new.t.tolist(), strict=True))
    answers = (connection.execute(query, (k, *key)).fetchone() for k, key in keys)
    known = unpacked(row for row in answers if row is not None)
    if len(known.n):
        place = known.t
        both = joined([known._replace(t=new.t[place]), new])
        new, owners = merged(both, PERIODS_S[table], np.concatenate([owners[place], owners]))
    columns = owners.tolist(), new.t.tolist(), new.n.tolist(), packed(new)
    connection.executemany(f"INSERT OR REPLACE INTO {table} VALUES (?, ?, ?, ?)", zip(*columns, strict=True))


def _delete(connection: sqlite3.Connection, table: Resolution, ids: Iterable[int], until_s: float) -> None:
    """Delete rows of some series that end before this time, oldest first, at most ``MOST_PRUNED`` of each."""
    last_s = until_s - PERIODS_S[table]
    oldest = f"SELECT t FROM {table} WHERE series = ?1 AND t <= ?2 ORDER BY t LIMIT {MOST_PRUNED}"
    query = f"DELETE FROM {table} WHERE series = ?1 AND t IN ({oldest})"
    connection.executemany(query, [(series, last_s) for series in ids])


def _cut(connection: sqlite3.Connection, ids: Sequence[int]) -> None:
    """Delete the oldest part of the table that is probably the largest."""
    ends = _ends(connection, ids)
    spans = {table: last - first for table, (first, last) in ends.items()}
    if spans:
        table = max(spans, key=lambda name: spans[name] * _BYTES_PER_S[name])
        first, length_s = ends[table][0], max(spans[table] // _CUT, PERIODS_S[table])
        _delete(connection, table, ids, first + length_s + PERIODS_S[table])


def _ends(connection: sqlite3.Connection, ids: Sequence[int]) -> dict[Resolution, tuple[int, int]]:
    ends: dict[Resolution, tuple[int, int]] = {}
    for table in RESOLUTIONS:
        # Two queries: SQLite answers each from the index at once, but not both together.
        query = [f"SELECT {end}(t) FROM {table} WHERE series = ?1" for end in ("min", "max")]
        found = [[connection.execute(q, [series]).fetchone()[0] for q in query] for series in ids]
        if known := [(first, last) for first, last in found if first is not None]:
            ends[table] = min(first for first, _ in known), max(last for _, last in known)
    return ends


def _used_bytes(connection: sqlite3.Connection) -> int:
    """Used bytes of the file; SQLite uses deleted pages again, so the file need not grow."""
    pages, free, size = (
        int(connection.execute(f"PRAGMA {name}").fetchone()[0])
        for name in ("page_count", "freelist_count", "page_size")
    )
    return (pages - free) * size
