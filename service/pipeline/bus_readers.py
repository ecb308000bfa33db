"""The readers of all buses, of which another configuration exchanges some, and what the worker takes of each."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

import structlog

from service.can.bus_reader import BusSnapshot, CanReader
from service.can.frames import FrameBlock
from service.can.user_errors import BusError
from service.config import Config
from service.ingest.bus_samples import Ingest
from service.pipeline.recording import Recording

log = structlog.get_logger(__name__)


class Reader(Protocol):
    """Interface of service.can.bus_reader.CanReader as the worker uses it."""

    def take(self, most: int = 4096) -> FrameBlock:
        """About that many of the waiting frames, oldest first."""

    def stats(self) -> BusSnapshot:
        """State and counters."""


class BusIntake:
    """One bus: its frames, and its state, which is shown and logged."""

    def __init__(self, name: str, reader: Reader, ingest: Ingest, recording: Recording) -> None:
        self.name = name
        self._reader, self._ingest, self._recording = reader, ingest, recording
        self._state = "up"

    def take(self, most: int) -> FrameBlock:
        """The waiting frames, recorded."""
        frames = self._reader.take(most)
        if frames:
            self._recording.write(self.name, frames)
        return frames

    def snapshot(self) -> BusSnapshot:
        """State of the bus now; a change is logged."""
        stats = self._reader.stats()
        if stats.state != self._state:
            self._state = stats.state
            say = log.info if stats.up or stats.state == "closed" else log.error
            say("bus", bus=self.name, state=stats.state)
        return replace(stats, name=self.name, dropped={**stats.dropped, **self._ingest.dropped})


class BusReaders:
    """The readers of a configuration, opened; used by one thread at a time.

    Raises:
        BusError: a bus cannot be opened.
    """

    def __init__(self, config: Config, ingests: Mapping[str, Ingest]) -> None:
        self._recording = Recording()
        self._arrived: Callable[[], object] = lambda: None
        self._readers = self._opened(config, ingests)

    def intakes(self, ingests: Mapping[str, Ingest], recording: Recording) -> list[BusIntake]:
        """What the worker takes of them, recorded, also after an exchange."""
        self._recording = recording
        return list(self._intakes(self._readers, ingests).values())

    def start(self, arrived: Callable[[], object]) -> None:
        """Start reading; ``arrived`` is called when frames have come."""
        self._arrived = arrived
        for reader in self._readers.values():
            reader.start(arrived)

    def turns(self) -> dict[str, int]:
        """How often their loops have turned; from any thread."""
        return {f"reader {name}": reader.turns for name, reader in self._readers.items()}

    @contextmanager
    def exchanged(self, new: Config, ingests: Mapping[str, Ingest]) -> Iterator[Mapping[str, BusIntake]]:
        """Read these buses of a configuration anew, the others of it as before, and none else.

        The former readers are closed first: an adapter may be opened once.  Where that fails, or what is done
        meanwhile, they go on.

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
        """Close all; frames that wait can still be taken."""
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

    def _intakes(
        self, readers: Mapping[str, CanReader], ingests: Mapping[str, Ingest]
    ) -> dict[str, BusIntake]:
        return {name: BusIntake(name, r, ingests[name], self._recording) for name, r in readers.items()}
