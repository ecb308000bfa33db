"""A damaged file is quarantined and said so; nothing is deleted, and the program goes on."""

import random
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from monitor_core.detection import Alarm
from service.store.database import StoreError
from service.store.journal import Journal


def filled(path: Path) -> bytes:
    journal = Journal(path)
    for k in range(200):
        journal.record("demo.axis1", "1", 1.0, Alarm(f"p{k}", "up", k, k, k, k, 0.5, 0.1, 1))
    journal.close()
    return path.read_bytes()


def noise(data: bytes, random_: random.Random) -> bytes:
    return random_.randbytes(len(data))


def truncated(data: bytes, random_: random.Random) -> bytes:
    return data[: random_.randrange(1, len(data) - 4096)]


def page_overwritten(data: bytes, random_: random.Random) -> bytes:
    return data[:4096] + random_.randbytes(4096) + data[8192:]


@pytest.mark.parametrize("damage", [noise, truncated, page_overwritten])
def test_a_damaged_file_is_kept_and_a_new_one_begun(
    damage: Callable[[bytes, random.Random], bytes], tmp_path: Path, seed: int
) -> None:
    path = tmp_path / "alarms.sqlite"
    broken = damage(filled(path), random.Random(seed))
    path.write_bytes(broken)
    journal = Journal(path)
    (quarantined,) = tmp_path.glob("alarms.sqlite.damaged-*Z")
    (message,) = journal.messages
    assert quarantined.read_bytes() == broken
    assert str(path) in message
    assert quarantined.name in message
    assert journal.query() == ([], 0)
    journal.record("demo.axis1", "1", 1.0, Alarm("kT", "up", 1, 1, 1, None, 0.5, 0.1, 1))
    journal.close()
    reopened = Journal(path)
    assert (reopened.messages, reopened.query()[1]) == ((), 1)
    reopened.close()


def test_a_damaged_log_goes_with_its_file(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "alarms.sqlite"
    path.write_bytes(b"not a database, " * 100)
    wal = path.with_name("alarms.sqlite-wal")
    wal.write_bytes(random.Random(seed).randbytes(100))
    Journal(path).close()
    (quarantined,) = tmp_path.glob("alarms.sqlite.damaged-*Z-wal")
    assert len(quarantined.read_bytes()) == 100


def test_an_empty_file_is_a_new_journal(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    path.touch()
    journal = Journal(path)
    assert (journal.messages, journal.query()) == ((), ([], 0))
    journal.close()


def test_a_newer_schema_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    filled(path)
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA user_version=99")
    connection.close()
    with pytest.raises(StoreError, match=r"newer version of axiswatch .*99"):
        Journal(path)
    assert list(tmp_path.glob("*.damaged-*")) == []


def test_a_path_that_cannot_be_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"file/alarms\.sqlite"):
        Journal(tmp_path / "file" / "alarms.sqlite")
    (tmp_path / "folder").mkdir()
    with pytest.raises(StoreError, match="folder: unable to open"):
        Journal(tmp_path / "folder")


def test_a_closed_journal_says_so(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "alarms.sqlite")
    journal.close()
    with pytest.raises(StoreError, match="closed"):
        journal.record("a", "1", 1.0, Alarm("kT", "up", 1, 1, 1, None, 0.5, 0.1, 1))
