"""Measurement files of loggers; most of this needs asammdf, which is optional."""

from __future__ import annotations

import gc
import gzip
import random
import sys
from pathlib import Path

import can
import numpy as np
import pytest

from service.can.frames import CLASSIC_RECORD, FD_RECORD, Frame, FrameBlock
from service.can.log_files import CanLog
from service.can.mf4_frames import merged
from service.can.user_errors import RecordError
from tests.service.can.log_damage import damaged, read_all


def test_without_asammdf_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "asammdf", None)
    (tmp_path / "a.mf4").write_bytes(b"MDF     4.10")
    with pytest.raises(RecordError, match=r"a\.mf4: to read \.mf4 install asammdf: pip install 'axiswatch\[mf4\]'"):
        list(CanLog(tmp_path / "a.mf4").blocks())


def written(path: Path, count: int, seed: int) -> list[tuple[str, Frame]]:
    """Frames of two channels, CAN FD among them, with an error frame and a remote frame."""
    rng, sent = random.Random(seed), list[tuple[str, Frame]]()
    with can.MF4Writer(str(path)) as writer:
        start_us = round(writer.last_timestamp * 1e6)
        for k in range(count):
            extended, data = rng.random() < 0.5, rng.randbytes(rng.choice([*range(9), 64]))
            can_id = rng.randrange(1 << 29 if extended else 1 << 11)
            frame = Frame(start_us + 1000 * k, can_id, extended, data)
            sent.append((str(k % 2), frame))
            writer.on_message_received(
                can.Message(
                    timestamp=frame.t_us / 1e6,
                    arbitration_id=can_id,
                    is_extended_id=extended,
                    is_fd=len(data) > 8,
                    data=data,
                    channel=k % 2,
                )
            )
        for kind in ({"is_error_frame": True}, {"is_remote_frame": True}):
            writer.on_message_received(can.Message(timestamp=(start_us + 10) / 1e6, channel=0, **kind))
    return sent


def test_groups_are_merged_in_the_order_of_time(seed: int) -> None:
    """Loggers write a group for each channel; each comes in parts of its own size."""
    rng = np.random.default_rng(seed)
    groups, expected = [], []
    for channel, (count, size) in enumerate([(1000, 64), (37, 5), (400, 400), (0, 1)]):
        records = np.zeros(count, FD_RECORD if channel == 1 else CLASSIC_RECORD)
        records["t_us"] = np.sort(rng.integers(0, 10_000, count))
        records["id"] = np.arange(count)
        starts = range(0, count, size)
        groups.append(iter([(FrameBlock(part := records[k : k + size]), np.full(len(part), channel)) for k in starts]))
        expected += [
            (int(t_us), channel, int(frame)) for t_us, frame in zip(records["t_us"], records["id"], strict=True)
        ]
    found = [
        (int(t_us), int(channel), int(frame))
        for frames, channels in merged(groups)
        for t_us, channel, frame in zip(frames.t_us, channels, frames.ids, strict=True)
    ]
    assert [t_us for t_us, _, _ in found] == sorted(t_us for t_us, _, _ in expected)
    assert sorted(found) == sorted(expected)


@pytest.mark.mf4
@pytest.mark.parametrize("packed", [False, True])
def test_a_measurement_file_gives_its_frames(tmp_path: Path, packed: bool, seed: int) -> None:
    sent = written(tmp_path / "a.mf4", 3000, seed)
    path = tmp_path / "a.mf4"
    if packed:
        path = tmp_path / "a.mf4.gz"
        path.write_bytes(gzip.compress((tmp_path / "a.mf4").read_bytes()))
    log = CanLog(path)
    blocks = list(log.blocks())
    names = [block.names[channel] for block in blocks for channel in block.channels.tolist()]
    read = [frame for block in blocks for frame in block.frames.frames()]
    assert list(zip(names, (frame._replace(t_us=0) for frame in read), strict=True)) == [
        (name, frame._replace(t_us=0)) for name, frame in sent
    ]
    off = [frame.t_us - own.t_us for frame, (_, own) in zip(read, sent, strict=True)]
    assert max(off) - min(off) <= 2
    assert max(map(abs, off)) <= 1000
    assert blocks[-1].done == 1.0
    assert log.dropped == {"error_frame": 1, "remote_frame": 1, "not_a_frame": 0, "unreadable": 0}


@pytest.mark.mf4
def test_a_damaged_measurement_file_gives_frames_or_an_error(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # asammdf complains when what it could not open is deleted, and leaves its temporary file to the garbage collector.
    monkeypatch.setattr(sys, "unraisablehook", lambda _: None)
    written(tmp_path / "a.mf4", 100, seed)
    content, rng = (tmp_path / "a.mf4").read_bytes(), random.Random(seed)
    for _ in range(100):
        (tmp_path / "a.mf4").write_bytes(damaged(content, rng))
        read_all(tmp_path / "a.mf4")
    gc.collect()
