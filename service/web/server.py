"""Runs uvicorn in the calling thread, until a stop event."""

import contextlib
import errno
import socket
import threading
from collections.abc import Callable, Iterator

import uvicorn
from fastapi import FastAPI

_GRACE_S = 3


class CannotListenError(Exception):
    """The address is not available; the text says which, why, and what to do."""


class _Server(uvicorn.Server):
    """A server that leaves signals to the program: the stop event ends it."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None], stop: threading.Event) -> None:
        super().__init__(config)
        self._ready, self._stop = ready, stop

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._ready()

    async def on_tick(self, counter: int) -> bool:
        return await super().on_tick(counter) or self._stop.is_set()


def serve(app: FastAPI, host: str, port: int, ready: Callable[[int], None], stop: threading.Event) -> None:
    """Answer requests until ``stop`` is set; ``ready`` is called with the port once requests are answered.

    Args:
        app: the application.
        host: name or address of this machine to listen on.
        port: 0 takes a free one.
        ready: gets the actual port.
        stop: ends it from any thread; running requests get three seconds.

    Raises:
        CannotListenError: the port is taken, or the address is not one of this machine.
    """
    config = uvicorn.Config(
        app, log_config=None, access_log=False, lifespan="off", timeout_graceful_shutdown=_GRACE_S
    )
    with listen(host, port) as listener:
        actual = listener.getsockname()[1]
        _Server(config, lambda: ready(actual), stop).run([listener])


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens at the address.

    Raises:
        CannotListenError: it cannot.
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (socket.gaierror, UnicodeError) as error:
        raise CannotListenError(f"cannot listen on {host!r}: no such host; 127.0.0.1 or 0.0.0.0?") from error
    # A name with IPv4 and IPv6 addresses, like localhost, gets the IPv4 one that people type.
    family, _, _, _, address = min(found, key=lambda entry: entry[0] != socket.AF_INET)
    try:
        return socket.create_server(address, family=family, backlog=128)
    except OSError as error:
        raise CannotListenError(f"cannot listen on {host} port {port}: {_why(error)}") from error


def _why(error: OSError) -> str:
    known = {
        errno.EADDRINUSE: "the port is taken by another program; choose another one, or 0 for any free one",
        errno.EADDRNOTAVAIL: "this machine has no such address; 127.0.0.1 (itself) or 0.0.0.0 (all)?",
        errno.EACCES: "not allowed; ports below 1024 need a privilege, choose a higher one",
    }
    return known.get(error.errno or 0, error.strerror or str(error))
