"""REST of the history of an axis: columns for plots, and files.  Few threads read, so that no sample is lost."""

import asyncio
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from typing import IO, Annotated, Any, Literal, TypeVar
from urllib.parse import quote

from fastapi import APIRouter, Depends, Query, Response
from fastapi.responses import StreamingResponse
from starlette.exceptions import HTTPException

from service.store.history_query import MOST_POINTS, HistoryAnswer, Question, ask, pages
from service.store.history_store import HistoryStore, Resolution
from service.web import models
from service.web.app_state import AppState
from service.web.history_json import TABLE_COLUMNS, history_json, history_table
from service.web.problem_details import NOT_FOUND, described
from service.web.routes.alarm_routes import Moment, in_order

MOST_READERS = 2
"""Most readers at the same time, as each takes a part of a processor"""
MOST_WAITING = 16
"""Most waiting readers; further requests are answered with 503."""
_CHUNK = 1 << 18

_REVERSED = described(400, "since is not before until")
_BUSY = described(503, "Too many ask for the history at this moment, or its file cannot be read (yet)")
_T = TypeVar("_T")

Only = Annotated[str | None, Query(description="only this parameter; default: all")]
Points = Annotated[int, Query(ge=1, le=MOST_POINTS, description="at most this number of rows")]
AsStored = Annotated[
    Resolution | None,
    Query(description="raw, minute, hour, day; default: rows so long that there are at most `points`"),
]
FileResolution = Annotated[
    Resolution | None,
    Query(description="raw, minute, hour, day; default: the finest that goes back to since"),
]


class Readers:
    """Threads that read the history, separate from those of other requests."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(MOST_READERS, "history-reader")
        self._busy = 0  # changed on the event loop only

    async def run(self, work: Callable[[], _T]) -> _T:
        """Run ``work`` in one of the threads; it is finished even if the client has gone.

        Raises:
            HTTPException: too many requests are waiting.
        """
        if self._busy >= MOST_READERS + MOST_WAITING:
            raise HTTPException(503, "too many ask for the history now; ask again", headers={"Retry-After": "1"})
        self._busy += 1
        done = asyncio.get_running_loop().run_in_executor(self._pool, work)
        done.add_done_callback(self._finished)
        return await asyncio.shield(done)

    def _finished(self, done: asyncio.Future[_T]) -> None:
        self._busy -= 1
        if not done.cancelled():
            done.exception()  # marks an error as seen, as the client may have gone


class HistoryFilters:
    """The requested part of the history of an axis."""

    def __init__(self, axis: str, parameter: Only = None, since: Moment = None, until: Moment = None) -> None:
        self.axis, self.parameter = axis, parameter
        since_us, until_us = in_order(since, until)
        self.since_s = None if since_us is None else since_us // 1_000_000
        self.until_s = None if until_us is None else -(-until_us // 1_000_000)


Filters = Annotated[HistoryFilters, Depends()]


def router(state: AppState) -> APIRouter:
    """The routes of the history below /api/v1/axes/{axis}."""
    api = APIRouter(prefix="/axes/{axis}", responses=NOT_FOUND | _REVERSED | _BUSY)
    readers = Readers()

    @api.get("/history", summary="History of an axis", response_model=models.History)
    async def history(f: Filters, points: Points = 600, resolution: AsStored = None) -> Response:
        """Estimates, tests and observability over time, oldest first, in columns; the newest points may be missing."""
        found, store = state.axis(f.axis, f.parameter), _store(state)
        nominals = {p.name: (p.unit, p.nominal) for p in found.status.parameters}
        wanted = {f.parameter: nominals[f.parameter]} if f.parameter is not None else nominals
        question = _question(state, f, points, resolution)

        def answered() -> bytes:
            if state.history is not None:
                state.history.freshen()
            return history_json(found.id, ask(store, question), wanted)

        body = await readers.run(answered)
        return Response(body, media_type="application/json")

    async def file(f: HistoryFilters, resolution: Resolution | None, kind: Literal["csv", "parquet"]) -> Response:
        found, store = state.axis(f.axis, f.parameter), _store(state)
        answers = partial(pages, store, _question(state, f, MOST_POINTS, resolution))
        content = await readers.run(lambda: _written(answers(), kind))
        name = f"{found.id}-history.{kind}"
        headers = {"Content-Disposition": f"attachment; filename*=utf-8''{quote(name)}"}
        return StreamingResponse(_chunks(content), media_type=_MEDIA[kind], headers=headers)

    @api.get(
        "/history.csv", summary="History as CSV", response_class=Response, responses=_file_answer("csv")
    )  # fmt: skip
    async def csv(f: Filters, resolution: FileResolution = None) -> Response:
        """A table with a row for each parameter and time; times are the beginnings of the rows, in UTC."""
        return await file(f, resolution, "csv")

    @api.get(
        "/history.parquet", summary="History as Parquet", response_class=Response,
        responses=_file_answer("parquet"),
    )  # fmt: skip
    async def parquet(f: Filters, resolution: FileResolution = None) -> Response:
        """The same table as a Parquet file."""
        return await file(f, resolution, "parquet")

    return api


_MEDIA = {"csv": "text/csv", "parquet": "application/vnd.apache.parquet"}


def _file_answer(kind: Literal["csv", "parquet"]) -> dict[int | str, dict[str, Any]]:
    """The answer with a file, for the schema."""
    return {200: {"content": {_MEDIA[kind]: {"schema": {"type": "string", "format": "binary"}}}}}


def _question(state: AppState, f: HistoryFilters, points: int, resolution: Resolution | None) -> Question:
    interval_s = 1.0 if state.history is None else state.history.interval_s
    return Question(f.axis, interval_s, f.parameter, f.since_s, f.until_s, points, resolution)


def _store(state: AppState) -> HistoryStore:
    """The history."""
    store = None if state.history is None else state.history.store
    if store is None:
        raise HTTPException(503, "the file of the history is not open (yet)", headers={"Retry-After": "5"})
    return store


def _written(answers: Iterator[HistoryAnswer], kind: Literal["csv", "parquet"]) -> IO[bytes]:
    """Write a temporary file, which is removed when it is closed."""
    from service.ingest.tables.table_files import write_csv, write_parquet  # 40 MB that few daemons need

    write = write_csv if kind == "csv" else write_parquet
    with ExitStack() as stack:
        try:
            file = stack.enter_context(tempfile.TemporaryFile())
            write(file, TABLE_COLUMNS, map(history_table, answers))
            file.seek(0)
        except OSError as error:
            raise HTTPException(503, f"there is no room for the file: {error}") from None
        stack.pop_all()  # the reader of the file closes it
    return file


def _chunks(file: IO[bytes]) -> Iterator[bytes]:
    with file:
        yield from iter(partial(file.read, _CHUNK), b"")
