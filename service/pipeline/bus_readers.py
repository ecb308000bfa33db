"""The readers of all buses, of which another configuration exchanges some."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from service.can.bus_reader import CanReader
from service.can.user_errors import BusError
from service.config import Config
from service.ingest.bus_samples import Ingest
from service.pipeline.recording import Recording
from service.pipeline.worker import BusIntake


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
