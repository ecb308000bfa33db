"""The program, which also writes how late its event loop is: `... loop_daemon FILE PORT run ...`.

By a task that wants to run each two milliseconds, while a file with the suffix `.on` is there.  Beside each delay [s]
is what remains of it without the time for which the kernel had no processor for the loop, or for the worker, which may
hold the interpreter meanwhile: of both the longer one, as they may overlap.  Frames are datagrams of that port.
"""

import asyncio
import atexit
import os
import socket
import sys
import threading
from pathlib import Path

import numpy as np
import uvicorn

from monitor_core.arrays import Floats
from service.commands.main import main
from tests.bench.datagram_daemon import read_datagrams

EVERY_S = 0.002
_late_s: list[tuple[float, float]] = []
_startup = uvicorn.Server.startup


async def look(on: Path) -> None:
    loop, threads = asyncio.get_running_loop(), {t.name: t.native_id for t in threading.enumerate()}
    looked_at = threading.get_native_id(), threads["worker"]
    files = [os.open(f"/proc/self/task/{thread}/schedstat", os.O_RDONLY) for thread in looked_at]

    def waited_s() -> Floats:
        """For a processor, since each of the threads has begun."""
        return np.array([int(os.pread(file, 100, 0).split()[1]) / 1e9 for file in files])

    while True:
        before_s, due_s = waited_s(), loop.time() + EVERY_S
        await asyncio.sleep(EVERY_S)
        late_s = loop.time() - due_s
        if on.exists():
            _late_s.append((late_s, late_s - np.max(waited_s() - before_s)))


async def startup(self: uvicorn.Server, sockets: list[socket.socket] | None = None) -> None:
    await _startup(self, sockets)
    self.looking = asyncio.create_task(look(path.with_suffix(".on")))  # type: ignore[attr-defined]


if __name__ == "__main__":
    path = Path(sys.argv.pop(1))
    read_datagrams(int(sys.argv.pop(1)))
    uvicorn.Server.startup = startup  # type: ignore[method-assign]
    atexit.register(lambda: np.save(path, np.array(_late_s)))
    main()
