"""A full disk: a small one that is really mounted, which needs root; without it these tests are skipped."""

import os
import random
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent
from service.pipeline.axes.axis_alarms import AxisAlarm, JournalQuantity
from service.pipeline.persistence.alarm_recording import RETRY_S, AlarmRecorder
from service.store.alarm_transitions import Note
from service.store.archive import FORMAT, Manifest, restore_archive, write_archive
from service.store.checkpoints import Checkpoints
from service.store.database import StoreError
from service.store.history_store import Bounds, HistoryStore
from service.store.journal import Journal

AXIS = "demo.axis1"
ALARM = Alarm("p", "up", 10, 20, 20, None, 0.5, 0.1, 1)


class SmallDisk:
    """A disk of half a megabyte."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._filler = folder, folder / "filler"

    def fill(self) -> None:
        """Up to the last byte."""
        with self._filler.open("ab", buffering=0) as file:
            for size in (4096, 1):
                try:
                    while file.write(bytes(size)) == size:
                        pass
                except OSError:
                    continue

    def fill_but(self, left: int) -> None:
        """Up to so many bytes."""
        disk = os.statvfs(self.folder)
        with self._filler.open("ab", buffering=0) as file:
            file.write(bytes(disk.f_bavail * disk.f_frsize - left))

    def free(self) -> None:
        """As before."""
        self._filler.unlink()


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    folder = tmp_path / "small"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        pytest.skip(f"no disk can be mounted: {error}")
    if mounted.returncode:
        pytest.skip(f"no disk can be mounted: {mounted.stderr.strip()}")
    yield SmallDisk(folder)
    subprocess.run(["umount", "--lazy", str(folder)], check=True)  # a test that fails leaves files open


def comment_until_full(journal: Journal) -> None:
    """Some comments may fit into what earlier commits have left of the file."""
    for _ in range(100):
        journal.act(1, AlarmEvent.COMMENT, Note(40, "anna", "x" * 2000))


@pytest.mark.parametrize("store", [Journal, Checkpoints, lambda path: HistoryStore(path, Bounds({}, 1e9))])
def test_a_disk_that_is_full_at_the_start_is_an_error_that_names_the_file(
    store: Callable[[Path], Journal | Checkpoints | HistoryStore], disk: SmallDisk
) -> None:
    disk.fill()
    path = disk.folder / "state.sqlite"
    with pytest.raises(StoreError, match=r"state\.sqlite\.lock: No space left on device"):
        store(path)
    disk.free()
    store(path).close()
    disk.fill()
    with pytest.raises(StoreError, match=r"state\.sqlite"):
        store(path)
    disk.free()
    store(path).close()


def test_a_shelf_that_is_over_hides_nothing_though_its_end_cannot_be_recorded(disk: SmallDisk) -> None:
    journal, now = Journal(disk.folder / "alarms.sqlite"), [0.0]
    alarms = AlarmRecorder(journal, {(AXIS, "p"): JournalQuantity("1", 1.0)}, lambda: now[0])
    alarms.record([AxisAlarm(AXIS, ALARM)])
    journal.act(1, AlarmEvent.SHELVE, Note(30, "anna"), 100)
    disk.fill()
    with pytest.raises(StoreError, match="full"):
        comment_until_full(journal)
    (alarm,) = (a for a in alarms.snapshot(200).standing if a.parameter == "p")
    assert alarm.state == "shelved"
    assert alarm.life.at(200).state == "unacknowledged"
    disk.free()
    now[0] += RETRY_S
    (alarm,) = (a for a in alarms.snapshot(200).standing if a.parameter == "p")
    assert alarm.state == "unacknowledged"
    journal.close()


def test_a_read_only_disk_names_the_folder_that_must_be_writable(disk: SmallDisk) -> None:
    subprocess.run(["mount", "-o", "remount,ro", str(disk.folder)], check=True)
    words = f"Read-only file system: {disk.folder} must be a folder that the user of the daemon can write"
    with pytest.raises(StoreError, match=words):
        Journal(disk.folder / "alarms.sqlite")


def test_a_backup_names_the_disk_that_is_full(disk: SmallDisk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the archive, that of the copies, or that of the restored folder; never the file that was read."""
    journal = Journal(tmp_path / "alarms.sqlite")
    for text in (tmp_path / "robot.toml", tmp_path / "drive.bin"):
        text.write_bytes(random.Random(1).randbytes(400_000))
    sources = {
        path.name: path for path in (tmp_path / "robot.toml", tmp_path / "drive.bin", tmp_path / "alarms.sqlite")
    }
    manifest = Manifest(FORMAT, "0.1", "", "robot.toml", {}, [], {})
    with pytest.raises(StoreError) as refused:
        write_archive(disk.folder / "b.tar.gz", manifest, sources)
    assert str(refused.value) == f"{disk.folder / 'b.tar.gz'}: No space left on device"
    assert list(disk.folder.iterdir()) == []
    archive = tmp_path / "b.tar.gz"
    write_archive(archive, manifest, sources)
    with pytest.raises(StoreError) as refused:
        restore_archive(archive, disk.folder / "new")
    assert str(refused.value) == f"{disk.folder / 'new'}: No space left on device"
    assert list(disk.folder.iterdir()) == []
    monkeypatch.setattr(tempfile, "tempdir", str(disk.folder))
    for source in ("drive.bin", "alarms.sqlite"):
        disk.fill_but(30_000)
        with pytest.raises(StoreError) as refused:
            write_archive(archive, manifest, {source: sources[source]})
        assert str(refused.value) == (
            f"copies in {disk.folder} (TMPDIR names another folder for them): No space left on device"
        )
        disk.free()
    journal.close()
