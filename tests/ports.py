"""Ports for programs that cannot choose one themselves: no other test, in whichever process, gets the same one."""

import socket
from collections.abc import Iterator

_BLOCK = 100


def _ports() -> Iterator[int]:
    """Those of blocks that this process holds, below the range from which systems choose.

    Chromium refuses port 10080.  A block is held by a socket with its name, which Linux has by network, as ports, and
    which ends with the process.
    """
    for block in range(10_100, 16_000, _BLOCK):
        holder = socket.socket(socket.AF_UNIX)
        try:
            holder.bind(f"\0ports {block} of axiswatch's tests")
        except OSError:
            holder.close()
            continue
        holder.detach()  # open to the end
        yield from range(block, block + _BLOCK)


_PORTS = _ports()


def own_port() -> int:
    """One on which nobody listens, and which no other call in any test process returns."""
    for port in _PORTS:
        try:
            socket.create_server(("127.0.0.1", port)).close()
        except OSError:
            continue
        return port
    raise AssertionError("no port is left")
