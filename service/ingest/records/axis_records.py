"""Reads all samples of one axis from a file, as the daemon would get them; for identification and calibration."""

import hashlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock
from service.can.frames import FrameKey, key_of
from service.can.messages import Message, MessageSet, find_signal, key_of_message
from service.can.user_errors import RecordError
from service.config.bus_messages import messages_of
from service.config.schema import Config, FurtherSignalConfig, NamedAxis, TimeConfig
from service.config.unit_names import UNITS
from service.ingest.records.record_files import LogRecord, is_table, samples_of
from service.ingest.samples.axis_columns import AxisColumns
from service.ingest.samples.unwrap import AMBIGUOUS, turns_of
from service.ingest.tables.csv_tables import CsvRows
from service.ingest.tables.table_files import check_columns, open_table
from service.ingest.tables.time_of_day import TimeOfDay
from service.ingest.tables.torn_rows import ahead, torn

_NO_NUMBER = 1e30
"""A larger value is no measurement in any column, not even a time in nanoseconds."""


def sha256_of(path: Path) -> str:
    """Hash of a file."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}") from None


ReadProgress = Callable[[float], None]
"""Called with the part of the file that has been read, 0 to 1."""


class AxisRecord(NamedTuple):
    """The samples of an axis in a file, and the number of dropped table rows or log values by reason."""

    block: SampleBlock
    dropped: Mapping[str, int]
    left_out: Sequence[str] = ()
    """Lines or other parts of the file that could not be read, with their positions"""


def silent_in(path: Path, config: Config) -> dict[str, Mapping[str, int]]:
    """The axes with fewer than two samples in a CAN log, with their dropped values by reason; empty for a table.

    A log is read only until every axis has two samples.

    Raises:
        RecordError: the file cannot be read, or is damaged.
        DescriptionError: the configuration cannot be used.
    """
    if is_table(path) or not config.bus:
        return {}
    log, counts = LogRecord(path, config, {axis.id: () for axis in config.axes}), Counter[str]()
    for step in log.steps():
        counts.update({axis_id: block.size for axis_id, block in step.samples.items()})
        if all(counts[axis.id] > 1 for axis in config.axes):
            return {}
    lost = log.quality.axis_dropped
    return {axis.id: lost[axis.id] for axis in config.axes if counts[axis.id] < 2}


def axis_record(
    path: Path,
    config: Config,
    axis: NamedAxis,
    signals: Sequence[FurtherSignalConfig],
    progress: ReadProgress = lambda _: None,
) -> AxisRecord:
    """Read the samples of an axis, with these auxiliary signals and continuous angles, from a table or a CAN log.

    Raises:
        RecordError: the file cannot be read, or is damaged.
        DescriptionError: the configuration cannot be used.
    """
    if is_table(path):
        record = _table_record(path, axis, signals, progress)
    else:
        record = _log_record(path, config, axis, signals, progress)
    turns = turns_of(axis.config)
    if turns is None:
        return record
    block = turns.unwrapped(record.block)
    return AxisRecord(block, {**record.dropped, AMBIGUOUS: turns.refused}, record.left_out)


def _log_record(
    path: Path, config: Config, axis: NamedAxis, signals: Sequence[FurtherSignalConfig], progress: ReadProgress
) -> AxisRecord:
    log = LogRecord(path, config, {axis.id: signals})
    block = samples_of(log, axis.id, progress)
    dropped = {**log.quality.axis_dropped[axis.id], "unreadable": len(log.left_out)}
    return AxisRecord(block, dropped, log.left_out)


def _table_record(
    path: Path, axis: NamedAxis, signals: Sequence[FurtherSignalConfig], progress: ReadProgress
) -> AxisRecord:
    """Samples from a .csv, .parquet or .mat file.

    A row with an absurd number is refused as a whole and counted as "absurd": if one cell is broken, the other cells of
    the row may be shifted or torn.  Rows next to it that belong to the same damage are counted as "torn", rows whose
    time runs ahead of that of the rows after them as "ahead", lines of a CSV that cannot be read as "unreadable".  In a
    CSV without names all columns are checked, otherwise only those that are read.
    """
    table = open_table(path)
    columns = AxisColumns(axis, signals)
    purposes = columns.wanted()
    check_columns(path, table, purposes)
    unnamed = () if table.has_names else table.names
    names = list(dict.fromkeys((*purposes, *unnamed)))
    parts: dict[str, list[Floats]] = {name: [np.zeros(0)] for name in names}
    for block in table.rows(names):
        for name in names:
            parts[name].append(block.columns[name])
        progress(block.done)
    rows = CsvRows({name: np.concatenate(parts.pop(name)) for name in names}, 1.0)
    refused = _refused(rows, columns, axis.config.time)
    samples = columns.samples(rows, 0, ~np.any(list(refused.values()), axis=0))
    counts = {reason: int(np.count_nonzero(which)) for reason, which in refused.items()}
    counts["unreadable"] = len(table.left_out)
    return AxisRecord(samples, columns.dropped | counts, table.left_out)


def _refused(rows: CsvRows, columns: AxisColumns, time: TimeConfig) -> dict[str, Bools]:
    """Masks of the rows (N,) that cannot be trusted, by reason; a missing number is not absurd."""
    absurd = columns.absurd(*columns.quantities(rows))
    for values in rows.columns.values():
        absurd |= abs(values) > _NO_NUMBER
    beside, late = np.zeros((2, len(absurd)), np.bool_)
    if absurd.any():
        beside = torn(np.column_stack([column for name, column in rows.columns.items() if name != time.column]), absurd)
    if time.column is not None:
        times = TimeOfDay().continuous(rows.columns[time.column] * 1e6 * time.factor)
        late = ahead(times, ~absurd & ~beside & np.isfinite(times))
    return {"absurd": absurd, "torn": beside, "ahead": late}


# --- Why a record has no samples of an axis ---------------------------------------------------------------------------


def no_samples_words(path: Path, config: Config, axis: NamedAxis, dropped: Mapping[str, int]) -> str:
    """Why a record gives no samples of an axis, as far as the record shows it; otherwise the counts of dropped values.

    Raises:
        RecordError, DescriptionError: as of LogRecord.
    """
    if dropped.get("absurd"):
        torque, motion = PHYSICAL_LIMITS["torque"], PHYSICAL_LIMITS[axis.config.output]
        unit = UNITS[axis.config.output]
        return (
            f"{dropped['absurd']} values are beyond {torque:g} N m or {motion:g} {unit}, more than any machine has; is"
            " the factor that converts them to SI units missing or wrong?"
        )
    if not is_table(path) and (words := absence_words(path, config, axis)):
        return words
    lost = ", ".join(f"{count} {reason}" for reason, count in dropped.items() if count)
    if is_table(path) and dropped.get("not_finite"):
        lost += f", as no two rows have both torque and {axis.config.output}: export them with a common interval"
    return f"dropped: {lost or 'nothing'}"


def absence_words(path: Path, config: Config, axis: NamedAxis) -> str:
    """Differences between the frames of a log and the described messages of an axis; empty: none.

    Raises:
        RecordError, DescriptionError: as of LogRecord.
    """
    counts, longest = Counter[FrameKey](), dict[FrameKey, int]()
    for of_bus, _ in LogRecord(path, config, {axis.id: ()}).frames():
        if (frames := of_bus.get(axis.config.bus)) is None:
            continue
        counts.update(frames.counts())
        ids, places = np.unique(frames.ids, return_inverse=True)
        lengths = np.zeros(len(ids), np.int64)
        np.maximum.at(lengths, places, frames.lengths)
        for record_id, length in zip(ids.tolist(), lengths.tolist(), strict=True):
            key = key_of(record_id)
            longest[key] = max(longest.get(key, 0), length)
    known = messages_of(config, axis.config.bus)
    sources = axis.config.torque, axis.config.motion
    messages = [find_signal(known, source.message, source.signal)[0] for source in sources]
    words = (_wrong(known, message, counts, longest) for message in messages)
    return "; ".join(dict.fromkeys(word for word in words if word))


def _wrong(known: MessageSet, message: Message, counts: Counter[FrameKey], longest: Mapping[FrameKey, int]) -> str:
    key, name = key_of_message(message), message.name
    received = {other: count for other, count in counts.items() if known.carries(key, other.record_id)}
    if received:
        length = max(longest[other] for other in received)
        if length >= message.length:
            return ""
        return f"{name} has {message.length} bytes by {known.source}, and its {sum(received.values())} frames {length}"
    twin = FrameKey(key.can_id, not key.extended)
    if counts[twin]:
        bits = {True: 29, False: 11}
        return (
            f"{name} has an identifier of {bits[key.extended]} bits by {known.source}, and {counts[twin]} frames have"
            f" 0x{key.can_id:X} with {bits[twin.extended]}"
        )
    return f"{name} (0x{key.can_id:X}) was not received"
