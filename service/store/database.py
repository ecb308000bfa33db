"""An SQLite file in WAL mode with one writer: locking, migrations, quarantine of a damaged file."""

import errno
import fcntl
import os
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from monitor_core.wording import sentence

Synchronous = Literal["FULL", "NORMAL"]
"""FULL: a commit survives a power failure.  NORMAL: it survives the end of the process, and is eight times as fast."""

SQLITE_VERSION = sqlite3.sqlite_version
BUSY_TIMEOUT_S = 5.0
_DAMAGE = (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT)
_COMPANIONS = ("-wal", "-shm")


class StoreError(Exception):
    """The file cannot be opened, read or written; the text names it and says why."""

    @property
    def is_damage(self) -> bool:
        """Whether the file is damaged; the next opening quarantines it."""
        return self.__cause__ is not None and _is_damage(self.__cause__)


class StoreInUseError(StoreError):
    """Another process, or another object of this process, has the file open for writing."""


class _DamagedError(StoreError):
    """The file was damaged and has been quarantined."""


class Database:
    """A file with one connection for writing, and a new connection for each read.

    ``messages``: to the operator, e.g. that a damaged file was quarantined; no file is ever deleted.
    ``functions``: SQL functions by name.

    Raises:
        StoreInUseError: another process or object writes to the file.
        StoreError: the file cannot be opened, or was written by a newer version of the program.
    """

    def __init__(
        self,
        path: Path,
        migrations: Sequence[str],
        synchronous: Synchronous,
        functions: Mapping[str, Callable[[str], str]],
    ) -> None:
        self.path, self._functions = path, functions
        self.messages: tuple[str, ...] = ()
        self.revision = 0
        """Number of committed transactions"""
        self._lock = threading.Lock()
        self._closed = False
        self._owner = _claim(path)
        try:
            self._writer = self._with_functions(self._open(migrations, synchronous))
            with _explained(path):
                self._file = _identity(path)
        except BaseException:
            self._owner.close()
            raise

    def _open(self, migrations: Sequence[str], synchronous: Synchronous) -> sqlite3.Connection:
        with _explained(self.path):
            try:
                return _opened(self.path, migrations, synchronous)
            except _DamagedError as error:
                self.messages = error.args
                return _opened(self.path, migrations, synchronous)

    @contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """A write transaction: committed at the end of the ``with`` block, rolled back if the block raises.

        Raises:
            StoreError: the transaction could not be committed; nothing was written.
        """
        with self._lock, _explained(self.path):
            self._check_place()
            self._writer.execute("BEGIN IMMEDIATE")
            try:
                yield self._writer
                self._writer.execute("COMMIT")
                self.revision += 1
            except BaseException:
                if self._writer.in_transaction:
                    self._writer.execute("ROLLBACK")
                raise

    @contextmanager
    def read(self) -> Iterator[sqlite3.Connection]:
        """A consistent view of the file, from any thread, also during a write.

        Raises:
            StoreError: the file could not be read.
        """
        with _explained(self.path):
            if self._closed:
                raise sqlite3.ProgrammingError("it has been closed")
            self._check_place()
            with closing(_connect(f"{self.path.resolve().as_uri()}?mode=ro")) as connection:
                self._with_functions(connection).execute("BEGIN")
                yield connection

    def _check_place(self) -> None:
        """Check that the open file is still the one at its path: what is written to a deleted file is lost."""
        found = _identity(self.path)
        if found != self._file:
            words = "{path} is no longer there: put it back, or restart axiswatch, which then begins a new one"
            if found is not None:
                words = "{path} has been replaced by another file: put the former one back, or restart axiswatch"
            raise StoreError(sentence("file gone" if found is None else "file replaced", words, path=self.path))

    def _with_functions(self, connection: sqlite3.Connection) -> sqlite3.Connection:
        for name, function in self._functions.items():
            connection.create_function(name, 1, function)
        return connection

    def close(self) -> None:
        """Close the file, after a running write transaction has finished."""
        with self._lock:
            self._closed = True
            self._writer.close()
            self._owner.close()


class Store:
    """What is kept in a file with one writer; any thread may read at any time.

    Every method raises StoreError if the file cannot be read or written; nothing is written then.

    Raises:
        StoreInUseError: another daemon writes to this file.
        StoreError: the file cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        migrations: Sequence[str],
        synchronous: Synchronous,
        functions: Mapping[str, Callable[[str], str]] = MappingProxyType({}),
    ) -> None:
        self._db = Database(path, migrations, synchronous, functions)
        self.messages = self._db.messages

    def close(self) -> None:
        """Close the file."""
        self._db.close()


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and number of the file at a path; None: there is none."""
    try:
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    return found.st_dev, found.st_ino


def _claim(path: Path) -> FileIO:
    """Lock ``NAME.lock``; the lock ends with the process, however that ends."""
    lock_path = path.with_name(path.name + ".lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Without a buffer: what a full disk refuses must not come again when it is closed.
        owner = lock_path.open("a+b", buffering=0)
    except OSError as error:
        raise StoreError(_unusable(lock_path, error)) from error
    try:
        fcntl.flock(owner, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        owner.seek(0)
        process = owner.read().decode("ascii", "replace").strip() or "unknown"
        owner.close()
        message = f"{path} is in use by process {process}; let each daemon have its own state directory"
        raise StoreInUseError(message) from error
    try:
        owner.truncate(0)
        owner.write(str(os.getpid()).encode("ascii"))
    except OSError as error:
        owner.close()
        raise StoreError(_unusable(lock_path, error)) from error
    return owner


def _unusable(path: Path, error: OSError) -> str:
    """Why a file of the state directory cannot be written, and what to do about missing rights."""
    words = f"{path}: {error.strerror}"
    if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
        return words
    return f"{words}: {path.parent} must be a folder that the user of the daemon can write ([service] state_dir)"


def _connect(uri: str) -> sqlite3.Connection:
    # isolation_level None: transactions are started explicitly.  Several threads use the writer, one at a time.
    return sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False)


def _opened(path: Path, migrations: Sequence[str], synchronous: Synchronous) -> sqlite3.Connection:
    connection = _connect(path.resolve().as_uri())
    try:
        connection.execute("PRAGMA journal_mode=WAL")
        connection.execute(f"PRAGMA synchronous={synchronous}")
        check_integrity(connection)
        _migrate(connection, path, migrations)
    except BaseException as error:
        # Rename the file before closing it: closing would write the WAL back and remove it.
        damage = _quarantine(path, error) if _is_damage(error) else error
        connection.close()
        raise damage from None
    return connection


def check_integrity(connection: sqlite3.Connection) -> None:
    """Check that SQLite finds no damage in a file.

    Raises:
        sqlite3.DatabaseError: the file is damaged.
    """
    findings = [row[0] for row in connection.execute("PRAGMA quick_check(1)")]
    if findings != ["ok"]:
        error = sqlite3.DatabaseError(findings[0].strip())
        error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
        raise error


def _migrate(connection: sqlite3.Connection, path: Path, migrations: Sequence[str]) -> None:
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    if version > len(migrations):
        raise StoreError(f"{path} was written by a newer version of axiswatch (its schema is {version})")
    for number in range(version, len(migrations)):
        connection.executescript(f"BEGIN IMMEDIATE; {migrations[number]}; PRAGMA user_version={number + 1}; COMMIT;")


def _is_damage(error: BaseException) -> bool:
    # The low byte is the kind of error; the other bits are details.
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def _quarantine(path: Path, error: BaseException) -> _DamagedError:
    """Rename the file together with its WAL files; returns the error with a message to the operator."""
    quarantined = path.with_name(f"{path.name}.damaged-{datetime.now(UTC):%Y%m%dT%H%M%S.%fZ}")
    for suffix in ("", *_COMPANIONS):
        companion = path.with_name(path.name + suffix)
        if companion.exists():
            companion.rename(quarantined.with_name(quarantined.name + suffix))
    return _DamagedError(
        sentence(
            "file damaged",
            "{path} is damaged ({why}); it is kept as {name}, and a new file has been started",
            path=path,
            why=error,
            name=quarantined.name,
        )
    )


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn errors of SQLite and of the file system into a StoreError that names the file."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise StoreError(f"{path}: {error}") from error
