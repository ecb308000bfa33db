"""Records for identification from files: the readers of replay, records of one axis, and their origin."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.identification import Record, between
from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock
from service.can.dbc import Decoder
from service.can.frames import Frame
from service.can.user_errors import RecordError
from service.config.schema import Config, NamedAxis
from service.ingest.axis_columns import AxisColumns
from service.ingest.quantities import quantity_of
from service.ingest.records import LogRecord, is_table, samples_of
from service.ingest.table_files import CsvTable, Rows, check_columns, open_table
from service.ingest.torn_rows import Bools, ahead, torn
from service.ingest.unwrap import AMBIGUOUS, turns_of

_RANGE = re.compile(r"(?P<path>.+)@(?P<start>[\d.]*):(?P<end>[\d.]*)")
_NO_NUMBER = 1e30
"""In a column of which nothing is known: above that it is no measurement, not even a time in nanoseconds."""


class Wanted(NamedTuple):
    """A file and a range in it: seconds after the first sample; None: to its end."""

    path: Path
    start_s: float | None = None
    end_s: float | None = None


@dataclass(frozen=True)
class Source:
    """Origin of a record, for the report and the nominal values made from it.

    ``samples`` are those of the axis in the whole file, ``used`` those in the range.  ``dropped`` counts what became no
    sample, by reason: rows of a table, values of a log.
    """

    path: Path
    sha256: str
    samples: int
    used: int
    start_s: float
    end_s: float
    dropped: Mapping[str, int]

    @property
    def words(self) -> str:
        """One line for the user."""
        complete = self.used == self.samples
        part = "" if complete else f", {self.used} of them from {self.start_s:g} to {self.end_s:g} s"
        lost = ", ".join(f"{n} {reason.replace('_', ' ')}" for reason, n in self.dropped.items() if n)
        return f"{self.path}: {self.samples} samples{part}; dropped: {lost or 'nothing'}"


class Loaded(NamedTuple):
    """A record and its origin."""

    record: Record
    source: Source


def wanted(text: str) -> Wanted:
    """Parse ``FILE``, ``FILE@10:60``, ``FILE@10:`` or ``FILE@:60``: seconds after the first sample of the axis.

    A file whose name is the whole text takes precedence.

    Raises:
        RecordError: the range is invalid.
    """
    found = _RANGE.fullmatch(text)
    if found is None or Path(text).exists():
        return Wanted(Path(text))
    try:
        start, end = (float(part) if part else None for part in (found["start"], found["end"]))
    except ValueError:
        raise RecordError(f"{text}: a range is @START:END in seconds, such as @10:60, @10: or @:60") from None
    if start is not None and end is not None and start >= end:
        raise RecordError(f"{text}: the range ends before its start")
    return Wanted(Path(found["path"]), start, end)


def load(text: str, config: Config, axis_id: str) -> Loaded:
    """The record of one axis in a file.

    Args:
        text: the file, with a range or without: ``wanted``.
        config: says where the axis is in it.
        axis_id: as "robot.axis".

    Raises:
        RecordError: no such axis; the file cannot be read, is damaged, or holds too few samples of the axis.
        DbcError, IngestError: the configuration cannot be used.
    """
    want, axis = wanted(text), _axis_named(config, axis_id)
    samples = _unwrapped(_samples(want.path, config, axis), axis)
    if samples.block.size < 2:
        dropped = ", ".join(f"{count} {reason}" for reason, count in samples.dropped.items() if count)
        raise RecordError(
            f"{want.path}: {samples.block.size} samples of axis {axis.id} in it; dropped: {dropped or 'nothing'}"
        )
    full = _record(samples, axis, want.path.name)
    record = _in_range(full, want)
    start_s, end_s = (float(t - full.t[0]) for t in record.t[[0, -1]])
    digest = sha256_of(want.path)
    source = Source(want.path, digest, len(full), len(record), start_s, end_s, samples.dropped)
    return Loaded(record, source)


def sha256_of(path: Path) -> str:
    """Hash of a file."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}") from None


def _axis_named(config: Config, axis_id: str) -> NamedAxis:
    for axis in config.axes:
        if axis.id == axis_id:
            return axis
    raise RecordError(
        f"no axis {axis_id} in the configuration; there is {', '.join(a.id for a in config.axes)}"
    )


def _record(samples: _AxisSamples, axis: NamedAxis, name: str) -> Record:
    # Times since the first sample: those since 1970 have no digits left for microseconds.
    block = samples.block
    columns = () if block.signals is None else block.signals.T
    signals = dict(zip(samples.signal_names, columns, strict=True))
    t = (block.t_us - block.t_us[0]) * 1e-6
    return Record(t, block.u, block.y, axis.config.output, name, None, signals)


def _in_range(record: Record, want: Wanted) -> Record:
    if want.start_s is None and want.end_s is None:
        return record
    end_s = np.inf if want.end_s is None else want.end_s
    try:
        return between(record, want.start_s or 0.0, end_s)
    except ValueError as error:
        raise RecordError(f"{want.path}: {error}") from None


# --- all samples of the axis, with all its auxiliary signals ----------------------------------------------


class _AxisSamples(NamedTuple):
    block: SampleBlock
    signal_names: tuple[str, ...]
    dropped: Mapping[str, int]


def _samples(path: Path, config: Config, axis: NamedAxis) -> _AxisSamples:
    if is_table(path):
        return _table_samples(path, axis)
    if axis.config.records_only:
        raise RecordError(
            f"{path} is a CAN log, and there is no [[bus]] in the configuration that tells its DBC"
        )
    return _log_samples(path, config, axis)


def _unwrapped(samples: _AxisSamples, axis: NamedAxis) -> _AxisSamples:
    """The samples with continuous angles, where the configured one wraps after each turn."""
    turns = turns_of(axis.config)
    if turns is None:
        return samples
    block = turns.unwrapped(samples.block)
    return samples._replace(block=block, dropped={**samples.dropped, AMBIGUOUS: turns.refused})


def _with_signals(
    block: SampleBlock, signals: Mapping[str, Floats], dropped: Mapping[str, int]
) -> _AxisSamples:
    columns = np.stack(list(signals.values()), axis=1) if signals else None
    return _AxisSamples(block._replace(signals=columns), tuple(signals), dropped)


def _table_samples(path: Path, axis: NamedAxis) -> _AxisSamples:
    """Samples from a .csv, .parquet or .mat file.

    A row with an absurd number is refused as a whole and counted as "absurd": where one cell is broken the others of
    its row, shifted or torn, cannot be trusted.  Rows next to it that belong to the same damage are counted as "torn",
    rows whose time alone runs ahead of the others' as "ahead".  In a CSV without names all columns are checked,
    otherwise those that are read.
    """
    table = open_table(path)
    columns = AxisColumns(axis.id, axis.config)
    sources = [source for source in axis.sources if source.column is not None]
    wanted = columns.wanted() | {str(s.column): f"the signal {s.name} of axis {axis.id}" for s in sources}
    check_columns(path, table, wanted)
    unnamed = table.names if isinstance(table, CsvTable) and not table.has_names else ()
    names = list(dict.fromkeys((*wanted, *unnamed)))
    blocks = list(table.rows(names))
    joined = {name: np.concatenate([np.zeros(0), *(b.columns[name] for b in blocks)]) for name in names}
    rows = Rows(joined, 1.0)
    refused = _refused(rows, columns, axis)
    index, block = columns.samples(rows, 0, ~np.any(list(refused.values()), axis=0))
    signals = {s.name: s.factor * joined[str(s.column)][index] + s.offset for s in sources}
    counts = {reason: int(np.count_nonzero(which)) for reason, which in refused.items()}
    return _with_signals(block, signals, columns.dropped | counts)


def _refused(rows: Rows, columns: AxisColumns, axis: NamedAxis) -> dict[str, Bools]:
    """Which rows (N,) cannot be trusted, by reason; a missing number is not absurd."""
    time = axis.config.time.column
    torque, motion = columns.quantities(rows)
    absurd = (abs(torque) > PHYSICAL_LIMITS["torque"]) | (abs(motion) > PHYSICAL_LIMITS[axis.config.output])
    for values in rows.columns.values():
        absurd |= abs(values) > _NO_NUMBER
    beside = torn(np.column_stack([column for name, column in rows.columns.items() if name != time]), absurd)
    late = np.zeros(len(absurd), np.bool_)
    if time is not None:
        times = rows.columns[time]
        late = ahead(times, ~absurd & ~beside & np.isfinite(times))
    return {"absurd": absurd, "torn": beside, "ahead": late}


def _log_samples(path: Path, config: Config, axis: NamedAxis) -> _AxisSamples:
    """Samples from a CAN log, with the signals as last received up to half an interval after each."""
    log = _ListenedLog(path, config, axis)
    block = samples_of(log, axis.id)
    dropped = dict(log.quality.axis_dropped[axis.id])
    sound = (abs(block.u) <= PHYSICAL_LIMITS["torque"]) & (
        abs(block.y) <= PHYSICAL_LIMITS[axis.config.output]
    )
    block = block.select(sound)
    dropped["absurd"] += int(np.count_nonzero(~sound))
    late = round(axis.config.sample_interval_s * 1e6 / 2)
    signals = {name: _held(received, block.t_us + late) for name, received in log.received.items()}
    return _with_signals(block, signals, dropped)


class _ListenedLog(LogRecord):
    """A log that keeps the auxiliary signals of an axis while it is read: times of receipt and values, by name."""

    def __init__(self, path: Path, config: Config, axis: NamedAxis) -> None:
        super().__init__(path, config)
        sources = [s for s in axis.sources if s.message is not None and s.signal is not None]
        bus = next(bus for bus in config.bus if bus.name == axis.config.bus)
        self._bus, self._decoder = (
            bus.name,
            Decoder(bus.dbc, [(str(s.message), str(s.signal)) for s in sources]),
        )
        self._quantities = [quantity_of(s.name, s, self._decoder) for s in sources]
        self.received: dict[str, list[tuple[int, float]]] = {s.name: [] for s in sources}

    def frames(self) -> Iterator[tuple[dict[str, list[Frame]], float]]:
        for of_bus, done in super().frames():
            for frame in of_bus.get(self._bus, ()) if self._quantities else ():
                found = self._decoder.decode(frame)
                for q in self._quantities:
                    if (
                        q.key == frame.key
                        and not isinstance(found, str)
                        and (value := q.value(found)) is not None
                    ):
                        self.received[q.name].append((frame.t_us, value))
            yield of_bus, done


def _held(received: list[tuple[int, float]], t_us: NDArray[np.int64]) -> Floats:
    if not received:
        return np.full(len(t_us), np.nan)
    times, values = np.array([t for t, _ in received]), np.array([value for _, value in received])
    order = np.argsort(times, kind="stable")
    k = np.searchsorted(times[order], t_us, side="right") - 1
    return np.where(k >= 0, values[order][k], np.nan)
