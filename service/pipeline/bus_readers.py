"""The readers of all buses, and how the worker takes frames from them.  A new configuration can replace some."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

import structlog

from service.can.bus_reader import BusSnapshot, CanReader
from service.can.frames import FrameBlock
from service.can.user_errors import BusError
from service.config import Config
from service.ingest.samples.bus_samples import Ingest
from service.pipeline.persistence.recording import Recording

log = structlog.get_logger(__name__)


class Reader(Protocol):
    """Interface of service.can.bus_reader.CanReader as the worker uses it."""

    def take(self, most: int = 4096) -> FrameBlock:
        """Take about ``most`` of the waiting frames, oldest first."""

    def stats(self) -> BusSnapshot:
        """State and counters."""


class BusIntake:
    """One bus as the worker uses it: takes and records its frames, reports and logs its state."""

    def __init__(self, name: str, reader: Reader, ingest: Ingest, recording: Recording) -> None:
        self.name = name
        self._reader, self._ingest, self._recording = reader, ingest, recording
        self._state = "up"

    def take(self, most: int) -> FrameBlock:
        """Take waiting frames, and record them."""
        frames = self._reader.take(most)
        if frames:
            self._recording.write(self.name, frames)
        return frames

    def snapshot(self) -> BusSnapshot:
        """The present state of the bus; a change is logged."""
        stats = self._reader.stats()
        if stats.state != self._state:
            self._state = stats.state
            write = log.info if stats.up or stats.state == "closed" else log.error
            write("bus", bus=self.name, state=stats.state)
        return replace(stats, name=self.name, dropped={**stats.dropped, **self._ingest.dropped})


class BusReaders:
    """The open readers of all configured buses; used by one thread at a time.

    Raises:
        BusError: a bus cannot be opened.
    """

    def __init__(self, config: Config, ingests: Mapping[str, Ingest]) -> None:
        self._recording = Recording()
        self._arrived: Callable[[], object] = lambda: None
        self._readers = self._opened(config, ingests)

    def intakes(self, ingests: Mapping[str, Ingest], recording: Recording) -> list[BusIntake]:
        """The intakes for the worker.  They record to ``recording``, as do those that ``replaced`` makes later."""
        self._recording = recording
        return list(self._intakes(self._readers, ingests).values())

    def start(self, arrived: Callable[[], object]) -> None:
        """Start reading; ``arrived`` is called when frames have come."""
        self._arrived = arrived
        for reader in self._readers.values():
            reader.start(arrived)

    def turns(self) -> dict[str, int]:
        """Number of loops of each reader thread, to see that it is alive; from any thread."""
        return {f"reader {name}": reader.turns for name, reader in self._readers.items()}

    @contextmanager
    def replaced(self, new: Config, ingests: Mapping[str, Ingest]) -> Iterator[Mapping[str, BusIntake]]:
        """Read the buses of a new configuration: those in ``ingests`` with new readers, the others with the former.

        Readers that are replaced or no longer configured are closed first, as an adapter can be opened only once.  If
        a new reader cannot be opened, or the ``with`` block raises, all former readers are started again.

        Raises:
            BusError: a bus cannot be opened.
        """
        before, names = self._readers, [bus.name for bus in new.bus]
        closed = [reader for name, reader in before.items() if name in ingests or name not in names]
        for reader in closed:
            reader.close()
        opened: Mapping[str, CanReader] = {}
        try:
            opened = self._opened(new, ingests)
            for reader in opened.values():
                reader.start(self._arrived)
            self._readers = {name: opened.get(name) or before[name] for name in names}
            yield self._intakes(opened, ingests)
        except BaseException:
            self._readers = before
            for reader in opened.values():
                reader.close()
            for reader in closed:
                reader.start(self._arrived)
            raise

    def close(self) -> None:
        """Close all readers; frames that wait can still be taken."""
        for reader in self._readers.values():
            reader.close()

    def _opened(self, config: Config, ingests: Mapping[str, Ingest]) -> dict[str, CanReader]:
        opened = dict[str, CanReader]()
        try:
            for bus in config.bus:
                if bus.name in ingests:
                    reader = CanReader(bus, ingests[bus.name].filter, config.block_s)
                    reader.open()
                    opened[bus.name] = reader
        except BusError:
            for reader in opened.values():
                reader.close()
            raise
        return opened

    def _intakes(self, readers: Mapping[str, CanReader], ingests: Mapping[str, Ingest]) -> dict[str, BusIntake]:
        return {name: BusIntake(name, r, ingests[name], self._recording) for name, r in readers.items()}
