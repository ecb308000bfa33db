"""REST under /api/v1/system: process and files, configuration without secrets, audit trail."""

import os
import platform
import resource
import shutil
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, get_args

from fastapi import APIRouter, Query
from pydantic import Field
from starlette.exceptions import HTTPException

from service.config.public_text import public_text, public_words
from service.store.audit import Place, Subject
from service.store.database import SQLITE_VERSION
from service.texts.instants import iso
from service.web import views
from service.web.access import Admin
from service.web.app_state import AppState
from service.web.models import Body, TextOrNull, Time
from service.web.problem_details import described
from service.web.robot_setup import RobotSetup
from service.web.routes.alarm_routes import NOT_A_CURSOR, Cursor

_NO_FILE = described(503, "A file of the daemon cannot be read")
_NO_CURSOR = described(400, "No page has given this cursor")
_SUBJECTS: tuple[Subject, ...] = get_args(Subject)
_LIBRARIES = ("numpy", "scipy", "numba", "python-can", "cantools", "fastapi")


class DatabaseFile(Body):
    """A file of the state directory."""

    name: str
    size_bytes: int = Field(description="size with that of its -wal file")
    written: Time | None = Field(description="when it was written last, UTC; null: it is not there")
    problem: TextOrNull = Field(description="why it cannot be written now; null: it can")


class System(Body):
    """The process of the daemon and its files."""

    cpu_s: float = Field(description="processor time since the start [s]")
    uptime_s: float = Field(description="time since the process began [s]")
    memory_bytes: int | None = Field(description="main memory in use; null: not known")
    cores: int = Field(description="processors of the machine")
    versions: dict[str, str] = Field(description="of Python, SQLite, the system, and of libraries")
    databases: list[DatabaseFile] = Field(description="by name; each is checked when the daemon starts")
    damaged: list[str] = Field(description="damaged files that were put aside at a start; nothing reads them")
    free_bytes: int | None = Field(description="free on the disk of the state directory; null: not known")


class PublicConfiguration(Body):
    """The configuration that is in force."""

    file: str
    text: str = Field(
        description="TOML of what is set in the file or by the environment, without defaults, secrets, and the names of"
        " files with secrets"
    )


class AuditedChange(Body):
    """A change by a person or by a changed configuration."""

    at: Time = Field(description="UTC")
    who: str = Field(description="name of the token; local: no tokens; configuration: a changed file")
    subject: Subject
    event: str
    axis: str
    number: int = Field(description="of the alarm, or of the epoch of the axis; service: 0")
    parameter: TextOrNull = Field(description="of the alarm; null: of an epoch")
    comment: TextOrNull
    work_order: TextOrNull


class Audit(Body):
    """Changes, the newest first."""

    next: str | None = Field(description="cursor of the next page; null: this is the last one")
    changes: list[AuditedChange]


def router(state: AppState) -> APIRouter:
    """The routes below /api/v1/system; addresses and folders of the plant, and actions of persons, need admin."""
    api = APIRouter(prefix="/system")
    began = time.monotonic()

    @api.get("", summary="Process and files", responses=_NO_FILE)
    def system() -> System:
        """Processor time, memory, versions, and the databases with their sizes, last writes and problems."""
        setup = state.setup
        folder = setup.config().service.state_dir
        return System(
            cpu_s=time.process_time(),
            uptime_s=time.monotonic() - began,
            memory_bytes=_memory_bytes(),
            cores=os.cpu_count() or 1,
            versions=_versions(),
            databases=list(_databases(folder, setup)),
            damaged=sorted(path.name for path in folder.glob("*.damaged-*Z")),
            free_bytes=_free_bytes(folder),
        )

    @api.get("/configuration", summary="Configuration without secrets", responses=_NO_FILE)
    def configuration(_who: Admin) -> PublicConfiguration:
        """The configuration in force, also after a reload by SIGHUP, without secrets."""
        setup = state.setup
        text = public_text(setup.config(), setup.folder)
        return PublicConfiguration(file=str(setup.file), text=text)

    @api.get("/audit", summary="Who has changed what", responses=_NO_FILE | _NO_CURSOR)
    def audit(
        _who: Admin,
        limit: Annotated[int, Query(ge=1, le=1000, description="maximum number")] = 50,
        cursor: Cursor = None,
    ) -> Audit:
        """Actions of persons on alarms, axes and epochs, and epochs started by a changed configuration."""
        found = state.journal.audit(limit + 1, None if cursor is None else _place(cursor))
        page = found[:limit]
        following = f"{page[-1].at_us}.{page[-1].subject}.{page[-1].id}" if len(found) > limit else None
        return Audit(next=following, changes=[views.body(AuditedChange, entry) for entry in page])

    return api


def _place(cursor: str) -> Place:
    """Parse a cursor to the place where its page starts."""
    at_us, _, rest = cursor.partition(".")
    subject, _, number = rest.partition(".")
    if subject in _SUBJECTS and all(n.isascii() and n.isdigit() and len(n) <= 18 for n in (at_us, number)):
        return int(at_us), subject, int(number)
    raise HTTPException(400, NOT_A_CURSOR)


def _databases(folder: Path, setup: RobotSetup) -> Iterator[DatabaseFile]:
    problems = setup.problems()
    for name in sorted({*problems, *(path.name for path in folder.glob("*.sqlite"))}):
        sizes, times = [0], list[float]()
        for path in (folder / name, folder / f"{name}-wal"):
            try:
                found = path.stat()
            except OSError:
                continue
            sizes.append(found.st_size)
            times.append(found.st_mtime)
        written, problem = iso(round(max(times) * 1e6)) if times else None, problems.get(name)
        public = problem and public_words(problem, setup.folder)
        yield DatabaseFile(name=name, size_bytes=sum(sizes), written=written, problem=public)


def _versions() -> dict[str, str]:
    own = {"Python": platform.python_version(), "SQLite": SQLITE_VERSION}
    return {**own, "system": f"{platform.system()} {platform.release()}"} | {name: version(name) for name in _LIBRARIES}


def _memory_bytes() -> int | None:
    try:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()
    except (OSError, ValueError, IndexError):
        return None


def _free_bytes(folder: Path) -> int | None:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None
