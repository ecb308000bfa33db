"""A reader of a bus, and the frames that it has read."""

from collections.abc import Iterator
from contextlib import contextmanager

from service.can.bus_reader import CanReader
from service.can.frames import Frame, FrameFilter, FrameKey
from service.config.schema import BusConfig
from tests.end_to_end.processes import wait_for

STANDARD, EXTENDED = FrameKey(0x100, False), FrameKey(0x18FF0100, True)


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
