"""Archives that are damaged, hostile or of a newer version restore nothing."""

import io
import json
import sqlite3
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from service.store.archive import (
    FORMAT,
    MANIFEST,
    SCHEMAS,
    ArchiveError,
    Manifest,
    restore_archive,
    state_files,
    write_archive,
)
from service.store.database import StoreError
from service.store.journal import Journal

TEXT = "[service]\n"
Change = Callable[[dict[str, Any], dict[str, bytes]], Any]
"""Of the manifest and of the contents"""


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Of a configuration, and of a journal that is open."""
    target = tmp_path / "kept.tar.gz"
    journal = Journal(tmp_path / "state" / "alarms.sqlite")
    sources: dict[str, Path | bytes] = {
        "a.toml": TEXT.encode(),
        "state/alarms.sqlite": tmp_path / "state" / "alarms.sqlite",
    }
    write_archive(target, Manifest(FORMAT, "0.1", "2026-01-01T00:00:00Z", "a.toml", {}, [], {}), sources)
    journal.close()
    return target


def members(archive: Path) -> dict[str, bytes]:
    with tarfile.open(archive) as found:
        return {member.name: found.extractfile(member).read() for member in found}  # type: ignore[union-attr]


def rewrite(archive: Path, change: Change) -> Path:
    """The archive with another manifest or other contents."""
    contents = members(archive)
    manifest = json.loads(contents.pop(MANIFEST))
    change(manifest, contents)
    with tarfile.open(archive, "w:gz") as target:
        for name, content in {MANIFEST: json.dumps(manifest).encode(), **contents}.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            target.addfile(member, io.BytesIO(content))
    return archive


def refused(archive: Path, folder: Path) -> str:
    """The message; nothing is left, beside the archive and in the folder."""
    before = sorted(folder.parent.rglob("*"))
    with pytest.raises(ArchiveError) as error:
        restore_archive(archive, folder)
    assert sorted(folder.parent.rglob("*")) == before
    return str(error.value)


def test_all_is_there_again_for_its_owner_alone(archive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "robot"
    manifest = restore_archive(archive, folder)
    assert manifest.files.keys() == {"a.toml", "state/alarms.sqlite"}
    assert (folder / "a.toml").read_text(encoding="utf-8") == TEXT
    Journal(folder / "state" / "alarms.sqlite").close()
    assert {path.stat().st_mode & 0o077 for path in (archive, folder, *folder.rglob("*.toml"))} == {0}


def test_an_empty_folder_will_do_no_other(archive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    restore_archive(archive, folder)
    assert refused(archive, folder) == f"{folder} is not empty: restore into a new folder"
    journal = Journal(folder / "state" / "alarms.sqlite")
    assert "is in use by the daemon, process " in refused(archive, folder)
    journal.close()
    assert refused(archive, folder / "a.toml") == f"{folder / 'a.toml'} is no folder: choose a new one"


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.99])
def test_a_part_of_an_archive(archive: Path, tmp_path: Path, share: float) -> None:
    content = archive.read_bytes()
    archive.write_bytes(content[: int(share * len(content))])
    assert "damaged" in refused(archive, tmp_path / "new")


def test_every_byte_counts(archive: Path, tmp_path: Path) -> None:
    """But for the first ten, in which gzip has a time and a kind of machine."""
    content, folder = archive.read_bytes(), tmp_path / "new"
    for at in range(10, len(content), len(content) // 40):
        archive.write_bytes(content[:at] + bytes([content[at] ^ 0x41]) + content[at + 1 :])
        assert "damaged" in (message := refused(archive, folder)) or "no backup" in message


@pytest.mark.parametrize("name", ["../a.toml", "/etc/a.toml", "state/../../a.toml", "./a.toml", "state//a", "", "a\0b"])
def test_a_name_that_leads_out_of_the_folder(archive: Path, tmp_path: Path, name: str) -> None:
    def rename(manifest: dict[str, Any], contents: dict[str, bytes]) -> None:
        manifest["files"][name] = manifest["files"].pop("a.toml")
        contents[name] = contents.pop("a.toml")

    assert f"{name!r} would lie outside the folder" in refused(rewrite(archive, rename), tmp_path / "new")


def test_what_is_no_regular_file(archive: Path, tmp_path: Path) -> None:
    contents = members(archive)
    with tarfile.open(archive, "w:gz") as target:
        head = tarfile.TarInfo(MANIFEST)
        head.size = len(contents[MANIFEST])
        target.addfile(head, io.BytesIO(contents[MANIFEST]))
        link = tarfile.TarInfo("a.toml")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        target.addfile(link)
    assert "'a.toml' is not in its manifest, or another file" in refused(archive, tmp_path / "new")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda _, c: c.update({"a.toml": TEXT.upper().encode()}), "a.toml is not as it was"),
        (lambda _, c: c.update({"a.toml": b"#"}), "'a.toml' is not in its manifest, or another file"),
        (lambda _, c: c.update({"b.toml": b""}), "'b.toml' is not in its manifest"),
        (lambda _, c: c.pop("a.toml"), "'a.toml' is missing"),
        (lambda m, _: m["files"]["a.toml"].pop("sha256"), "is damaged"),
        (lambda m, _: m.update(files=3), "is damaged"),
        (
            lambda m, _: m["files"]["state/alarms.sqlite"].update(schema=SCHEMAS["alarms.sqlite"] + 1),
            "alarms.sqlite was written by a newer version, axiswatch 0.1: install that",
        ),
        (
            lambda m, _: m.update(format=FORMAT + 1, axiswatch="9.0", what="is new"),
            "made by axiswatch 9.0, which is newer than this version: install that",
        ),
    ],
    ids=["text", "length", "one more", "one less", "no hash", "no files", "newer database", "newer format"],
)
def test_what_is_not_as_it_was_made(archive: Path, tmp_path: Path, change: Change, message: str) -> None:
    assert message in refused(rewrite(archive, change), tmp_path / "new")


@pytest.mark.parametrize("content", [b"", b"no archive", None], ids=["empty", "text", "missing"])
def test_what_is_no_archive(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "kept.tar.gz"
    if content is not None:
        file.write_bytes(content)
    assert str(file) in refused(file, tmp_path / "new")


def test_a_damaged_database_is_not_taken_for_a_backup(tmp_path: Path) -> None:
    database, target = tmp_path / "alarms.sqlite", tmp_path / "kept.tar.gz"
    with sqlite3.connect(database) as connection:
        connection.execute("CREATE TABLE t (x)")
        connection.executemany("INSERT INTO t VALUES (?)", [("x" * 1000,)] * 50)
    connection.close()
    content = database.read_bytes()
    database.write_bytes(content[:4096] + b"\xff" * 4096 + content[8192:])
    manifest = Manifest(FORMAT, "0.1", "", "a.toml", {}, [], {})
    with pytest.raises(StoreError, match="set aside when the daemon starts again"):
        write_archive(target, manifest, {"state/alarms.sqlite": database})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["alarms.sqlite"]


def test_what_a_backup_has_of_the_state(tmp_path: Path) -> None:
    for name in (
        "alarms.sqlite", "alarms.sqlite-wal", "alarms.sqlite-shm", "alarms.sqlite.lock", "checkpoints.sqlite",
        "alarms.sqlite.damaged-20260101T000000.0Z", "tokens.json", "recordings/a.log", "history.sqlite", "deep/a.toml",
    ):  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    wanted = ["checkpoints.sqlite", "deep/a.toml", "history.sqlite", "tokens.json", "alarms.sqlite"]
    assert list(state_files(tmp_path)) == wanted
    with pytest.raises(StoreError, match="No such file"):
        state_files(tmp_path / "nowhere")
