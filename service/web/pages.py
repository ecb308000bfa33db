"""The page at /, the documentation at /docs and their files, without requests to other hosts."""

from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

STATIC = Path(__file__).parent / "static"

_POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'"
_HEADERS = {
    "content-security-policy": f"{_POLICY}; base-uri 'none'; form-action 'none'; frame-ancestors 'self'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    # Values change every second, files with the next version: the browser must not cache them.
    "cache-control": "no-cache",
}


def router() -> APIRouter:
    """The routes."""
    pages = APIRouter(include_in_schema=False)

    @pages.get("/")
    def index() -> FileResponse:
        return FileResponse(STATIC / "index.html")

    @pages.get("/docs")
    def docs() -> FileResponse:
        return FileResponse(STATIC / "docs.html")

    return pages


def files() -> StaticFiles:
    """Scripts, styles and pictures of the pages."""
    return StaticFiles(directory=STATIC)


class SecurityHeaders:
    """Adds headers to every answer that forbid the browser everything that the pages do not need."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._headers = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *self._headers]
            await send(message)

        await self._app(scope, receive, send_with_headers)
