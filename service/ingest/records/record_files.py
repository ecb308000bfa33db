"""Records from files: tables and CAN logs behind one interface."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from monitor_core.samples import SampleBlock, concatenate
from service.can.bus import channel_number
from service.can.frames import FrameBlock
from service.can.log_bytes import GZIP
from service.can.log_files import LOG_SUFFIXES, CanLog, log_suffix
from service.can.user_errors import RecordError
from service.config.schema import BusConfig, Config
from service.ingest.samples.axis_columns import AxisColumns
from service.ingest.samples.bus_samples import Carried, Ingest, carried_by
from service.ingest.samples.timestamp_jitter import Stamps
from service.ingest.tables.table_files import TABLE_SUFFIXES, check_columns, open_table


class RecordStep(NamedTuple):
    """The samples by axis in one part of a record; ``done``: part of the record that has been read, 0 to 1."""

    samples: Mapping[str, SampleBlock]
    done: float


_Counts = Mapping[str, Mapping[str, int]]
_NONE: Mapping[str, Any] = MappingProxyType({})


class RecordQuality(NamedTuple):
    """Dropped values so far, and the quality of the time stamps; a table has only ``axis_dropped``."""

    axis_dropped: _Counts
    """Number of dropped values (CAN log) or rows (table), by axis and reason"""
    bus_dropped: _Counts = _NONE
    """Number of dropped frames by bus and reason; frames of no bus are under the name of the file and channel"""
    axis_events: _Counts = _NONE
    """How often the time axis of an axis restarted, by cause"""
    axis_stamps: Mapping[str, Stamps] = _NONE
    """Jitter of the time stamps of each axis"""


def read_record(path: Path, config: Config) -> FileRecord:
    """Open the record in a file, by its suffix.

    Raises:
        RecordError: the file cannot be read, has an unknown suffix, or lacks a column.
        DescriptionError: the configuration cannot be used.
    """
    return TableRecord(path, config) if is_table(path) else LogRecord(path, config)


def is_table(path: Path) -> bool:
    """Whether a record is a table; otherwise it is a CAN log.

    Raises:
        RecordError: the suffix is unknown.
    """
    if log_suffix(path):
        return False
    if path.suffix.lower() not in TABLE_SUFFIXES:
        kinds = " ".join(dict.fromkeys((*TABLE_SUFFIXES, *LOG_SUFFIXES)))
        hint = "; let a table of text end with .csv, and export a spreadsheet as one"
        raise RecordError(f"{path}: no such kind of record; there is {kinds}, and logs with {GZIP} behind that{hint}")
    return True


def samples_of(record: FileRecord, axis_id: str, progress: Callable[[float], None] = lambda _: None) -> SampleBlock:
    """Read all samples of one axis, possibly none.

    Raises:
        RecordError: the file is damaged.
    """
    blocks = []
    for step in record.steps():
        if axis_id in step.samples:
            blocks.append(step.samples[axis_id])
        progress(step.done)
    return concatenate(blocks)


class TableRecord:
    """A .csv, .parquet or .mat file with the columns named in the configuration.

    Axes without columns in the configuration are ignored.

    Raises:
        RecordError: the file cannot be read, or lacks a column.
    """

    def __init__(self, path: Path, config: Config) -> None:
        self.path = path
        self._table = open_table(path)
        axes = [a for a in config.axes if a.config.torque.column or a.config.motion.column]
        signals = carried_by(config)
        self._axes = {axis.id: AxisColumns(axis, signals[axis.id]) for axis in axes}
        if not self._axes:
            raise RecordError(
                f"{path}: no axis has columns in the configuration: set torque.column and angle.column or speed.column"
            )
        self._wanted: dict[str, str] = {}
        for columns in self._axes.values():
            self._wanted |= columns.wanted()
        check_columns(path, self._table, self._wanted)

    @property
    def quality(self) -> RecordQuality:
        """The quality of what has been read so far."""
        unreadable = len(self.left_out)
        return RecordQuality(
            {id_: {**columns.dropped, "unreadable": unreadable} for id_, columns in self._axes.items()}
        )

    @property
    def left_out(self) -> Sequence[str]:
        """Lines that could not be read, with their faults; complete when the record has been read to its end."""
        return self._table.left_out

    def steps(self) -> Iterator[RecordStep]:
        """Read the samples in order; possible once."""
        first_row = 0
        for rows in self._table.rows(list(self._wanted)):
            samples = {axis_id: axis.samples(rows, first_row) for axis_id, axis in self._axes.items()}
            first_row += len(next(iter(rows.columns.values())))
            yield RecordStep({axis_id: block for axis_id, block in samples.items() if block.size}, rows.done)


class LogRecord:
    """A CAN log; its frames pass through the same code as those of a bus.

    ``carried``: axes to read, with their auxiliary signals; None: all axes, with the signals that the monitoring needs.

    Raises:
        RecordError: the log cannot be opened, or the configuration has no bus.
        DescriptionError: the configuration cannot be used.
    """

    def __init__(self, path: Path, config: Config, carried: Carried | None = None) -> None:
        if not config.bus:
            raise RecordError(
                f"{path} is a CAN log, and the configuration has no [[bus]]: add it with the file that describes its"
                " messages, and give message and signal of torque and motion in each axis"
            )
        self.path = path
        self._config = config
        self._log = CanLog(path)
        self._ingests = {bus.name: Ingest(config, bus.name, carried) for bus in config.bus}
        self._other_bus = Counter[str]()

    @property
    def quality(self) -> RecordQuality:
        """The quality of what has been read so far."""
        by_bus: dict[str, Mapping[str, int]] = {name: i.dropped for name, i in self._ingests.items()}
        by_bus[self.path.name] = self._log.dropped
        for channel, count in self._other_bus.items():
            by_bus[f"{self.path.name}, channel {channel}"] = {"other_bus": count}
        axes = {axis_id: axis for i in self._ingests.values() for axis_id, axis in i.axes.items()}
        return RecordQuality(
            {axis_id: axis.dropped for axis_id, axis in axes.items()},
            by_bus,
            {axis_id: axis.events for axis_id, axis in axes.items()},
            {axis_id: axis.stamps for axis_id, axis in axes.items()},
        )

    @property
    def left_out(self) -> Sequence[str]:
        """Places that could not be read, with their faults; complete when the log has been read to its end."""
        return self._log.left_out

    def frames(self) -> Iterator[tuple[dict[str, FrameBlock], float]]:
        """The frames by bus, and the part of the log that has been read, 0 to 1.

        Raises:
            RecordError: the log is damaged, or none of its frames is of a configured bus.
        """
        buses: _LogChannels | None = None
        for block in self._log.blocks():
            buses = buses or _LogChannels(self._config.bus, block.names)
            names = [buses.bus(channel) for channel in block.names]
            of_bus = dict[str, FrameBlock]()
            for bus in dict.fromkeys(name for name in names if name is not None):
                mine = np.array([name == bus for name in names])[block.channels]
                of_bus[bus] = block.frames if mine.all() else block.frames.select(mine)
            for number, (channel, bus_name) in enumerate(zip(block.names, names, strict=True)):
                if bus_name is None:
                    self._other_bus[channel] += int(np.count_nonzero(block.channels == number))
            yield of_bus, block.done
        if self._other_bus.total() == self._log.frames:
            raise RecordError(_no_bus_words(self.path, self._config.bus, self._other_bus))

    def steps(self) -> Iterator[RecordStep]:
        """Read the samples in order; possible once."""
        for of_bus, done in self.frames():
            fed = [self._ingests[bus].feed(frames) for bus, frames in of_bus.items()]
            yield RecordStep({axis_id: found for axes in fed for axis_id, found in axes.items()}, done)
        flushed = [ingest.flush() for ingest in self._ingests.values()]
        last = {axis_id: found for axes in flushed for axis_id, found in axes.items()}
        if last:
            yield RecordStep(last, 1.0)


FileRecord = TableRecord | LogRecord
"""A record from a file of either kind"""


# --- The configured bus of each channel in a log ----------------------------------------------------------------------


class _LogChannels:
    """The bus of each channel in a log; ``seen``: channels at the start of the log.

    A channel belongs to the bus with that channel or that name.  Some formats have numbers instead of names: then
    channel 0 belongs to the bus whose channel ends with that number, such as can0, as python-can writes such files.  If
    there is one bus, and the log starts with a single channel that does not belong to it, the channel is assigned to
    that bus: the log is from another plant.
    """

    def __init__(self, buses: Sequence[BusConfig], seen: Sequence[str]) -> None:
        self._known = {bus.channel: bus.name for bus in buses} | {bus.name: bus.name for bus in buses}
        numbers = [channel_number(bus.channel) for bus in buses]
        self._numbered = {
            number: bus.name for bus, number in zip(buses, numbers, strict=True) if numbers.count(number) == 1
        }
        if len(buses) == 1 and len(seen) == 1 and self.bus(seen[0]) is None:
            self._known[seen[0]] = buses[0].name

    def bus(self, channel: str) -> str | None:
        """Name of the bus of a channel; None: the configuration has no bus for it."""
        if channel in self._known:
            return self._known[channel]
        return self._numbered.get(int(channel)) if channel.isdecimal() else None


def _no_bus_words(path: Path, buses: Sequence[BusConfig], frames: Mapping[str, int]) -> str:
    """Why no frame is used, and how to correct the configuration; ``frames``: number of frames by channel."""
    found = ", ".join(f"{channel} ({count} frames)" for channel, count in frames.items())
    known = ", ".join(f'name = "{bus.name}", channel = "{bus.channel}"' for bus in buses)
    return (
        f"{path}: none of its channels is a bus of the configuration: it has {found}, [[bus]] has {known};"
        f' give the bus that was recorded the channel of the log, channel = "{next(iter(frames))}"'
    )
