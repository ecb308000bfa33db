"""The program, which also writes how old frames are when estimates follow: `... latency_daemon FILE PORT run ...`.

From the receipt of each frame, by its time stamp, to the end of the update that has used it.  Frames are datagrams of
that port.
"""

import atexit
import sys
import time
from pathlib import Path

import numpy as np

from monitor_core.arrays import Ints
from service.can.frames import FrameBlock
from service.commands.main import main
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import FramePipeline
from tests.bench.datagram_daemon import read_datagrams

_taken: list[Ints] = []
_ages_us: list[Ints] = []


_take, _update = FramePipeline.take, FramePipeline.update


def take(self: FramePipeline, bus: str, frames: FrameBlock) -> None:
    _take(self, bus, frames)
    _taken.append(frames.t_us.copy())


def update(self: FramePipeline) -> list[AxisAlarm]:
    changes = _update(self)
    now_us = time.time_ns() // 1000
    _ages_us.extend(now_us - t_us for t_us in _taken)
    _taken.clear()
    return changes


if __name__ == "__main__":
    path = Path(sys.argv.pop(1))
    read_datagrams(int(sys.argv.pop(1)))
    FramePipeline.take, FramePipeline.update = take, update  # type: ignore[method-assign]
    atexit.register(lambda: np.save(path, np.concatenate(_ages_us)))
    main()
