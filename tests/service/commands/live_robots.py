"""Robots of the tables of other tests that send on a bus inside the process, faster than they would move."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from can.interfaces.virtual import channels

from monitor_core.arrays import Floats
from service.can.bus import open_buses, send
from service.config import load
from service.ingest.samples.encode import FrameEncoder
from tests.service.commands import can_logs

SPEED = 6.0
"""So many seconds of the robot pass in a second where frames keep the times that they are sent with."""
_EVERY_S = 0.02
_CHANNELS = itertools.count()


def configured(path: Path, dbc: Path, axes: int = 1, device: str = "") -> Path:
    """A configuration of these axes on a bus inside the process, or on that SocketCAN device, in real time."""
    can_logs.configured(path, dbc, axes)
    text, own = path.read_text(encoding="utf-8"), f"live-{next(_CHANNELS)}"
    if device:
        path.write_text(text.replace('channel = "can0"', f'channel = "{device}"'), encoding="utf-8")
        return path
    bus = f'interface = "virtual"\nchannel = "{own}"\noptions = {{ preserve_timestamps = true }}'
    path.write_text(text.replace('channel = "can0"', bus), encoding="utf-8")
    return path


@contextmanager
def moving(table: Path, config: Path, change: Callable[[Floats], object] = lambda _: None) -> Iterator[None]:
    """The robot of a table moves while somebody listens, until the end of the block or of the table.

    Args:
        table: time, torque and angle of each axis.
        config: of its buses, with at most as many axes; those that it lacks are silent.
        change: of the rows (N, 1 + 2 axes), before they are sent; those with NaN are not.
    """
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    change(rows)
    stop = threading.Event()
    thread = threading.Thread(target=_send, args=(rows, config, stop), name="robot")
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def _send(rows: Floats, config: Path, stop: threading.Event) -> None:
    read = load(config, {})
    encoder = FrameEncoder(read, read.bus[0].name)
    began, interval_s = time.time(), float(rows[1, 0] - rows[0, 0])
    sent, due, real = 0, 0.0, read.bus[0].interface != "virtual"
    with open_buses(read.bus) as buses:
        (bus,) = buses.values()
        before = time.monotonic()
        while not stop.wait(_EVERY_S) and sent < len(rows):
            now = time.monotonic()
            if real:
                due += (now - before) / interval_s
            elif len(channels[read.bus[0].channel]) > 1:  # else its frames would be lost
                due += SPEED * (now - before) / interval_s
            before = now
            for k in range(sent, min(round(due), len(rows))):
                sent = k + 1
                if np.isnan(rows[k]).any():
                    continue
                values = {a.id: (rows[k, 1 + 2 * n], rows[k, 2 + 2 * n]) for n, a in enumerate(read.axes)}
                for frame in encoder.encode(values, k):
                    send(bus, frame.key, frame.data, began + k * interval_s)
