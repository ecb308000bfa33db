"""REST under /api/v1/recordings: files with the raw frames around alarms, and a new one on request."""

from concurrent.futures import TimeoutError as NotWrittenError
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter
from fastapi import Path as PathParameter
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException

from monitor_core.wording import sentence
from service.can.user_errors import RecordError
from service.pipeline.persistence.recording import Extracts
from service.web import models
from service.web.access import Operator
from service.web.problem_details import NOT_FOUND, UnknownResourceError, described

_WAIT_S = 20.0
"""Longest wait for the writer, as the disk may be slow"""


def router(extracts: Extracts | None) -> APIRouter:
    """The routes below /api/v1/recordings; ``extracts`` None: recordings are turned off."""
    api = APIRouter(prefix="/recordings")

    @api.get("", summary="Recordings")
    def recordings() -> models.Recordings:
        """The files with the raw frames around alarms, oldest first."""
        files = [] if extracts is None else extracts.folder.files()
        return models.Recordings(recordings=[_body(file) for file in files])

    @api.post(
        "", summary="Record the last minutes", status_code=201,
        responses=described(503, "There are no frames, or the disk does not take them"),
    )  # fmt: skip
    def record(_who: Operator) -> models.Recording:
        """Write the raw frames of the last minutes, as they are kept for an alarm, to a file."""
        if extracts is None:
            raise HTTPException(503, NO_FRAMES_KEPT)
        try:
            return _body(extracts.request().result(_WAIT_S))
        except RecordError as error:
            raise HTTPException(503, str(error)) from None
        except NotWrittenError:
            raise HTTPException(503, f"the file was not written within {_WAIT_S:.0f} s") from None

    @api.get(
        "/{name}", summary="One recording", response_class=FileResponse, responses=NOT_FOUND,
    )  # fmt: skip
    def recording(name: Annotated[str, PathParameter(description="as in the list")]) -> FileResponse:
        """A candump log, or .blf as configured, for `axiswatch replay`, can-utils, python-can or Vector's tools."""
        file = None if extracts is None else extracts.folder.file(name)
        if file is None:
            known = [] if extracts is None else [file.name for file in extracts.folder.files()]
            raise UnknownResourceError(f"there is no recording {name!r}", known)
        kind = "text/plain" if file.suffix == ".log" else "application/octet-stream"
        return FileResponse(file, media_type=kind, filename=file.name)

    return api


NO_FRAMES_KEPT = sentence("no frames kept", "recordings_mb in [service] is 0: no frames are kept")


def _body(file: Path) -> models.Recording:
    return models.Recording(name=file.name, size_bytes=file.stat().st_size)
