"""Logs in which bits are flipped, parts are missing or repeated, and what reading them must hold to."""

from __future__ import annotations

import gzip
import random
from pathlib import Path

import can

from service.can.frames import Frame
from service.can.log_files import CanLog
from service.can.user_errors import RecordError

START_US = 1_760_000_000_123_456


def log_bytes(path: Path, rng: random.Random, count: int) -> bytes:
    """The content of a log of random frames on two channels, CAN FD among them; its suffix says of which kind."""
    packed = path.suffix == ".gz"
    plain = path.with_suffix("") if packed else path
    with can.Logger(str(plain)) as writer:
        for k in range(count):
            length = rng.choice([*range(9), 12, 64] if ".trc" not in plain.name else range(9))
            extended = rng.random() < 0.5
            writer.on_message_received(
                can.Message(
                    timestamp=START_US / 1e6 + 0.001 * k,
                    arbitration_id=rng.randrange(1 << 29 if extended else 1 << 11),
                    is_extended_id=extended,
                    is_fd=length > 8,
                    data=rng.randbytes(length),
                    channel=f"can{k % 2}",
                    is_error_frame=False,
                )
            )
    content = plain.read_bytes()
    return gzip.compress(content) if packed else content


def damaged(content: bytes, rng: random.Random) -> bytes:
    """The same with some damage, as disks, cables and killed writers leave it."""
    changed = bytearray(content)
    kind = rng.randrange(5)
    if kind == 0:
        del changed[rng.randrange(len(changed)) :]
    elif kind == 1:
        for _ in range(rng.choice([1, 1, 3, 30])):
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    else:
        start, size = rng.randrange(len(changed)), rng.randrange(1, 200)
        part = {2: b"", 3: bytes(size), 4: bytes(changed[start : start + size]) * 2}[kind]
        changed[start : start + size] = part
    return bytes(changed)


def read_all(path: Path) -> tuple[list[Frame], CanLog, str]:
    """The frames, the log, and the error; anything but a RecordError passes through.

    Whatever is in the file, the counters agree with what was given and what was left out.
    """
    log, found, problem = CanLog(path), list[Frame](), ""
    try:
        for block in log.blocks():
            assert block.frames.size == len(block.channels)
            assert 0 <= block.done <= 1
            found += block.frames.frames()
    except RecordError as error:
        problem = str(error)
        assert str(path) in problem
    assert log.frames == len(found)
    assert log.dropped["unreadable"] == len(log.left_out)
    assert all(count >= 0 for count in log.dropped.values())
    assert found or problem
    return found, log, problem
