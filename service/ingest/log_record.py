"""A CAN log as a record: its frames pass through the same pipeline as those of a bus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from monitor_core.samples import SampleBlock
from service.can.frames import Frame
from service.can.log_files import CanLog
from service.config.schema import Config
from service.ingest.bus_samples import Ingest, Step, block_of
from service.ingest.timestamp_jitter import Stamps


class LogRecord:
    """A .log, .asc, .blf or .trc file.

    Raises:
        RecordError: it cannot be opened.
        DbcError, IngestError: the configuration cannot be used.
    """

    def __init__(self, path: Path, config: Config) -> None:
        self.path = path
        self._config = config
        self._log = CanLog(path)
        self._ingests = {bus.name: Ingest(config, bus.name) for bus in config.bus}
        self._other_bus = 0

    @property
    def bus_dropped(self) -> Mapping[str, Mapping[str, int]]:
        """Frames that yielded nothing, by bus and reason; frames of no bus are under the name of the file."""
        dropped: dict[str, Mapping[str, int]] = {name: i.dropped for name, i in self._ingests.items()}
        return {**dropped, self.path.name: {**self._log.dropped, "other_bus": self._other_bus}}

    @property
    def axis_dropped(self) -> Mapping[str, Mapping[str, int]]:
        """Values that became no sample, by axis and reason."""
        return {
            axis_id: ingest.axis_dropped(axis_id)
            for ingest in self._ingests.values()
            for axis_id in ingest.axis_ids
        }

    @property
    def axis_events(self) -> Mapping[str, Mapping[str, int]]:
        """How often the time line of an axis restarted, by cause."""
        ingests = self._ingests.values()
        return {axis_id: ingest.axis_events(axis_id) for ingest in ingests for axis_id in ingest.axis_ids}

    @property
    def axis_stamps(self) -> Mapping[str, Stamps]:
        """Scatter of the time stamps of each axis."""
        ingests = self._ingests.values()
        return {axis_id: ingest.axis_stamps(axis_id) for ingest in ingests for axis_id in ingest.axis_ids}

    def frames(self) -> Iterator[tuple[dict[str, list[Frame]], float]]:
        """The frames by name of their bus, and how much of the log has been read, 0 to 1.

        Raises:
            RecordError: the file is damaged.
        """
        channels: Mapping[str, str] | None = None
        for block in self._log.blocks():
            if channels is None:
                channels = self._channels({channel for channel, _ in block.frames})
            of_bus: dict[str, list[Frame]] = {}
            for channel, frame in block.frames:
                bus = channels.get(channel, channels.get(""))
                if bus is None:
                    self._other_bus += 1
                else:
                    of_bus.setdefault(bus, []).append(frame)
            yield of_bus, block.done

    def steps(self) -> Iterator[Step]:
        """The samples in order.

        Raises:
            RecordError: the file is damaged.
        """
        for of_bus, done in self.frames():
            samples: dict[str, SampleBlock] = {}
            for bus, frames in of_bus.items():
                for axis_id, found in self._ingests[bus].feed(frames).items():
                    samples[axis_id] = block_of(found)
            yield Step(samples, done)
        flushed = [ingest.flush() for ingest in self._ingests.values()]
        last = {axis_id: block_of(found) for of_bus in flushed for axis_id, found in of_bus.items()}
        if last:
            yield Step(last, 1.0)

    def _channels(self, seen: set[str]) -> Mapping[str, str]:
        """Bus by channel in the log; "" stands for all others.

        A log of another plant, or one with numbers only, is used with a configuration of one bus.
        """
        buses = self._config.bus
        known = {bus.channel: bus.name for bus in buses} | {bus.name: bus.name for bus in buses}
        if len(buses) == 1 and not seen & known.keys():
            return {"": buses[0].name}
        return known
