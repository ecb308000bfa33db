"""What every request passes before the application sees it, and every answer on its way back.

The host it asks for is one of the daemon, its body is small, its caller is known; a web page of somebody else changes
nothing.  HEAD is answered wherever GET is.  Each request that would change something leaves one line in the log.
"""

import asyncio
import re
from urllib.parse import urlsplit

import structlog
from fastapi.responses import JSONResponse
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.store.database import StoreError
from service.store.tokens import Caller
from service.web.access import Access
from service.web.models import Problem, problem_answer

log = structlog.get_logger(__name__)

MOST_BODY_BYTES = 64 * 1024
"""Of a request; the largest that the API has is a comment of an operator."""
LONGEST_REQUEST_S = 30.0
"""Until its body has arrived and its answer has begun."""
REPORTS = "/reports/"
COOKIE = "axiswatch-token"
"""Holds the token for reports only: a link sends no Authorization header.  Nothing can be changed there."""

_HOST = re.compile(r"(?:\[(?P<v6>[0-9A-Fa-f:.]+)\]|(?P<name>[^\s:/@\[\]]+))(?::\d{1,5})?")
_READING = ("GET", "HEAD", "OPTIONS")
_LONGEST_PATH = 200
_POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'"
_HEADERS = {
    "content-security-policy": f"{_POLICY}; base-uri 'none'; form-action 'none'; frame-ancestors 'self'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-embedder-policy": "require-corp",
    "cross-origin-resource-policy": "same-origin",
}
_HSTS = "max-age=31536000"


def is_page(path: str) -> bool:
    """A file of the pages.  They are the same on every machine, so they need no token: the page asks for it."""
    return path in ("/", "/docs") or path.startswith("/static/")


class _TooLargeError(Exception):
    """More of a body has arrived than is accepted."""


class Gate:
    """ASGI middleware around the application."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access
        self._open = {"/healthz", *(["/metrics"] if access.open_metrics else [])}
        self._reported: str | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        answer = _Answer(scope, send)
        who = "nobody"
        try:
            refusal, caller = self._judged(scope)
            if caller is not None:
                who = caller.name
            if refusal is None:
                await self._pass(scope, receive, answer, caller)
            else:
                await refusal(scope, receive, answer.send)
        finally:
            if scope["method"] not in _READING:
                what = f"{scope['method']} {_written(scope)}"
                log.info("write request", who=who, what=what, result=answer.status or 500)

    def _judged(self, scope: Scope) -> tuple[JSONResponse | None, Caller | None]:
        """The refusal of a request, if it is refused; who sent it, if that is known."""
        headers = Headers(scope=scope)
        if (refusal := self._misdirected(scope, headers) or _too_large(headers)) is not None:
            return refusal, None
        path = scope["path"]
        try:
            caller = self._access.caller(_secret(headers, path))
        except StoreError as error:
            if str(error) != self._reported:  # once, however many ask
                self._reported = str(error)
                log.error("tokens", message=str(error))
            if path in self._open or is_page(path):
                return None, None
            return problem_answer(503, Problem(detail="the tokens cannot be read; the log says why")), None
        if scope["method"] not in _READING and _of_another_page(headers):
            return problem_answer(
                403, Problem(detail="a page of another host may change nothing here")
            ), caller
        if caller is None and not (path in self._open or is_page(path)):
            return _unknown(headers), None
        return None, caller

    def _misdirected(self, scope: Scope, headers: Headers) -> JSONResponse | None:
        """A name that the daemon does not have: a foreign page whose name was made to lead here (DNS rebinding)."""
        given = headers.getlist("host")
        found = _HOST.fullmatch(given[0]) if len(given) == 1 else None
        if found is not None:
            host = found["v6"] or found["name"]
            if self._access.known_host(host) or host == (scope.get("server") or [""])[0]:
                return None
        detail = "this daemon has another name; add the host name of the request to hosts in [web]"
        return problem_answer(421, Problem(detail=detail))

    async def _pass(self, scope: Scope, receive: Receive, answer: "_Answer", caller: Caller | None) -> None:
        inner = {
            **scope,
            "state": {**scope.get("state", {}), "caller": caller or Caller("nobody", frozenset())},
        }
        if scope["method"] == "HEAD":
            inner["method"] = "GET"
        try:
            async with asyncio.timeout(LONGEST_REQUEST_S):
                await self._app(inner, _limited(receive), answer.send)
        except _TooLargeError:
            if answer.status is None:
                await _no_room()(scope, receive, answer.send)
        except TimeoutError:
            if answer.status is not None:
                raise
            words = f"not complete, or not answered, within {LONGEST_REQUEST_S:g} s"
            refusal = problem_answer(503, Problem(detail=words), {"Connection": "close"})
            await refusal(scope, receive, answer.send)


class _Answer:
    """An answer on its way: with the headers of all, without a body if only the head was asked for."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self._scope, self._send = scope, send
        self.status: int | None = None

    async def send(self, message: Message) -> None:
        """Pass a message on to the server."""
        if message["type"] == "http.response.start":
            self.status = message["status"]
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)
            # Files change with the next version: the browser must ask each time.  Data is for nobody to keep.
            headers.setdefault("cache-control", "no-cache" if is_page(self._scope["path"]) else "no-store")
            if self._scope["scheme"] == "https":
                headers["strict-transport-security"] = _HSTS
        elif self._scope["method"] == "HEAD":
            message = {**message, "body": b""}
        await self._send(message)


def _limited(receive: Receive) -> Receive:
    """A body whose length is not known before ends where it is too large."""
    received = 0

    async def limited() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if received > MOST_BODY_BYTES:
            raise _TooLargeError
        return message

    return limited


def _too_large(headers: Headers) -> JSONResponse | None:
    length = headers.get("content-length", "0")
    return None if length.isdecimal() and int(length) <= MOST_BODY_BYTES else _no_room()


def _no_room() -> JSONResponse:
    """The connection is closed with it: what else of the body is on its way is not read."""
    detail = f"a request may have {MOST_BODY_BYTES} bytes"
    return problem_answer(413, Problem(detail=detail), {"Connection": "close"})


def _secret(headers: Headers, path: str) -> str | None:
    """The token that a request has: in its Authorization header, or, for a report, in a cookie."""
    kind, _, secret = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer" and secret.strip():
        return secret.strip()
    return cookie_parser(headers.get("cookie", "")).get(COOKIE) if path.startswith(REPORTS) else None


def _unknown(headers: Headers) -> JSONResponse:
    given = "authorization" in headers
    error = ', error="invalid_token"' if given else ""
    detail = (
        "this token is not known, or was revoked"
        if given
        else "this needs a token: Authorization: Bearer TOKEN"
    )
    return problem_answer(
        401, Problem(detail=detail), {"WWW-Authenticate": f'Bearer realm="axiswatch"{error}'}
    )


def _of_another_page(headers: Headers) -> bool:
    """Whether a browser sends this for a page of another origin; only browsers send these headers."""
    origin = headers.get("origin")
    foreign = origin is not None and urlsplit(origin).netloc.lower() != headers.get("host", "").lower()
    return foreign or headers.get("sec-fetch-site", "none") not in ("same-origin", "none")


def _written(scope: Scope) -> str:
    """The path as it came, percent-encoded, so that it is one line; without the query."""
    raw = scope.get("raw_path") or scope["path"].encode("utf-8", "backslashreplace")
    text = raw.split(b"?")[0].decode("ascii", "backslashreplace")
    return text if len(text) <= _LONGEST_PATH else f"{text[:_LONGEST_PATH]}..."
