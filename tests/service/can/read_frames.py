"""A reader of a bus, and the frames that it has read."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from service.can.bus_reader import CanReader
from service.can.frames import Frame, FrameFilter, FrameKey
from service.config.schema import BusConfig
from tests.end_to_end.processes import PATIENCE_S

STANDARD, EXTENDED = FrameKey(0x100, False), FrameKey(0x18FF0100, True)


def wait_for(condition: Callable[[], bool], what: Callable[[], object], limit_s: float = PATIENCE_S) -> None:
    """Wait until the condition holds; where it never does, say what was instead."""
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, what()
        time.sleep(0.005)


@contextmanager
def reading(config: BusConfig, *wanted: FrameKey) -> Iterator[CanReader]:
    """A reader of that bus, closed at the end."""
    reader = CanReader(config, [FrameFilter(key) for key in wanted or (STANDARD, EXTENDED)])
    reader.open()
    reader.start()
    try:
        yield reader
    finally:
        reader.close()


def take(reader: CanReader, count: int) -> list[Frame]:
    """The next frames, at least that many."""
    frames: list[Frame] = []

    def enough() -> bool:
        frames.extend(reader.take().frames())
        return len(frames) >= count

    wait_for(enough, lambda: f"{len(frames)} of {count} frames: {reader.stats()}")
    return frames
