"""The gate: checks every request before the application handles it, and completes every answer.

It checks that the host of the request is one of the daemon, that the body is small and that the caller is known, and
refuses changes from web pages of other origins.  HEAD is answered wherever GET is.  Each request that may change
something is logged in one line.
"""

import asyncio
import re
from contextlib import suppress
from functools import partial

import structlog
from fastapi.responses import JSONResponse
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import cookie_parser
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from monitor_core.wording import sentence
from service.store.database import StoreError
from service.store.tokens import NOBODY, Caller
from service.store.tokens import Scope as Role
from service.web.access import Access
from service.web.problem_details import answer

log = structlog.get_logger(__name__)

MOST_BODY_BYTES = 64 * 1024
"""Largest body of a request; those of the API are much smaller."""
_NO_ROOM = sentence("body too large", "the body of a request may have {most} bytes", most=MOST_BODY_BYTES)
LONGEST_REQUEST_S = 30.0
"""Time limit until the body has arrived and the answer has started."""
LONGEST_CHANGE_S = 120.0
"""For a request that changes something: time limit from the arrival of its body until the start of the answer.  It is
long, as a started change is not interrupted, and new nominal values may need a compilation first."""
LONGEST_ANSWER_S = 300.0
"""Time limit from the start of the answer to its end: enough for 5 MB of metrics over a slow line, but a client that
does not read cannot hold a connection for ever."""
REPORTS = "/reports/"
COOKIE = "axiswatch-token"
"""Cookie with the token, used for reports only, as a link sends no Authorization header; reports are read-only."""

_HOST = re.compile(r"(?:\[(?P<v6>[0-9A-Fa-f:.]+)\]|(?P<name>[^\s:/@\[\]]+))(?::\d{1,5})?")
_NOBODY = Caller(NOBODY, frozenset())
"""A caller without a token, if tokens are needed"""
_METRICS = "/metrics"
_SCRAPER = Caller(NOBODY, frozenset({Role.READ}))
"""A caller without a token for open metrics"""
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
    """Whether a path is a file of the pages.

    These need no token: they are the same everywhere, and ask for the token.
    """
    return path in ("/", "/docs") or path.startswith("/static/")


class RequestGate:
    """ASGI middleware around the application."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access
        self._reported: str | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        exchange = _Exchange(scope, receive, send)
        who = _NOBODY
        try:
            refusal, caller = self._check(scope)
            who = caller or (_SCRAPER if scope["path"] == _METRICS else _NOBODY)
            if refusal is None:
                await self._pass(exchange, who)
            else:
                await refusal(scope, exchange.receive, exchange.send)
        finally:
            if scope["method"] not in _READING:
                what = f"{scope['method']} {_written(scope)}"
                log.info("write request", who=who.name, what=what, result=exchange.status or 500)

    def _check(self, scope: Scope) -> tuple[JSONResponse | None, Caller | None]:
        """Check a request; returns the answer if it is refused, and the caller if known."""
        headers = Headers(scope=scope)
        if (refusal := self._misdirected(scope, headers) or _too_large(headers)) is not None:
            return refusal, None
        path = scope["path"]
        try:
            caller = self._access.caller(_secret(headers, path))
        except StoreError as error:
            if str(error) != self._reported:  # log the same error only once
                self._reported = str(error)
                log.error("tokens", message=str(error))
            if self._is_open(path):
                return None, None
            return answer(503, "the tokens cannot be read; the log of the daemon says why"), None
        if scope["method"] not in _READING and _of_another_page(headers):
            return answer(403, "a page of another host may change nothing here"), caller
        if caller is None and not self._is_open(path):
            return _unknown(headers), None
        return None, caller

    def _is_known(self, scope: Scope) -> bool:
        """Whether the caller of a stream is still known: the token may have been revoked meanwhile."""
        with suppress(StoreError):
            return self._access.caller(_secret(Headers(scope=scope), scope["path"])) is not None
        return False

    def _is_open(self, path: str) -> bool:
        """Whether a path needs no token."""
        return path == "/healthz" or is_page(path) or (path == _METRICS and self._access.open_metrics)

    def _misdirected(self, scope: Scope, headers: Headers) -> JSONResponse | None:
        """The refusal of an unknown host name, by which a foreign page may have been led here (DNS rebinding)."""
        given = headers.getlist("host")
        found = _HOST.fullmatch(given[0]) if len(given) == 1 else None
        if found is not None:
            host = found["v6"] or found["name"]
            if self._access.known_host(host) or host == (scope.get("server") or [""])[0]:
                return None
        detail = "this daemon has another name than the host of the request; add it to hosts in [web]"
        return answer(421, detail)

    async def _pass(self, exchange: "_Exchange", who: Caller) -> None:
        scope = exchange.scope
        # Routes handle HEAD as GET; the server then sends only the head.
        method = "GET" if scope["method"] == "HEAD" else scope["method"]
        state = {**scope.get("state", {}), "caller": who, "is_known": partial(self._is_known, scope)}
        inner = {**scope, "method": method, "state": state}
        try:
            async with asyncio.timeout(LONGEST_REQUEST_S) as exchange.limit:
                await self._app(inner, exchange.receive, exchange.send)
        except TimeoutError:
            exchange.limit = None
            if exchange.is_stream:
                log.info("event stream ended: its client does not read", who=who.name)
                return
            if exchange.status is not None:
                raise
            detail = f"not complete, or not answered, within {LONGEST_REQUEST_S:g} s"
            refusal = answer(503, detail, headers={"Connection": "close"})
            await refusal(scope, exchange.receive, exchange.send)


class _Exchange:
    """A request with a limited body, and its answer, to which the common headers are added."""

    def __init__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.scope, self._receive, self._send = scope, receive, send
        self.status: int | None = None
        self.limit: asyncio.Timeout | None = None
        self.is_stream = False
        """Whether the answer is a stream of events, which has no end"""
        self._received = 0
        self._endless = "transfer-encoding" in Headers(scope=scope)

    async def receive(self) -> Message:
        """The next part of the body.

        Raises:
            HTTPException: the body, whose length was not stated, has become too large.
        """
        message = await self._receive()
        self._received += len(message.get("body", b""))
        if self._received > MOST_BODY_BYTES:
            raise HTTPException(413, _NO_ROOM)
        more = message.get("more_body", False)
        self._endless = self._endless and more
        changes = self.scope["method"] not in _READING and not more and self.status is None
        if changes and self.limit is not None and not self.limit.expired():
            self.limit.reschedule(asyncio.get_running_loop().time() + LONGEST_CHANGE_S)
        return message

    async def send(self, message: Message) -> None:
        """Pass a part of the answer to the server."""
        if message["type"] == "http.response.start":
            self.status = message["status"]
            if self.limit is not None:
                self.limit.reschedule(asyncio.get_running_loop().time() + LONGEST_ANSWER_S)
            headers = MutableHeaders(scope=message)
            self.is_stream = headers.get("content-type", "").startswith("text/event-stream")
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)
            # Browsers must revalidate page files, which change with each version, and must not store data.
            headers.setdefault("cache-control", "no-cache" if is_page(self.scope["path"]) else "no-store")
            if self.scope["scheme"] == "https":
                headers["strict-transport-security"] = _HSTS
            if self._endless:
                headers["connection"] = "close"  # otherwise the server would read the whole unwanted body
        await self._send(message)
        # A stream goes on as long as its client reads.
        if self.is_stream and self.limit is not None and not self.limit.expired():
            self.limit.reschedule(asyncio.get_running_loop().time() + LONGEST_REQUEST_S)


def _too_large(headers: Headers) -> JSONResponse | None:
    """The refusal of a too large body; it closes the connection, so that the body is not read."""
    length = headers.get("content-length", "0")
    if length.isdecimal() and len(length) < 10 and int(length) <= MOST_BODY_BYTES:
        return None
    return answer(413, _NO_ROOM, headers={"Connection": "close"})


def _secret(headers: Headers, path: str) -> str | None:
    """The token of a request: from the Authorization header, or, for a report, from the cookie."""
    kind, _, secret = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer" and secret.strip():
        return secret.strip()
    return cookie_parser(headers.get("cookie", "")).get(COOKIE) if path.startswith(REPORTS) else None


_NOT_KNOWN = sentence("token not known", "this token is not known, or was revoked")
_NO_TOKEN = sentence(
    "token needed", "this needs a token, as `axiswatch token new` makes it: Authorization: Bearer TOKEN"
)


def _unknown(headers: Headers) -> JSONResponse:
    given = "authorization" in headers
    error = ', error="invalid_token"' if given else ""
    detail = _NOT_KNOWN if given else _NO_TOKEN
    return answer(401, detail, headers={"WWW-Authenticate": f'Bearer realm="axiswatch"{error}'})


def _of_another_page(headers: Headers) -> bool:
    """Whether a browser sends the request for a page of another origin; only browsers send these headers.

    Sec-Fetch-Site takes precedence, as a proxy may remove the port from Host, so that Origin and Host differ.
    """
    site, origin = headers.get("sec-fetch-site"), headers.get("origin")
    if site is not None:
        return site not in ("same-origin", "none")
    return origin is not None and origin.partition("://")[2].lower() != headers.get("host", "").lower()


def _written(scope: Scope) -> str:
    """The path for the log: percent-encoded, so that it is one line, and without the query."""
    raw = scope.get("raw_path") or scope["path"].encode("utf-8", "backslashreplace")
    text = raw.split(b"?")[0].decode("ascii", "backslashreplace")
    return text if len(text) <= _LONGEST_PATH else f"{text[:_LONGEST_PATH]}..."
