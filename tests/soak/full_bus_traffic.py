"""Frames in a file, and a process that sends them as fast as a bus may carry."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.can.frames import FrameBlock


def written(path: Path, frames: FrameBlock, faster: float) -> Path:
    """The frames for the sender; ``faster``: than they were recorded, inf: without any wait."""
    due_s = (frames.t_us - frames.t_us[0]) / 1e6 / faster
    lines = []
    for t, record_id, length, data in zip(due_s, frames.ids, frames.lengths, frames.data, strict=True):
        record = int(record_id).to_bytes(4, "little") + bytes([length, 0, 0, 0]) + data[:8].tobytes()
        lines.append(f"{t:.6f} {record.hex()}\n")
    path.write_text("".join(lines), encoding="ascii")
    return path


@contextmanager
def sending(seconds: float, path: Path, channel: str = "vcan0") -> Iterator[subprocess.Popen[str]]:
    """A process that sends these frames again and again until so many seconds have passed."""
    command = [sys.executable, "-m", "tests.soak.full_bus_sender", channel, str(seconds), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def finished(process: subprocess.Popen[str]) -> tuple[int, float, float]:
    """Frames sent, the time that it took and the longest delay, s."""
    sent, took_s, late_s = process.communicate()[0].split()
    return int(sent), float(took_s), float(late_s)
