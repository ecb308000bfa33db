"""Epochs of the axes in SQLite: which nominal values and thresholds were in force when, with all their events.

Each event is a row in ``epoch_event``, written in one transaction with the new state of the epoch and, if the epoch
replaces another, with the end of the other's alarms.
"""

import json
import sqlite3
from collections.abc import Callable, Iterable, Mapping
from typing import Literal, NamedTuple

from monitor_core.monitoring import AlarmRules
from monitor_core.wording import sentence
from service.store.alarm_transitions import CONFIGURATION, Note
from service.store.database import Database

EPOCH_MIGRATION = """
    CREATE TABLE epoch (
        axis TEXT NOT NULL,
        number INTEGER NOT NULL,
        state TEXT NOT NULL,
        source TEXT NOT NULL,
        restored_from INTEGER,
        began_us INTEGER NOT NULL,
        in_force_us INTEGER,
        ended_us INTEGER,
        who TEXT NOT NULL,
        comment TEXT NOT NULL,
        work_order TEXT NOT NULL,
        reason TEXT NOT NULL,
        learn_s REAL,
        verify_s REAL NOT NULL,
        content TEXT NOT NULL,
        nominal TEXT NOT NULL,
        fingerprint TEXT NOT NULL,
        PRIMARY KEY (axis, number)
    ) STRICT;
    CREATE UNIQUE INDEX epoch_in_force ON epoch (axis) WHERE state IN ('verifying', 'current');
    CREATE UNIQUE INDEX epoch_learning ON epoch (axis) WHERE state = 'learning';
    CREATE TABLE epoch_event (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        axis TEXT NOT NULL,
        number INTEGER NOT NULL,
        at_us INTEGER NOT NULL,
        event TEXT NOT NULL,
        who TEXT NOT NULL,
        comment TEXT NOT NULL,
        work_order TEXT NOT NULL
    ) STRICT;
    CREATE INDEX epoch_event_by_epoch ON epoch_event (axis, number);
"""

CANCELLED = sentence("cancelled", "it was cancelled")
RECONFIGURED = sentence("axis reconfigured", "the configuration of the axis has changed")
"""Reasons why an epoch never was in force, besides those from a learning window"""

EpochState = Literal["learning", "verifying", "current", "closed", "rolled_back", "cancelled"]
EpochSource = Literal["configuration", "files", "window", "restored"]
EpochEventName = Literal["begun", "taken over", "verified", "cancelled", "refused", "replaced", "rolled back"]


class EpochValue(NamedTuple):
    """The nominal value of a monitored parameter in an epoch.

    ``former``: value in the epoch before; ``kept``: why a learning window has not changed the value.
    """

    name: str
    unit: str
    value: float
    former: float | None = None
    standard_deviation: float | None = None
    kept: str = ""


class Epoch(NamedTuple):
    """An epoch of an axis; times in microseconds since 1970, texts may be empty."""

    axis: str
    number: int
    state: EpochState
    source: EpochSource
    restored_from: int | None
    began_us: int
    in_force_us: int | None
    ended_us: int | None
    who: str
    comment: str
    work_order: str
    reason: str
    """Why the epoch never was in force; empty: it was, or is still learning"""
    learn_s: float | None
    """Length of the learning window [s]"""
    verify_s: float
    content: str
    """Nominal values and thresholds; while the epoch is learning, those of the epoch before"""
    nominal: tuple[EpochValue, ...]
    """Nominal values of the monitored parameters; empty while the epoch is learning"""
    fingerprint: str
    """Fingerprint of the configuration when the epoch began"""

    @property
    def in_force(self) -> bool:
        """Whether the axis is monitored with these values now."""
        return self.state in ("verifying", "current")


class EpochEvent(NamedTuple):
    """An event of an epoch, and who has caused it."""

    at_us: int
    event: EpochEventName
    who: str
    comment: str
    work_order: str


class EpochPlan(NamedTuple):
    """A new epoch: the source of its values, and the values."""

    axis: str
    source: EpochSource
    content: str
    fingerprint: str
    nominal: tuple[EpochValue, ...] = ()
    learn_s: float | None = None
    verify_s: float = 0.0
    restored_from: int | None = None


EndAlarms = Callable[[sqlite3.Connection, str, Note, Mapping[str, AlarmRules]], None]
"""Function that ends the open alarms of an axis."""


class Epochs:
    """The epochs of all axes, in the file of the alarm journal; for use by any thread.

    Every method raises StoreError if the file cannot be read or written; nothing is written then.
    """

    def __init__(self, database: Database, end_alarms: EndAlarms) -> None:
        self._db, self._end_alarms = database, end_alarms

    def begin_with(self, configured: Iterable[EpochPlan], at_us: int) -> dict[str, Epoch]:
        """Determine the epochs in force of the axes at the start, given those of the configuration.

        The latest change by a person counts: an epoch stays in force as long as the configuration is the one with which
        the epoch began.  A changed configuration starts a new epoch.
        """
        found = {}
        with self._db.write() as connection:
            for plan in configured:
                now = _in_force(connection, plan.axis)
                if now is None or now.fingerprint != plan.fingerprint:
                    now = _reconfigure(connection, plan, now, at_us)
                found[plan.axis] = now
        return found

    def refused_at_start(self, configured: EpochPlan, at_us: int) -> Epoch:
        """Start an epoch with the configured values, as the epoch in force does not fit the axis any more."""
        with self._db.write() as connection:
            return _reconfigure(connection, configured, _in_force(connection, configured.axis), at_us)

    def of_axis(self, axis: str) -> list[Epoch]:
        """The epochs of an axis, the newest first."""
        with self._db.read() as connection:
            return _select(connection, "WHERE axis = ? ORDER BY number DESC", [axis])

    def learning(self) -> list[Epoch]:
        """The epochs whose learning window runs."""
        with self._db.read() as connection:
            return _select(connection, "WHERE state = 'learning' ORDER BY axis", [])

    def events(self, axis: str) -> dict[int, list[EpochEvent]]:
        """The events of the epochs of an axis, by epoch number, oldest first."""
        columns = ", ".join(EpochEvent._fields)
        query = f"SELECT number, {columns} FROM epoch_event WHERE axis = ? ORDER BY id"
        found: dict[int, list[EpochEvent]] = {}
        with self._db.read() as connection:
            for number, *event in connection.execute(query, [axis]):
                found.setdefault(number, []).append(EpochEvent(*event))
        return found

    def learn(self, plan: EpochPlan, note: Note) -> Epoch:
        """Start an epoch whose values will be learned; the former epoch stays in force."""
        with self._db.write() as connection:
            epoch = _insert(connection, plan, "learning", note)
            _note(connection, epoch, "begun", note)
            return epoch

    def next_number(self, axis: str) -> int:
        """Number of the next epoch of an axis."""
        with self._db.read() as connection:
            return _next_number(connection, axis)

    def take_over(self, plan: EpochPlan, note: Note, rules: Mapping[str, AlarmRules] = {}) -> Epoch:
        """Put an epoch in force: the one that has finished learning, otherwise a new one.

        The former epoch and its open alarms end, with the same ``note``.
        """
        with self._db.write() as connection:
            if (before := _in_force(connection, plan.axis)) is not None:
                if plan.source == "restored":
                    _end(connection, before, "rolled_back", "rolled back", note)
                else:
                    _end(connection, before, "closed", "replaced", note)
            state: EpochState = "verifying" if plan.verify_s else "current"
            epoch = _learning(connection, plan.axis)
            if epoch is None or plan.source != "window":
                epoch = _insert(connection, plan, state, note)
            values = [state, note.at_us, plan.content, json.dumps(plan.nominal), plan.fingerprint]
            connection.execute(
                "UPDATE epoch SET state = ?, in_force_us = ?, content = ?, nominal = ?, fingerprint = ?"
                " WHERE axis = ? AND number = ?",
                [*values, *_key(epoch)],
            )
            _note(connection, epoch, "taken over", note)
            words = f"epoch {epoch.number} of {plan.axis} has begun"
            named = note._replace(comment=f"{words}: {note.comment}" if note.comment else words)
            self._end_alarms(connection, plan.axis, named, rules)
            return _get(connection, *_key(epoch))

    def cancel(self, axis: str, note: Note, event: EpochEventName, reason: str) -> Epoch | None:
        """End the learning window of an axis without new values; returns its epoch; None: no window runs."""
        with self._db.write() as connection:
            epoch = _learning(connection, axis)
            if epoch is None:
                return None
            _cancel(connection, epoch, note, event, reason)
            return _get(connection, *_key(epoch))

    def verified(self, axis: str, number: int, note: Note) -> None:
        """Record the end of the verification of an epoch, if it is still in force."""
        with self._db.write() as connection:
            epoch = _in_force(connection, axis)
            if epoch is not None and (epoch.number, epoch.state) == (number, "verifying"):
                connection.execute("UPDATE epoch SET state = 'current' WHERE axis = ? AND number = ?", [*_key(epoch)])
                _note(connection, epoch, "verified", note)


_COLUMNS = ", ".join(Epoch._fields)


def _select(connection: sqlite3.Connection, rest: str, values: list[str | int]) -> list[Epoch]:
    found = (Epoch._make(row) for row in connection.execute(f"SELECT {_COLUMNS} FROM epoch {rest}", values))
    return [e._replace(nominal=tuple(EpochValue(*v) for v in json.loads(str(e.nominal)))) for e in found]


def _get(connection: sqlite3.Connection, axis: str, number: int) -> Epoch:
    return _select(connection, "WHERE axis = ? AND number = ?", [axis, number])[0]


def _key(epoch: Epoch) -> tuple[str, int]:
    return epoch.axis, epoch.number


def _in_force(connection: sqlite3.Connection, axis: str) -> Epoch | None:
    found = _select(connection, "WHERE axis = ? AND state IN ('verifying', 'current')", [axis])
    return found[0] if found else None


def _learning(connection: sqlite3.Connection, axis: str) -> Epoch | None:
    found = _select(connection, "WHERE axis = ? AND state = 'learning'", [axis])
    return found[0] if found else None


def _next_number(connection: sqlite3.Connection, axis: str) -> int:
    query = "SELECT coalesce(max(number), 0) + 1 FROM epoch WHERE axis = ?"
    return int(connection.execute(query, [axis]).fetchone()[0])


def _insert(connection: sqlite3.Connection, plan: EpochPlan, state: EpochState, note: Note) -> Epoch:
    row = Epoch(
        **plan._asdict(),
        number=_next_number(connection, plan.axis),
        state=state,
        began_us=note.at_us,
        in_force_us=None if state == "learning" else note.at_us,
        ended_us=None,
        who=note.who,
        comment=note.comment,
        work_order=note.work_order,
        reason="",
    )
    places = ", ".join("?" * len(row))
    values = row._asdict() | {"nominal": json.dumps(row.nominal)}
    connection.execute(f"INSERT INTO epoch ({_COLUMNS}) VALUES ({places})", list(values.values()))
    return row


def _reconfigure(connection: sqlite3.Connection, configured: EpochPlan, before: Epoch | None, at_us: int) -> Epoch:
    """Put an epoch with the configured values in force; it ends the one before, and one that is learning."""
    note = Note(at_us, CONFIGURATION)
    if learning := _learning(connection, configured.axis):
        _cancel(connection, learning, note, "cancelled", RECONFIGURED)
    if before is not None:
        _end(connection, before, "closed", "replaced", note)
    epoch = _insert(connection, configured, "current", note)
    _note(connection, epoch, "taken over", note)
    return epoch


def _end(connection: sqlite3.Connection, epoch: Epoch, state: EpochState, event: EpochEventName, note: Note) -> None:
    update = "UPDATE epoch SET state = ?, ended_us = ? WHERE axis = ? AND number = ?"
    connection.execute(update, [state, note.at_us, *_key(epoch)])
    _note(connection, epoch, event, note)


def _cancel(connection: sqlite3.Connection, epoch: Epoch, note: Note, event: EpochEventName, reason: str) -> None:
    update = "UPDATE epoch SET reason = ? WHERE axis = ? AND number = ?"
    connection.execute(update, [reason, *_key(epoch)])
    _end(connection, epoch, "cancelled", event, note)


def _note(connection: sqlite3.Connection, epoch: Epoch, event: EpochEventName, note: Note) -> None:
    connection.execute(
        "INSERT INTO epoch_event (axis, number, at_us, event, who, comment, work_order) VALUES (?, ?, ?, ?, ?, ?, ?)",
        [*_key(epoch), note.at_us, event, note.who, note.comment, note.work_order],
    )
