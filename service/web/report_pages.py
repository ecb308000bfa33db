"""Serves the reports that ``axiswatch commission`` has written beside the configuration, read-only.

Their names follow from the axes; no other file of that folder is served.
"""

from collections.abc import Iterable
from pathlib import Path
from urllib.parse import quote

from fastapi import APIRouter
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException

from service.config.written.commissioning_files import REPORT, pages_of

_PREFIX = "/reports"
PAGE_HEADERS = {
    # A report is one file with its styles and pictures.  Allow no scripts, forms, frames or other sources.
    "content-security-policy": "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none';"
    " frame-ancestors 'self'; sandbox"
}


class ReportPages:
    """The reports of these axes in a folder; files may appear and disappear."""

    def __init__(self, folder: Path, axis_ids: Iterable[str]) -> None:
        self._folder = folder
        self._names = frozenset([REPORT, *(name for axis_id in axis_ids for name in pages_of(axis_id))])

    def find(self, name: str) -> Path | None:
        """The file with this name; None: it is no report, or does not exist."""
        path = self._folder / name
        return path if name in self._names and path.is_file() else None

    @property
    def address(self) -> str | None:
        """Address of the summary; None: it does not exist."""
        return self.address_of(REPORT)

    def address_of(self, name: str) -> str | None:
        """Address of the report with this name; None: it does not exist."""
        return None if self.find(name) is None else f"{_PREFIX}/{quote(name)}"


def router(pages: ReportPages) -> APIRouter:
    """The routes of the reports."""
    routes = APIRouter(prefix=_PREFIX, include_in_schema=False)

    @routes.get("/{name}")
    def page(name: str) -> FileResponse:
        path = pages.find(name)
        if path is None:
            raise HTTPException(404)
        return FileResponse(path, media_type="text/html", headers=PAGE_HEADERS)

    return routes
