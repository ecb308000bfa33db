"""Backups: files and databases in one .tar.gz with a manifest of their SHA-256; restored completely or not at all."""

import errno
import fcntl
import gzip
import hashlib
import io
import json
import os
import re
import shutil
import sqlite3
import tarfile
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, Any, NamedTuple

from service.store.checkpoints import MIGRATIONS as CHECKPOINT_MIGRATIONS
from service.store.database import StoreError, check_integrity
from service.store.history_store import MIGRATIONS as HISTORY_MIGRATIONS
from service.store.journal import MIGRATIONS as JOURNAL_MIGRATIONS
from service.store.outbox import MIGRATIONS as OUTBOX_MIGRATIONS
from service.store.outbox import OUTBOX_FILE
from service.store.private_file import replacing

MANIFEST = "backup.json"
"""Name of the first member of an archive"""
FORMAT = 1
SCHEMAS = {
    "alarms.sqlite": len(JOURNAL_MIGRATIONS),
    "checkpoints.sqlite": len(CHECKPOINT_MIGRATIONS),
    "history.sqlite": len(HISTORY_MIGRATIONS),
    OUTBOX_FILE: len(OUTBOX_MIGRATIONS),
}
"""The newest schema of each database that this version can read"""
DATABASE = ".sqlite"
NOT_KEPT = re.compile(r"recordings|.*\.sqlite(-wal|-shm|\.lock)|.*\.damaged-.*|\..*")
"""Files of a state directory that are left out: recordings are large; others belong to a running daemon or are
damaged"""

_PRIVATE = 0o600
_MOST_MANIFEST, _PIECE = 2**24, 2**20


class ArchiveError(Exception):
    """The archive cannot be used, or not restored to this folder; the text says why, and what to do."""


class Manifest(NamedTuple):
    """Contents of an archive, stored in its first member."""

    format: int
    axiswatch: str
    """Version of the program"""
    made: str
    """ISO 8601, UTC"""
    configuration: str
    """Name of the configuration file in the archive"""
    renamed: dict[str, str]
    """Files from outside the folder of the configuration, with their names in the archive"""
    left_out: list[str]
    """Files that the configuration needs but the archive does not contain, as they are secret"""
    files: dict[str, dict[str, Any]]
    """SHA-256 and size of each file by its name, for a database also its schema"""


# --- Writing an archive -----------------------------------------------------------------------------------------------


def state_files(state_dir: Path) -> dict[str, Path]:
    """The files of a state directory for a backup, by their names relative to it.

    The journal comes last: it must not be older than the checkpoints; a start handles one that is newer.

    Raises:
        StoreError: the folder cannot be read.
    """
    try:
        paths = [*_below(state_dir)]
    except OSError as error:
        where = "[service] state_dir, or $STATE_DIRECTORY of a service, must be the folder in which the daemon runs"
        if isinstance(error, FileNotFoundError):
            where += "; before its first run there is none yet: --without-state saves the configuration alone"
        raise StoreError(f"{state_dir}: {error.strerror}; {where}") from error
    names = {path.relative_to(state_dir).as_posix(): path for path in paths}
    return dict(sorted(names.items(), key=lambda item: (item[0] == "alarms.sqlite", item[0])))


def _below(folder: Path) -> Iterator[Path]:
    for entry in sorted(folder.iterdir()):
        if NOT_KEPT.fullmatch(entry.name):
            continue
        if entry.is_dir():
            yield from _below(entry)
        elif entry.is_file():
            yield entry


def write_archive(target: Path, manifest: Manifest, sources: Mapping[str, Path | bytes]) -> Manifest:
    """Write an archive; a database is copied in a consistent state while its daemon runs.

    Args:
        target: replaced when all is written; only its owner may read it.
        manifest: the manifest without files.
        sources: content or path of each file, by its name in the archive.

    Returns: the manifest with its files.

    Raises:
        StoreError: a file cannot be read, a database is damaged, or the archive cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="axiswatch-backup-") as name:
        with _explained(f"copies in {tempfile.gettempdir()} (TMPDIR names another folder for them)"):
            copies = {member: _copied(source, Path(name, str(i))) for i, (member, source) in enumerate(sources.items())}
            entries = {member: _entry(copy, member) for member, copy in sorted(copies.items())}
        manifest = manifest._replace(files=entries)
        with (
            _explained(target),
            replacing(target) as file,
            tarfile.open(fileobj=file, mode="w:gz", compresslevel=6) as archive,
        ):
            head = json.dumps(manifest._asdict(), indent=1).encode()
            archive.addfile(_member(MANIFEST, len(head)), io.BytesIO(head))
            for member, entry in entries.items():
                with copies[member].open("rb") as content:
                    archive.addfile(_member(member, entry["size"]), content)
    return manifest


def _copied(source: Path | bytes, copy: Path) -> Path:
    if isinstance(source, bytes):
        copy.write_bytes(source)
    elif source.suffix == DATABASE:
        _copy_database(source, copy)
    else:
        shutil.copyfile(source, copy)
    return copy


def _copy_database(source: Path, copy: Path) -> None:
    """Copy a database by SQLite's online backup, as one file with all commits up to one moment."""
    try:
        with (
            closing(sqlite3.connect(f"{source.resolve().as_uri()}?mode=ro", uri=True)) as live,
            closing(sqlite3.connect(copy)) as kept,
        ):
            live.backup(kept)
            kept.execute("PRAGMA journal_mode=DELETE")
            check_integrity(kept)
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_FULL:  # that of the copy
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
        raise StoreError(f"{source}: {error}; a damaged file is set aside when the daemon starts again") from error


def _entry(file: Path, member: str) -> dict[str, Any]:
    with file.open("rb") as content:
        entry = {"sha256": hashlib.file_digest(content, "sha256").hexdigest(), "size": file.stat().st_size}
    return entry | ({"schema": _schema(file)} if member.endswith(DATABASE) else {})


def _schema(file: Path) -> int:
    with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as connection:
        check_integrity(connection)
        return int(connection.execute("PRAGMA user_version").fetchone()[0])


def _member(name: str, size: int) -> tarfile.TarInfo:
    member = tarfile.TarInfo(name)
    member.size, member.mode = size, _PRIVATE
    return member


@contextmanager
def _explained(written: Path | str) -> Iterator[None]:
    """Turn errors of the file system into a StoreError that names the file; ``written``: what is written."""
    try:
        yield
    except OSError as error:
        # A full disk is that of what is written, whatever file was read.
        place = written if error.filename is None or error.errno == errno.ENOSPC else error.filename
        raise StoreError(f"{place}: {error.strerror or error}") from error


# --- Restoring an archive ---------------------------------------------------------------------------------------------


def restore_archive(archive: Path, folder: Path) -> Manifest:
    """Make the folder with all files of the archive; if any file differs from the manifest, change nothing.

    Raises:
        ArchiveError: the archive is damaged or of a newer version, or the folder is not empty.
        StoreError: the archive cannot be read, or the folder cannot be written.
    """
    folder = folder.absolute()
    if not archive.is_file():
        raise ArchiveError(f"{archive} is not there, or no file")
    with _explained(folder):
        _must_be_free(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))  # private to its owner
        try:
            manifest = _extract(archive, part)
            for name, entry in manifest.files.items():
                _verify(archive, part / name, name, entry)
            os.rename(part, folder)
        except BaseException:
            shutil.rmtree(part)
            raise
    return manifest


def _must_be_free(folder: Path) -> None:
    if not os.path.lexists(folder):
        return
    if not folder.is_dir():
        raise ArchiveError(f"{folder} is no folder: choose a new one")
    for lock in folder.rglob(f"*{DATABASE}.lock"):
        with lock.open("rb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                process = file.read().decode("ascii", "replace").strip() or "unknown"
                raise ArchiveError(
                    f"{folder} is in use by the daemon, process {process}: restore into a new folder, stop the daemon,"
                    " then let it run with that"
                ) from None
    if any(folder.iterdir()):
        raise ArchiveError(f"{folder} is not empty: restore into a new folder")


def _extract(archive: Path, folder: Path) -> Manifest:
    """Write the files that the manifest names; any other file, or a second one of the same name, is an error."""
    try:
        with gzip.open(archive) as packed, tarfile.open(fileobj=packed, mode="r:") as members:
            manifest = _read_manifest(archive, members)
            missing = dict(manifest.files)
            while (member := members.next()) is not None:
                entry = missing.pop(member.name, None)
                if entry is None or not member.isreg() or member.size != entry["size"]:
                    raise _damaged(archive, f"{member.name!r} is not in its manifest, or another file")
                target = folder / member.name
                target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                content = members.extractfile(member)
                assert content is not None
                _write(target, content)
            while packed.read(_PIECE):  # read to the end, so that gzip checks its checksum
                pass
    except (tarfile.TarError, zlib.error, EOFError, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # an error of the file system; errors of gzip have no number
        raise _damaged(archive, str(error) or "it ends too early") from error
    if missing:
        raise _damaged(archive, f"{min(missing)!r} is missing")
    return manifest


def _read_manifest(archive: Path, members: tarfile.TarFile) -> Manifest:
    first = members.next()
    if first is None or first.name != MANIFEST or not first.isreg() or first.size > _MOST_MANIFEST:
        raise ArchiveError(f"{archive} is no backup of axiswatch: its first file must be {MANIFEST}")
    content = members.extractfile(first)
    assert content is not None
    try:
        values = json.loads(content.read())
        if isinstance(values["format"], int) and values["format"] > FORMAT:
            raise ArchiveError(
                f"{archive} was made by axiswatch {values['axiswatch']}, which is newer than this version: install that"
            )
        manifest = Manifest(**values)
        for name, entry in manifest.files.items():
            _must_be_name(archive, name)
            known = SCHEMAS.get(PurePosixPath(name).name)
            if known is not None and int(entry["schema"]) > known:
                raise ArchiveError(
                    f"{archive}: {name} was written by a newer version, axiswatch {manifest.axiswatch}: install that"
                )
            if not {"size", "sha256"} <= entry.keys():
                raise KeyError(name)
        _must_be_name(archive, manifest.configuration)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _damaged(archive, f"{MANIFEST}: {error}") from error
    return manifest


def _must_be_name(archive: Path, name: str) -> None:
    """Check that a name stays below the folder."""
    path = PurePosixPath(name)
    if path.is_absolute() or str(path) != name or not {"..", "."}.isdisjoint(path.parts) or "\0" in name:
        raise _damaged(archive, f"{name!r} would lie outside the folder")


def _write(target: Path, content: IO[bytes]) -> None:
    with open(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _PRIVATE), "wb") as file:
        shutil.copyfileobj(content, file)
        file.flush()
        os.fsync(file.fileno())


def _verify(archive: Path, file: Path, name: str, entry: Mapping[str, Any]) -> None:
    try:
        found = _entry(file, name)
    except sqlite3.Error as error:
        raise _damaged(archive, f"{name}: {error}") from error
    if found != entry:
        raise _damaged(archive, f"{name} is not as it was: its SHA-256 or its schema differs from the manifest")


def _damaged(archive: Path, why: str) -> ArchiveError:
    return ArchiveError(f"{archive} is damaged, nothing was restored: {why}; take another backup")
