"""The buses of a configuration while they are read, with the decoders of their frames."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event
from typing import NamedTuple

from monitor_core.sampling import compile_stream
from service.can.bus_reader import CanReader
from service.can.frames import FrameBlock
from service.commands.command_line.progress import announced
from service.config import Config
from service.ingest.samples.bus_samples import Carried, Ingest

_TAKE_S = 0.1
_MAX_FRAMES = 1_000_000
"""Most frames of a bus that are taken at once"""


class LiveBus(NamedTuple):
    """A bus that is being read, and the decoder of its frames."""

    name: str
    reader: CanReader
    ingest: Ingest

    @property
    def dropped(self) -> dict[str, int]:
        """Number of frames that gave no sample, by reason."""
        counts = {**self.reader.stats().dropped, **self.ingest.dropped}
        return {reason: n for reason, n in counts.items() if n}

    @property
    def lost(self) -> dict[str, int]:
        """Dropped frames without those that no axis needs."""
        return {reason: n for reason, n in self.dropped.items() if reason != "unwanted"}


@contextmanager
def live_buses(config: Config, everything: bool = False, carried: Carried | None = None) -> Iterator[list[LiveBus]]:
    """Read the buses of a configuration until the end of the block.

    ``everything``: all frames, not only those that the axes need.  ``carried``: see Ingest.

    Raises:
        BusError: a bus cannot be opened.
        DescriptionError, IngestError: the configuration cannot be used.
    """
    opened = list[LiveBus]()
    announced("compiling the code that reads the frames, once after an installation", compile_stream)
    try:
        for bus in config.bus:
            ingest = Ingest(config, bus.name, carried)
            reader = CanReader(bus, None if everything else ingest.filter)
            opened.append(LiveBus(bus.name, reader, ingest))
            reader.open()
        for live in opened:
            live.reader.start()
        yield opened
    finally:
        for live in opened:
            live.reader.close()


def rounds(readers: Sequence[CanReader], seconds: float, stop: Event) -> Iterator[list[FrameBlock]]:
    """The new frames of each reader, ten times a second, until the time is over or ``stop`` is set."""
    end = time.monotonic() + seconds
    ended = False
    while not ended:
        ended = stop.wait(_TAKE_S) or time.monotonic() >= end
        yield [reader.take(_MAX_FRAMES) for reader in readers]


def bus_lines(buses: Sequence[LiveBus]) -> list[str]:
    """One line for each bus: its state, its frames, and the dropped frames by reason."""
    words = []
    for bus in buses:
        stats = bus.reader.stats()
        lost = "".join(f", {n} {reason}" for reason, n in bus.dropped.items())
        words.append(f"{bus.name}: {stats.state}, {stats.frames} frames{lost}")
    return words
