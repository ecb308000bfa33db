"""All samples of one axis in a file, with its auxiliary signals."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock, concatenate
from service.can.decode import Decoder, FrameKey
from service.config.schema import Config, NamedAxis
from service.config.schema_signals import Source
from service.ingest.csv_table import CsvTable
from service.ingest.log_record import LogRecord
from service.ingest.rows import Floats, Rows
from service.ingest.table_files import Table, check_columns, open_table
from service.ingest.table_record import AxisColumns, Times

_NO_NUMBER = 1e30
"""In a column of which nothing is known: above that it is no measurement, not even a time in nanoseconds."""


class AxisSamples(NamedTuple):
    """All samples of an axis in a file; the names of their auxiliary signals; what was dropped, by reason."""

    block: SampleBlock
    signal_names: tuple[str, ...]
    dropped: Mapping[str, int]


def table_samples(path: Path, axis: NamedAxis) -> AxisSamples:
    """Samples from a .csv, .parquet or .mat file.

    A row with an absurd number is refused as a whole and counted as "absurd": where one cell is broken the others of
    its row, shifted or torn, cannot be trusted.  Rows next to it that belong to the same damage are counted as "torn",
    rows whose time alone runs ahead of the others' as "ahead".  In a CSV without names all columns are checked,
    otherwise those that are read.

    Raises:
        RecordError: the file cannot be read, is damaged, or lacks a column.
    """
    table = open_table(path)
    columns = AxisColumns(axis.id, axis.config)
    further = [signal for signal in axis.sources if signal.column is not None]
    wanted = columns.wanted() | {str(s.column): f"the signal {s.name} of axis {axis.id}" for s in further}
    check_columns(path, table, wanted)
    rows = _all_rows(table, list(dict.fromkeys((*wanted, *_all_columns(table)))))
    refused = _refused(rows, columns, axis)
    index, block = columns.chosen(rows, 0, ~np.any(list(refused.values()), axis=0))
    signals = [_value(s, rows.columns[str(s.column)][index]) for s in further]
    counts = {reason: int(np.count_nonzero(which)) for reason, which in refused.items()}
    return _with_signals(block, [s.name for s in further], signals, columns.dropped | counts)


def log_samples(path: Path, config: Config, axis: NamedAxis) -> AxisSamples:
    """From a CAN log.  Of a further signal each sample gets the last value received up to half an interval after it.

    Raises:
        RecordError: the file cannot be read or is damaged.
        DbcError, IngestError: the configuration cannot be used.
    """
    log = LogRecord(path, config)
    blocks = [step.samples[axis.id] for step in log.steps() if axis.id in step.samples]
    block = concatenate(blocks)
    dropped = dict(log.axis_dropped[axis.id])
    sound = (abs(block.u) <= PHYSICAL_LIMITS["torque"]) & (
        abs(block.y) <= PHYSICAL_LIMITS[axis.config.output]
    )
    block = block.select(sound)
    dropped["absurd"] += int(np.count_nonzero(~sound))
    received = _received(path, config, axis, block.t_us)
    return _with_signals(block, list(received), list(received.values()), dropped)


def _with_signals(
    block: SampleBlock, names: Sequence[str], signals: Sequence[Floats], dropped: Mapping[str, int]
) -> AxisSamples:
    columns = np.stack(signals, axis=1) if signals else None
    return AxisSamples(block._replace(signals=columns), tuple(names), dropped)


def _all_columns(table: Table) -> tuple[str, ...]:
    """The columns to check in addition to the wanted ones; without names all hold numbers."""
    return tuple(table.names) if isinstance(table, CsvTable) and not table.has_names else ()


def _all_rows(table: Table, names: list[str]) -> Rows:
    blocks = list(table.rows(names))
    return Rows({name: _joined([block.columns[name] for block in blocks]) for name in names}, 1.0)


def _refused(rows: Rows, columns: AxisColumns, axis: NamedAxis) -> dict[str, Bools]:
    """Which rows (N,) cannot be trusted, by reason."""
    time = axis.config.time.column
    absurd = _absurd(rows, columns, axis)
    values = [column for name, column in rows.columns.items() if name != time]
    beside = torn(np.column_stack(values), absurd)
    late = np.zeros(len(absurd), np.bool_)
    if time is not None:
        times = rows.columns[time]
        late = ahead(times, ~absurd & ~beside & np.isfinite(times))
    return {"absurd": absurd, "torn": beside, "ahead": late}


def _absurd(rows: Rows, columns: AxisColumns, axis: NamedAxis) -> Bools:
    """Which rows hold an absurd number; a missing number is not absurd."""
    torque, motion = columns.quantities(rows)
    absurd = (abs(torque) > PHYSICAL_LIMITS["torque"]) | (abs(motion) > PHYSICAL_LIMITS[axis.config.output])
    for values in rows.columns.values():
        absurd |= abs(values) > _NO_NUMBER
    return np.asarray(absurd, np.bool_)


def _joined(values: list[Floats]) -> Floats:
    return np.concatenate(values) if values else np.zeros(0)


def _value(signal: Source, values: Floats) -> Floats:
    return np.asarray(signal.factor * values + signal.offset, np.float64)


def _received(path: Path, config: Config, axis: NamedAxis, t_us: Times) -> dict[str, Floats]:
    """The auxiliary signals of an axis at the times of its samples, NaN before the first was received."""
    further = [(s, s.message, s.signal) for s in axis.sources]
    asked = [(message, name) for _, message, name in further if message is not None and name is not None]
    if not asked:
        return {}
    values = dict[tuple[str, str], list[tuple[int, float]]]({pair: [] for pair in asked})
    for pair, time_us, value in _decoded(path, config, axis, asked):
        values[pair].append((time_us, value))
    late = round(axis.config.sample_interval_s * 1e6 / 2)
    return {
        s.name: _value(s, _held(values[message, name], t_us + late))
        for s, message, name in further
        if message is not None and name is not None
    }


def _decoded(
    path: Path, config: Config, axis: NamedAxis, asked: list[tuple[str, str]]
) -> Iterator[tuple[tuple[str, str], int, float]]:
    bus = next(bus for bus in config.bus if bus.name == axis.config.bus)
    decoder = Decoder(bus.dbc, asked)
    names = {decoder.key(message): message for message, _ in asked}
    for of_bus, _ in LogRecord(path, config).frames():
        for frame in of_bus.get(bus.name, []):
            found = decoder.decode(frame)
            if not isinstance(found, str):
                message = names[FrameKey(frame.can_id, frame.extended)]
                yield from (((message, name), frame.t_us, value) for name, value in found.items())


def _held(received: list[tuple[int, float]], t_us: Times) -> Floats:
    """The last value received by each time."""
    if not received:
        return np.full(len(t_us), np.nan)
    times, values = np.array([t for t, _ in received]), np.array([value for _, value in received])
    order = np.argsort(times, kind="stable")
    k = np.searchsorted(times[order], t_us, side="right") - 1
    return np.where(k >= 0, values[order][k], np.nan)


# --- Rows of a damaged table that look harmless one by one: beside broken ones, or with a time that runs ahead --------


Bools = NDArray[np.bool_]

_NEAR = 10
"""Rows: farther from any broken one a row is not looked at; so many in a row need nothing to hold on to."""
_FEWEST = 20
"""Steps far from broken rows, to know how far a column steps."""
_MORE = 2.0
"""Steps that a column may have made beside one in each row."""


def torn(values: Floats, broken: Bools) -> Bools:
    """Rows (N,) that belong to the damage around ``broken`` ones, although each of their cells could be right.

    A writer that has lost its place continues with cells that are shifted or read from elsewhere, many of which look
    like measurements.  So rows next to broken ones are accepted only if they continue the sound ones across the damage:
    no column moves farther than it does elsewhere in as many rows.

    Args:
        values: of all columns but the time (N, C); NaN: missing, without information.
        broken: (N,).
    """
    largest = _largest_steps(values, ~_near(broken))
    starts = np.flatnonzero(np.append(True, _apart(values, broken, largest)))
    ends = np.append(starts[1:], len(broken)) - 1
    long = ends - starts >= _NEAR
    out, long_starts, long_ends = np.zeros(len(broken), np.bool_), starts[long], ends[long]
    if not long.any():
        return out
    for first, last in zip(starts[~long].tolist(), ends[~long].tolist(), strict=True):
        if not broken[first]:
            next_ = int(np.searchsorted(long_starts, first))
            pairs = [(first, k) for k in long_ends[max(next_ - 1, 0) : next_].tolist()]
            pairs += [(last, k) for k in long_starts[next_ : next_ + 1].tolist()]
            out[first : last + 1] = not any(_continue(values, i, k, largest) for i, k in pairs)
    return out


def _near(broken: Bools) -> Bools:
    """Rows near a broken one (N,)."""
    counts = np.cumsum(np.pad(broken.astype(np.int64), (_NEAR + 1, _NEAR)))
    return np.asarray(counts[2 * _NEAR + 1 :] > counts[: -2 * _NEAR - 1], np.bool_)


def _largest_steps(values: Floats, quiet: Bools) -> Floats:
    """Largest step of each column (C,) from one row to the next; infinite if nothing is known."""
    pairs = quiet[1:] & quiet[:-1]
    if np.count_nonzero(pairs) < _FEWEST:
        return np.full(values.shape[1], np.inf)
    return np.asarray(np.fmax.reduce(abs(np.diff(values, axis=0))[pairs], axis=0, initial=0.0))


def _apart(values: Floats, broken: Bools, largest: Floats) -> Bools:
    """Whether each row but the first does not follow the one before it (N - 1,)."""
    far = (abs(np.diff(values, axis=0)) > (1 + _MORE) * largest).any(axis=1)
    return np.asarray(broken[1:] | broken[:-1] | far, np.bool_)


def _continue(values: Floats, i: int, k: int, largest: Floats) -> bool:
    rows = abs(i - k)
    return rows <= _NEAR and not (abs(values[i] - values[k]) > (rows + _MORE) * largest).any()


def ahead(times: Floats, usable: Bools) -> Bools:
    """Rows (N,) whose time is later than that of rows after them, where the later rows are right.

    Of the ``usable`` rows the largest number with increasing times is accepted.  A single row ahead of them would
    otherwise make all of them late.
    """
    out = np.zeros(len(times), np.bool_)
    at = np.flatnonzero(usable)
    t = times[at]
    in_turn = np.count_nonzero(np.diff(np.maximum.accumulate(t)) > 0) + 1 if len(t) else 0
    if in_turn == len(t) or len(kept := _longest_rise(t)) <= in_turn:
        return out
    following = np.searchsorted(kept, np.arange(len(t)))  # the row itself, if it is kept
    next_time = np.append(t[kept], np.inf)[following]
    out[at] = t > next_time
    return out


def _longest_rise(values: Floats) -> NDArray[np.int64]:
    """Indices of the longest strictly increasing subsequence (K,).

    C. Schensted, Canadian J. Math. 13 (1961): for each length the smallest value that a subsequence can end with.
    """
    ends, where, before = list[float](), list[int](), list[int]()
    for k, value in enumerate(values.tolist()):
        length = bisect_left(ends, value)
        before.append(where[length - 1] if length else -1)
        ends[length : length + 1], where[length : length + 1] = [value], [k]
    found, k = list[int](), where[-1]
    while k >= 0:
        found.append(k)
        k = before[k]
    return np.array(found[::-1], dtype=np.int64)
