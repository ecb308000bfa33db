"""Checkpoints: the last state of every monitor, with a key of the model and settings that the state belongs to."""

import hashlib
import io
import re
import sqlite3
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Arrays
from monitor_core.wording import sentence
from service.store.database import Store

MIGRATIONS = (
    """
    CREATE TABLE checkpoint (
        axis TEXT PRIMARY KEY,
        key TEXT NOT NULL,
        at_us INTEGER NOT NULL,
        arrays BLOB NOT NULL,
        checksum BLOB NOT NULL
    ) STRICT;
    CREATE TABLE set_aside (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        axis TEXT NOT NULL,
        key TEXT NOT NULL,
        at_us INTEGER NOT NULL,
        arrays BLOB NOT NULL,
        checksum BLOB NOT NULL,
        set_aside_us INTEGER NOT NULL,
        reason TEXT NOT NULL
    ) STRICT;
    """,
    """
    ALTER TABLE set_aside RENAME TO quarantine;
    ALTER TABLE quarantine RENAME COLUMN set_aside_us TO quarantined_us;
    """,
)

_EPOCH = re.compile(rb"(?:slow history 1 )?epoch=(\d+) ")

_SAVE = "INSERT OR REPLACE INTO checkpoint VALUES (?, CAST(? AS TEXT), ?, ?, ?)"

# The key is read as bytes, as a damaged key may be no valid text.
_LAST = "SELECT axis, CAST(key AS BLOB), at_us, arrays, checksum FROM checkpoint WHERE axis = ?"

_MOVE = """
    INSERT INTO quarantine (axis, key, at_us, arrays, checksum, quarantined_us, reason)
    SELECT axis, key, at_us, arrays, checksum, ?, ? FROM checkpoint WHERE axis = ?
"""


class MonitorState(NamedTuple):
    """State of a monitor to save.  ``key``: states with equal keys are interchangeable."""

    axis: str
    key: str
    arrays: Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A saved state; ``at_us``: when it was saved [us since 1970]."""

    at_us: int
    arrays: Arrays


@dataclass(frozen=True, slots=True)
class QuarantinedCheckpoint:
    """A saved state that cannot be used, and was moved to a separate table for inspection."""

    reason: str


class Checkpoints(Store):
    """The last checkpoint of each axis."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, MIGRATIONS, "NORMAL")

    def save(self, states: Iterable[MonitorState], at_us: int) -> None:
        """Save these states in place of the former ones, all or none.

        Raises:
            ValueError: an array holds Python objects.
        """
        rows = [_row(state, at_us) for state in states]
        with self._db.write() as connection:
            connection.executemany(_SAVE, rows)

    def load(self, axis: str, key: str, now_us: int) -> Checkpoint | QuarantinedCheckpoint | None:
        """The last state of an axis; None: there is none.

        A state that is damaged or has another key is quarantined; the result then says why.
        """
        with self._db.write() as connection:
            row = connection.execute(_LAST, (axis,)).fetchone()
            if row is None:
                return None
            found = _validated(row, key)
            if isinstance(found, QuarantinedCheckpoint):
                _move(connection, axis, found.reason, now_us)
            return found

    def quarantine(self, axis: str, reason: str, now_us: int) -> None:
        """Quarantine the last state of an axis, e.g. because the monitor does not accept it."""
        with self._db.write() as connection:
            _move(connection, axis, reason, now_us)


_Row = tuple[str, bytes, int, bytes, bytes]


def _row(state: MonitorState, at_us: int) -> _Row:
    data, key = pack(state.arrays), state.key.encode()
    return state.axis, key, at_us, data, _checksum(state.axis, key, at_us, data)


def _checksum(axis: str, key: bytes, at_us: int, data: bytes) -> bytes:
    """Checksum of the whole row, so that a part from another row is noticed."""
    head = repr((axis, hashlib.sha256(key).hexdigest(), at_us))
    return hashlib.sha256(head.encode() + data).digest()


def _validated(row: _Row, key: str) -> Checkpoint | QuarantinedCheckpoint:
    axis, saved_key, at_us, data, checksum = row
    if checksum != _checksum(axis, saved_key, at_us, data):
        return QuarantinedCheckpoint(sentence("damaged", "it is damaged (its checksum does not fit)"))
    if (before := _epoch(saved_key)) != (now := _epoch(key.encode())):
        return QuarantinedCheckpoint(
            sentence("other epoch", "it belongs to {before}, not to {now}", before=before, now=now)
        )
    if saved_key != key.encode():
        return QuarantinedCheckpoint(
            sentence(
                "other settings",
                "it was saved with another model, parameters, settings, or by another version",
            )
        )
    try:
        return Checkpoint(at_us, unpack(data))
    except UnreadableError as error:
        return QuarantinedCheckpoint(sentence("unreadable", "it cannot be read ({why})", why=error))


def _epoch(key: bytes) -> str:
    """In words, the epoch or configuration whose nominal values a state has."""
    found = _EPOCH.match(key)
    if found is None:
        return sentence("the configuration", "the configuration")
    return sentence("epoch", "epoch {number}", number=int(found[1]))


def _move(connection: sqlite3.Connection, axis: str, reason: str, now_us: int) -> None:
    connection.execute(_MOVE, (now_us, reason, axis))
    connection.execute("DELETE FROM checkpoint WHERE axis = ?", (axis,))


# --- Arrays as bytes: numpy's npz format without pickles, so that reading cannot execute code ------------------------


class UnreadableError(ValueError):
    """The bytes are no arrays written by ``pack``."""


def pack(arrays: Mapping[str, NDArray[np.generic]]) -> bytes:
    """The arrays as the bytes of an .npz file; equal arrays give equal bytes.

    Raises:
        ValueError: an array holds Python objects.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as member:
                np.lib.format.write_array(member, np.asarray(arrays[name]), allow_pickle=False)
    return buffer.getvalue()


def unpack(data: bytes) -> Arrays:
    """The arrays in bytes written by ``pack``.

    Raises:
        UnreadableError: the bytes are damaged or contain pickles.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return dict(archive)
    except (ValueError, EOFError, OSError, NotImplementedError, RuntimeError, zipfile.BadZipFile) as error:
        raise UnreadableError(str(error)) from error
