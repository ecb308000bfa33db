"""The program, which also writes how late its event loop is: `... loop_daemon FILE PORT run ...`.

By a task that wants to run each two milliseconds, while a file with the suffix `.on` is there.  Frames are datagrams
of that port.
"""

from __future__ import annotations

import asyncio
import atexit
import socket
import sys
from pathlib import Path

import numpy as np

from service.commands.main import main
from service.web.server import _Server
from tests.bench.datagram_daemon import read_datagrams

EVERY_S = 0.002
_late_s: list[float] = []
_startup = _Server.startup


async def look(on: Path) -> None:
    loop = asyncio.get_running_loop()
    while True:
        due_s = loop.time() + EVERY_S
        await asyncio.sleep(EVERY_S)
        late_s = loop.time() - due_s
        if on.exists():
            _late_s.append(late_s)


async def startup(self: _Server, sockets: list[socket.socket] | None = None) -> None:
    await _startup(self, sockets)
    self.looking = asyncio.create_task(look(path.with_suffix(".on")))  # type: ignore[attr-defined]


if __name__ == "__main__":
    path = Path(sys.argv.pop(1))
    read_datagrams(int(sys.argv.pop(1)))
    _Server.startup = startup  # type: ignore[method-assign]
    atexit.register(lambda: np.save(path, np.array(_late_s)))
    main()
