"""Runs the uvicorn server in the calling thread until a stop event."""

import asyncio
import contextlib
import errno
import ipaddress
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol

GRACE_S = 3
"""Time for running requests to end when the daemon stops [s]"""
_UNREAD_S = 2
"""Time for clients to read their answers then [s]; shorter than GRACE_S, as later aborts would be logged as faults"""
SILENT_S = 20
"""A connection without a complete request head for this time is closed [s]."""
_CONNECTIONS = 256
"""Most connections, as each takes a file descriptor and memory; further requests are answered with 503."""


class CannotListenError(Exception):
    """The daemon cannot listen on the address; the text says why and what to do."""


class CertificateError(Exception):
    """The certificate or its key cannot be used; the text names the file and says why."""


class Certificate:
    """PEM files for TLS: the certificate with its chain up to the root, and the private key."""

    def __init__(self, file: Path, key: Path) -> None:
        self.file, self.key = file, key
        self._context: ssl.SSLContext | None = None

    def check(self) -> None:
        """Check that both files can be used.

        Raises:
            CertificateError: a file cannot be used.
        """
        for path in (self.file, self.key):
            try:
                path.read_bytes()
            except OSError as error:
                raise CertificateError(f"{path}: {error.strerror}") from error
        try:
            context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
            context.load_cert_chain(self.file, self.key, password=_no_password)
        except (ssl.SSLError, ValueError) as error:
            why = getattr(error, "reason", None) or str(error)
            raise CertificateError(
                f"{self.file} and {self.key}: no PEM certificate with its own private key ({why})"
            ) from error

    def context(self, _config: object, make: Callable[[], ssl.SSLContext]) -> ssl.SSLContext:
        """Factory of the TLS context for uvicorn; the context is kept for ``renew``."""
        self._context = make()
        return self._context

    def renew(self, new: "Certificate") -> None:
        """Let the server use new files for new connections; they must have passed ``check``."""
        if self._context is not None:
            self._context.load_cert_chain(new.file, new.key, password=_no_password)


def _no_password() -> str:
    raise ValueError("the key is encrypted: store it without a password, readable by the daemon alone")


class _Protocol(H11Protocol):
    """HTTP/1.1 with a time limit for requests; uvicorn waits for ever for the first request, and within each."""

    _silence: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._wait()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        if self._silence is not None:
            self._silence.cancel()

    def _wait(self) -> None:
        if self._silence is not None:
            self._silence.cancel()
        self._silence = self.loop.call_later(SILENT_S, self._close_if_silent)

    def _close_if_silent(self) -> None:
        if self.conn.their_state is h11.IDLE:  # otherwise the application handles a request
            self.transport.close()


class _Server(uvicorn.Server):
    """A server that handles no signals; the stop event ends it."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None], stop: threading.Event) -> None:
        super().__init__(config)
        self._ready, self._stop = ready, stop

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        asyncio.get_running_loop().call_later(_UNREAD_S, self._abort_connections)
        await super().shutdown(sockets)

    def _abort_connections(self) -> None:
        for connection in list(self.server_state.connections):
            connection.transport.abort()

    async def on_tick(self, counter: int) -> bool:
        return await super().on_tick(counter) or self._stop.is_set()


def serve(
    app: FastAPI,
    host: str,
    port: int,
    ready: Callable[[int], None],
    stop: threading.Event,
    certificate: Certificate | None = None,
) -> None:
    """Answer requests until ``stop`` is set.

    Args:
        app: the application.
        host: name or address of this machine to listen on.
        port: TCP port; 0: any free one.
        ready: called with the actual port when the server answers requests.
        stop: ends the server, from any thread; running requests have three seconds.
        certificate: certificate for TLS; None: no TLS.

    Raises:
        CannotListenError: the port is taken, or the address is not one of this machine.
    """
    config = uvicorn.Config(
        app,
        http=_Protocol,
        ws="none",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,  # a client could use them to pretend to be another one
        lifespan="off",
        limit_concurrency=_CONNECTIONS,
        timeout_keep_alive=SILENT_S,
        timeout_graceful_shutdown=GRACE_S,
        ssl_certfile=None if certificate is None else certificate.file,
        ssl_keyfile=None if certificate is None else certificate.key,
        ssl_context_factory=None if certificate is None else certificate.context,
    )
    with listen(host, port) as listener:
        actual = listener.getsockname()[1]
        _Server(config, lambda: ready(actual), stop).run([listener])


def is_remote(host: str) -> bool:
    """Whether other machines can reach this address.

    Raises:
        CannotListenError: there is no such host.
    """
    return not ipaddress.ip_address(str(_resolved(host, 0)[1][0]).partition("%")[0]).is_loopback


def listen(host: str, port: int) -> socket.socket:
    """Open a socket that listens on the address.

    Raises:
        CannotListenError: that is not possible.
    """
    family, address = _resolved(host, port)
    try:
        return socket.create_server(address, family=family, backlog=128)
    except OSError as error:
        raise CannotListenError(f"cannot listen on {host} port {port}: {_why(error)}") from error


def _resolved(host: str, port: int) -> tuple[int, tuple[Any, ...]]:
    """Address family and address of a host."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (socket.gaierror, UnicodeError) as error:
        raise CannotListenError(f"cannot listen on {host!r}: no such host; 127.0.0.1 or 0.0.0.0?") from error
    # For a name with IPv4 and IPv6 addresses, such as localhost, take the IPv4 address, which people type.
    family, _, _, _, address = min(found, key=lambda entry: entry[0] != socket.AF_INET)
    return family, address


def _why(error: OSError) -> str:
    known = {
        errno.EADDRINUSE: "the port is taken by another program; choose another one, or 0 for any free one",
        errno.EADDRNOTAVAIL: "this machine has no such address; 127.0.0.1 (itself) or 0.0.0.0 (all)?",
        errno.EACCES: "not allowed; ports below 1024 need a privilege, choose a higher one",
    }
    return known.get(error.errno or 0, error.strerror or str(error))
