"""Entity tags (RFC 9110): a repeated request with If-None-Match gets 304 without a body if nothing has changed."""

import hashlib
import re

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_TAG = re.compile(r'"[^"]*"')
_OF_BODY = ("content-length", "content-type")


class EntityTags:
    """ASGI middleware that adds the hash of the body as ETag to each JSON answer that is sent in one piece."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http" or scope["method"] != "GET":
            await self._app(scope, receive, send)
            return
        await self._app(scope, receive, _TaggedAnswer(Headers(scope=scope).get("if-none-match", ""), send).send)


class _TaggedAnswer:
    """An answer whose head waits for its body.  ``known``: If-None-Match, the tags that the client has."""

    def __init__(self, known: str, send: Send) -> None:
        self._known, self._send = known, send
        self._head: Message | None = None

    async def send(self, message: Message) -> None:
        """Send a part of the answer."""
        if message["type"] == "http.response.start" and _may_have_tag(message):
            self._head = message
            return
        if self._head is not None:
            head, self._head = self._head, None
            if not message.get("more_body", False):
                message = self._tagged(head, message)
            await self._send(head)
        await self._send(message)

    def _tagged(self, head: Message, body: Message) -> Message:
        """Add the tag to the head; returns the body, empty if the client already has it."""
        tag = f'"{hashlib.blake2b(body.get("body", b""), digest_size=12).hexdigest()}"'
        headers = MutableHeaders(scope=head)
        headers["etag"] = tag
        # A weak tag, W/"..", counts as equal here (RFC 9110, 13.1.2).
        if self._known.strip() != "*" and tag not in _TAG.findall(self._known):
            return body
        head["status"] = 304
        for name in _OF_BODY:
            del headers[name]
        return {**body, "body": b""}


def _may_have_tag(head: Message) -> bool:
    headers = Headers(raw=head["headers"])
    return bool(head["status"] == 200) and headers.get("content-type", "").startswith("application/json")
