"""A reader at work, and waiting for what it does."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from service.can.bus_reader import CanReader
from service.can.frames import Frame, FrameKey
from service.config.schema import BusConfig

STANDARD, EXTENDED = FrameKey(0x100, False), FrameKey(0x18FF0100, True)


def wait_for(condition: Callable[[], bool], what: Callable[[], object], limit_s: float = 20.0) -> None:
    """Wait until the condition holds; where it never does, say what was instead."""
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, what()
        time.sleep(0.005)


@contextmanager
def reading(config: BusConfig, *wanted: FrameKey) -> Iterator[CanReader]:
    """A reader of that bus, closed at the end."""
    reader = CanReader(config, wanted or (STANDARD, EXTENDED))
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
        frames.extend(reader.take())
        return len(frames) >= count

    wait_for(enough, lambda: f"{len(frames)} of {count} frames: {reader.stats()}")
    return frames
