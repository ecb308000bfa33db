"""What a frame costs from the bus or a log to a sample, beside cantools with the objects of python-can."""

from collections.abc import Callable
from pathlib import Path

import can
import pytest
from cantools.database.can import Database

from service.can.frame_recorder import FrameRecorder
from service.can.frames import FrameBlock, concatenate_frames
from service.can.log_files import CanLog
from service.ingest.records.record_files import LogRecord
from service.ingest.samples.bus_samples import Ingest
from tests.bench.measure import Say, in_turns
from tests.service.pipeline.robots import blocks, demo

pytestmark = pytest.mark.bench

AXES, SECONDS = 6, 20.0
TICK_FRAMES, MANY_FRAMES = 120, 1200
"""Of the demo's bus between two turns of the worker at 200 Hz, and at 2000 Hz or in a burst"""
TARGET_US, LOG_TARGET_US = 3.0, 1.5
ROUNDS = 5


def test_a_frame(tmp_path: Path, seed: int, say: Say) -> None:
    config = demo(tmp_path, AXES)
    bus, log = config.bus[0], tmp_path / "demo.log"
    frames = concatenate_frames(list(blocks(config, SECONDS, seed)))
    with FrameRecorder(log) as recorder:
        recorder.write(bus.name, frames)
    database = Database()
    database.add_dbc_file(str(bus.messages))
    messages = [
        can.Message(timestamp=f.t_us / 1e6, arbitration_id=f.can_id, is_extended_id=f.extended, data=f.data)
        for f in frames.frames()
    ]

    def cut(count: int) -> list[FrameBlock]:
        return [frames.select(slice(k, k + count)) for k in range(0, frames.size, count)]

    def decoded(parts: list[FrameBlock]) -> None:
        decoder = Ingest(config, bus.name).decoder
        for part in parts:
            decoder.decode(part)

    def sampled(parts: list[FrameBlock]) -> None:
        ingest = Ingest(config, bus.name)
        for part in parts:
            ingest.feed(part)

    def by_cantools() -> None:
        for message in messages:
            database.decode_message(message.arbitration_id, bytes(message.data), decode_choices=False)

    def log_by_python_can() -> None:
        for _ in can.LogReader(str(log)):
            pass

    def log_by_both() -> None:
        for message in can.LogReader(str(log)):
            database.decode_message(message.arbitration_id, bytes(message.data), decode_choices=False)

    small, large = cut(TICK_FRAMES), cut(MANY_FRAMES)
    variants: dict[str, tuple[Callable[[], object], object]] = {
        "cantools, objects of python-can: decode": (by_cantools, "-"),
        f"decode, blocks of {TICK_FRAMES}": (lambda: decoded(small), "-"),
        f"decode, blocks of {MANY_FRAMES}": (lambda: decoded(large), "-"),
        f"frame to sample, blocks of {TICK_FRAMES}": (lambda: sampled(small), TARGET_US),
        f"frame to sample, blocks of {MANY_FRAMES}": (lambda: sampled(large), TARGET_US),
        "python-can: candump log to objects": (log_by_python_can, "-"),
        "python-can and cantools: candump log, decoded": (log_by_both, "-"),
        "candump log to frames": (lambda: list(CanLog(log).blocks()), "-"),
        "candump log to samples": (lambda: list(LogRecord(log, config).steps()), LOG_TARGET_US),
    }
    medians = in_turns({name: run for name, (run, _) in variants.items()}, ROUNDS)
    rows = [(name, medians[name] / frames.size * 1e6, target) for name, (_, target) in variants.items()]
    say(f"a frame of {AXES} axes at 200 Hz, {frames.size} frames", ("", "us a frame", "target us"), rows)
