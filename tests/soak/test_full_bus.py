"""A real SocketCAN device with more frames than anybody reads: each is processed, or dropped for a reason.

Run by `tools/with-vcan.sh .venv/bin/python -m pytest -s -m "soak and vcan" tests/soak/test_full_bus.py`.
"""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from service.can.bus import open_bus, send
from service.can.bus_reader import CanReader
from service.can.frames import FrameBlock, FrameKey, concatenate_frames
from service.can.log_files import CanLog
from service.config.schema import BusConfig, Config
from service.ingest.samples.bus_samples import Ingest
from tests.service.ingest.plant import axis1, make_config
from tests.soak.full_bus_traffic import finished, sending, written

pytestmark = [pytest.mark.soak, pytest.mark.vcan]

OVERLOAD_S = float(os.environ.get("AXISWATCH_OVERLOAD_S", "60"))
FASTER = 10.0
SILENT_S = 2.0


def bus_of(config: Config, **other: object) -> BusConfig:
    return config.bus[0].model_copy(update={"interface": "socketcan", "channel": "vcan0", **other})


def test_a_real_log_ten_times_as_fast(records_dir: Path, tmp_path: Path) -> None:
    log = CanLog(records_dir / "can/inverter_idle.log")
    frames = concatenate_frames([block.frames for block in log.blocks()])
    assert frames.size == 52_585
    config = bus_of(make_config(tmp_path, axis1()))
    reader, taken = CanReader(config, None), list[FrameBlock]()
    reader.open()
    reader.start()
    with sending(0.0, written(tmp_path / "frames", frames, FASTER)) as process:
        last = time.monotonic()
        while process.poll() is None or time.monotonic() - last < SILENT_S:
            if block := reader.take():
                taken.append(block)
                last = time.monotonic()
            time.sleep(0.02)
        sent, took_s, late_s = finished(process)
    reader.close()
    stats, found = reader.stats(), concatenate_frames(taken)
    lasts_s = (frames.t_us[-1] - frames.t_us[0]) / 1e6
    print(f"\n{sent} frames in {took_s:.1f} s, {lasts_s / took_s:.1f} times as fast; up to {late_s:.2f} s late")
    print(f"{found.size} taken, dropped {dict(stats.dropped)}")
    assert sent == frames.size == found.size + stats.dropped["kernel_overflow"] + stats.dropped["queue_full"]
    if found.size == frames.size:
        np.testing.assert_array_equal(found.ids, frames.ids)
        np.testing.assert_array_equal(found.data[:, :8], frames.data[:, :8])


def test_a_minute_of_overload(tmp_path: Path) -> None:
    """Sent as fast as the kernel takes it, to a reader with a short queue and a busy worker."""
    plant = make_config(tmp_path, axis1())
    config, ingest = bus_of(plant, queue_frames=2000), Ingest(plant, "bus0")
    ids = [key.record_id for key in ingest.decoder.keys]
    count = 1000
    numbers = np.arange(count)
    frames = FrameBlock.from_columns(
        numbers,
        np.array([*ids, 0x555])[numbers % 3],
        np.where(numbers % 7 == 0, 3, 8),
        np.random.default_rng(1).integers(0, 256, (count, 8), np.uint8),
    )
    reader = CanReader(config, None)
    reader.open()
    reader.start()
    taken = samples = 0

    def work() -> None:
        nonlocal taken, samples
        frames = reader.take()
        taken += frames.size
        samples += sum(block.size for block in ingest.feed(frames).values())

    with sending(OVERLOAD_S, written(tmp_path / "frames", frames, np.inf)) as process:
        while process.poll() is None:
            work()
            time.sleep(0.15)
        sent, took_s, _ = finished(process)
    with open_bus(config) as bus:  # what the kernel has dropped comes with a frame after the loss
        end = time.monotonic() + SILENT_S
        while time.monotonic() < end:
            send(bus, FrameKey(0x556, False), b"end")
            sent += 1
            work()
            time.sleep(0.1)
    time.sleep(0.5)
    reader.close()
    while reader_left := reader.take():
        taken += reader_left.size
        ingest.feed(reader_left)
    dropped, decoded = reader.stats().dropped, ingest.dropped
    print(f"\n{sent} frames in {took_s:.1f} s, {sent / took_s:.0f} /s: {taken} taken, {samples} samples")
    print(f"dropped {dict(dropped)}, of those taken {dict(decoded)}")
    assert sent == reader.stats().frames + dropped["kernel_overflow"]
    assert reader.stats().frames == taken + dropped["queue_full"]
    assert dropped["queue_full"] > 0
    assert dropped["error_frame"] == dropped["remote_frame"] == 0
