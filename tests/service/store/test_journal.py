"""The journal: what was acknowledged is there, whatever happens; a damaged file is quarantined and said so."""

import random
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from monitor_core.detection import Alarm, Cause, FormerName
from monitor_core.detection.alarm import Direction
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_filter import AlarmFilter
from service.store.database import StoreError, StoreInUseError
from service.store.journal import MIGRATIONS, Journal

ROOT = Path(__file__).resolve().parents[3]


def episode(parameter: str = "fm", direction: Direction = "up", raised_us: int = 2_000_000) -> Alarm:
    return Alarm(parameter, direction, raised_us - 500_000, raised_us, raised_us, None, 0.018, 0.002, 1)


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    opened = Journal(tmp_path / "state" / "alarms.sqlite")
    yield opened
    opened.close()


def raised(journal: Journal, e: Alarm, axis: str = "demo.axis1", unit: str = "N m s/rad", nominal: float = 0.06) -> int:
    (number,) = journal.record([AlarmEntry(axis, unit, nominal, e)])
    return number


def test_an_alarm_is_inserted_then_updated_then_ended(journal: Journal) -> None:
    unknown = replace(episode(), size=None, size_sd=None)
    first = raised(journal, unknown)
    assert journal.open_alarms("demo.axis1") == [unknown]
    again = replace(episode(), updated_us=3_000_000, size=0.02, size_sd=0.001, crossings=2)
    assert raised(journal, again) == first
    assert journal.open_alarms("demo.axis1") == [again]
    assert raised(journal, replace(again, ended_us=9_000_000)) == first
    assert journal.open_alarms("demo.axis1") == []
    alarm = journal.get(first)
    assert alarm is not None
    assert (alarm.unit, alarm.nominal, alarm.size, alarm.crossings) == ("N m s/rad", 0.06, 0.02, 2)
    assert (alarm.onset_us, alarm.raised_us, alarm.ended_us) == (1_500_000, 2_000_000, 9_000_000)
    assert not alarm.active


def test_a_name_is_corrected_in_place_and_what_it_was_before_is_kept(journal: Journal) -> None:
    first = raised(journal, episode("fm"))
    past = (FormerName(5_000_000, "changed", "fm", "up"),)
    causes = (Cause("kT", 0.6), Cause("fm", 0.4))
    named = replace(episode("kT", "down"), stage="named", causes=causes, doubt="several", kind="step", past=past)
    named = replace(named, onset_low_us=1_000_000, onset_high_us=1_900_000)
    assert raised(journal, named, unit="1", nominal=1.0) == first
    assert journal.open_alarms("demo.axis1") == [named]
    (alarm,), total = journal.query()
    assert (total, alarm.parameter, alarm.direction, alarm.unit, alarm.nominal) == (1, "kT", "down", "1", 1.0)
    assert (alarm.causes, alarm.past) == (causes, past)
    assert (alarm.stage, alarm.doubt, alarm.kind) == ("named", "several", "step")
    ended = replace(named, ended_us=9_000_000)
    assert raised(journal, ended, unit="1", nominal=1.0) == first
    assert journal.open_alarms("demo.axis1") == []


def test_two_alarms_whose_first_crossing_was_the_same_stay_two(journal: Journal) -> None:
    """The first was of fm and is called kT by now; fm crosses anew."""
    past = (FormerName(5_000_000, "changed", "fm", "up"),)
    named = replace(episode("kT"), stage="named", past=past)
    first = raised(journal, named)
    second = raised(journal, episode("fm", raised_us=6_000_000))
    assert first != second
    assert raised(journal, replace(named, size=0.3)) == first
    assert [e.parameter for e in journal.open_alarms("demo.axis1")] == ["kT", "fm"]


def test_a_journal_of_before_the_two_stages_is_read_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    with sqlite3.connect(path) as old:
        old.executescript(f"{MIGRATIONS[0]}; PRAGMA user_version=1;")
        columns = "axis, parameter, direction, unit, nominal, onset_us, raised_us, updated_us, size, size_sd, crossings"
        values = "'demo.axis1', 'fm', 'up', 'N m s/rad', 0.06, 1500000, 2000000, 2000000, 0.018, 0.002, 1"
        old.execute(f"INSERT INTO alarm ({columns}) VALUES ({values})")
    old.close()
    journal = Journal(path)
    assert journal.open_alarms("demo.axis1") == [episode()]
    number = raised(journal, replace(episode(), stage="named", causes=(Cause("fm", 1.0),)))
    assert [(a.id, a.stage) for a in journal.query()[0]] == [(number, "named")]
    journal.close()


def test_other_axes_parameters_and_directions_are_other_alarms(journal: Journal) -> None:
    ids = {
        raised(journal, episode()),
        raised(journal, episode(direction="down")),
        raised(journal, episode("kT")),
        raised(journal, episode(), axis="demo.axis2"),
    }
    assert len(ids) == 4


def test_a_monitor_that_lost_its_state_continues_the_open_alarm(journal: Journal) -> None:
    first = raised(journal, replace(episode(), crossings=7))
    assert raised(journal, episode(raised_us=5_000_000)) == first
    alarm = journal.get(first)
    assert alarm is not None
    assert (alarm.onset_us, alarm.raised_us, alarm.updated_us) == (1_500_000, 2_000_000, 5_000_000)
    assert alarm.crossings == 7


def test_recording_an_ended_alarm_again_leaves_a_later_one_open(journal: Journal) -> None:
    ended = replace(episode(), ended_us=4_000_000)
    first = raised(journal, ended)
    second = raised(journal, episode(raised_us=8_000_000))
    assert raised(journal, ended) == first
    assert [a.id for a in journal.query(AlarmFilter(active=True))[0]] == [second]


def test_a_batch_is_written_as_a_whole_or_not_at_all(journal: Journal) -> None:
    broken = replace(episode("kT"), direction="sideways")  # type: ignore[arg-type]
    entries = [AlarmEntry("a", "1", 1.0, episode()), AlarmEntry("a", "1", 1.0, broken)]
    with pytest.raises(StoreError, match=r"alarms\.sqlite"):
        journal.record(entries)
    assert journal.query() == ([], 0)
    assert len(journal.record(entries[:1])) == 1


def test_an_alarm_that_is_reopened_keeps_its_row(journal: Journal) -> None:
    """It is not the alarm that was raised anew, long after."""
    ended = replace(episode(), stage="named", ended_us=4_000_000)
    first = raised(journal, ended)
    again = replace(ended, ended_us=None, reopened_us=5_000_000, crossings=2)
    assert raised(journal, again) == first
    assert journal.open_alarms("demo.axis1") == [again]
    assert raised(journal, replace(again, ended_us=8_000_000)) == first
    ((alarm,), total) = journal.query()
    assert (total, alarm.ended_us, alarm.reopened_us, alarm.crossings) == (1, 8_000_000, 5_000_000, 2)
    assert raised(journal, episode(raised_us=9_000_000)) != first


def test_query_filters_and_pages(journal: Journal) -> None:
    for k in range(10):
        e = replace(episode(raised_us=k * 1_000_000 + 1), ended_us=k * 1_000_000 + 2 if k < 9 else None)
        raised(journal, e, axis=f"demo.axis{k % 2}")
    assert journal.query(limit=0)[1] == 10
    before = journal.query(limit=2)[0][-1]
    page, total = journal.query(limit=3, after=(before.raised_us, before.id))
    assert total == 10
    assert [a.raised_us // 1_000_000 for a in page] == [7, 6, 5]
    assert [a.raised_us for a in journal.query(AlarmFilter(active=True))[0]] == [9_000_001]
    assert journal.query(AlarmFilter(active=False))[1] == 9
    assert journal.query(AlarmFilter("demo.axis1", active=False))[1] == 4
    assert journal.query(AlarmFilter(parameter="kT")) == ([], 0)
    assert journal.query(AlarmFilter(since_us=3_000_001, until_us=5_000_001))[1] == 2
    assert journal.query(AlarmFilter("' OR 1=1 --")) == ([], 0)


def test_alarms_of_parameters_no_longer_monitored_end(journal: Journal) -> None:
    stale = raised(journal, episode("Ja"))
    kept = raised(journal, episode("fm"))
    closed = journal.close_unmonitored("demo.axis1", ["kT", "fm"], at_us=7_000_000)
    assert [(a.id, a.ended_us) for a in closed] == [(stale, 7_000_000)]
    assert [a.id for a in journal.query(AlarmFilter(active=True))[0]] == [kept]


def test_a_second_writer_learns_who_has_the_journal(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    holder = f"""
from pathlib import Path
from service.store.journal import Journal
journal = Journal(Path({str(path)!r}))
print("open", flush=True)
input()
"""
    command = [sys.executable, "-c", holder]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "open\n"
        with pytest.raises(StoreInUseError, match=rf"alarms.sqlite is in use by process {process.pid};"):
            Journal(path)
        process.kill()
    Journal(path).close()


def test_readers_see_whole_transactions_while_the_writer_works(journal: Journal) -> None:
    done = threading.Event()
    odd: list[int] = []

    def read() -> None:
        while not done.is_set():
            alarms, total = journal.query(limit=1000)
            if total % 2 or len(alarms) != total:
                odd.append(total)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for k in range(100):
        pair = [AlarmEntry("demo.axis1", "1", 1.0, replace(episode(p, raised_us=k), ended_us=k)) for p in ("fm", "kT")]
        journal.record(pair)
    done.set()
    for reader in readers:
        reader.join()
    assert odd == []
    assert journal.query()[1] == 200


# --- damaged files: nothing is deleted, and the program goes on ---------------------------------------------


def filled(path: Path) -> bytes:
    journal = Journal(path)
    for k in range(200):
        raised(journal, replace(episode(f"p{k}", raised_us=k), ended_us=k))
    journal.close()
    return path.read_bytes()


@pytest.mark.parametrize(
    "damage",
    [
        lambda data, random_: random_.randbytes(len(data)),
        lambda data, random_: data[: random_.randrange(1, len(data) - 4096)],
        lambda data, random_: data[:4096] + random_.randbytes(4096) + data[8192:],
    ],
    ids=["noise", "truncated", "page overwritten"],
)
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
    raised(journal, episode())
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


def test_nothing_is_written_to_a_file_that_has_been_moved_or_replaced(journal: Journal, tmp_path: Path) -> None:
    """A deleted file would take it without an error, and it would be lost."""
    folder, away = tmp_path / "state", tmp_path / "away"
    raised(journal, episode())
    folder.rename(away)
    for use in (lambda: raised(journal, episode("kT")), journal.standing):
        with pytest.raises(StoreError, match=r"alarms\.sqlite is no longer there: put it back, or restart"):
            use()
    folder.mkdir()
    with pytest.raises(StoreError, match="is no longer there"):
        journal.standing()
    (folder / "alarms.sqlite").touch()
    for use in (lambda: raised(journal, episode("kT")), journal.standing):
        with pytest.raises(StoreError, match=r"alarms\.sqlite has been replaced by another file"):
            use()
    (folder / "alarms.sqlite").unlink()
    folder.rmdir()
    away.rename(folder)
    raised(journal, episode("kT"))
    assert [alarm.parameter for alarm in journal.standing()] == ["fm", "kT"]


def test_files_that_are_empty_closed_or_cannot_be(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    path.touch()
    journal = Journal(path)
    assert (journal.messages, journal.query()) == ((), ([], 0))
    journal.close()
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"file/alarms\.sqlite"):
        Journal(tmp_path / "file" / "alarms.sqlite")
    (tmp_path / "folder").mkdir()
    with pytest.raises(StoreError, match="folder: unable to open"):
        Journal(tmp_path / "folder")
    journal = Journal(tmp_path / "alarms.sqlite")
    journal.close()
    with pytest.raises(StoreError, match="closed"):
        raised(journal, episode())


def test_a_newer_schema_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    filled(path)
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA user_version=99")
    connection.close()
    with pytest.raises(StoreError, match=r"newer version of axiswatch .*99"):
        Journal(path)
    assert list(tmp_path.glob("*.damaged-*")) == []
