"""Records for identification from files: the readers of replay, records of one axis, and their origin."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.identification import Record, between
from service.can.log_files import LOG_SUFFIXES
from service.can.user_errors import RecordError
from service.config.schema import Config, NamedAxis
from service.ingest.axis_samples import AxisSamples, log_samples, table_samples
from service.ingest.records import RECORD_SUFFIXES
from service.ingest.table_files import TABLE_SUFFIXES
from service.ingest.unwrap import AMBIGUOUS, turns_of

_RANGE = re.compile(r"(?P<path>.+)@(?P<start>[\d.]*):(?P<end>[\d.]*)")
_CHUNK = 1 << 20


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
        part = (
            ""
            if self.used == self.samples
            else f", {self.used} of them from {self.start_s:g} to {self.end_s:g} s"
        )
        lost = ", ".join(
            f"{count} {reason.replace('_', ' ')}" for reason, count in self.dropped.items() if count
        )
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
    want, axis = wanted(text), axis_named(config, axis_id)
    samples = unwrapped(_samples(want.path, config, axis), axis)
    if samples.block.size < 2:
        dropped = ", ".join(f"{count} {reason}" for reason, count in samples.dropped.items() if count)
        raise RecordError(
            f"{want.path}: {samples.block.size} samples of axis {axis.id} in it; dropped: {dropped or 'nothing'}"
        )
    full = _record(samples, axis, Path(want.path).name)
    record = _in_range(full, want)
    since = record.t - full.t[0]
    source = Source(
        want.path,
        _sha256(want.path),
        len(full),
        len(record),
        float(since[0]),
        float(since[-1]),
        samples.dropped,
    )
    return Loaded(record, source)


def axis_named(config: Config, axis_id: str) -> NamedAxis:
    """The axis of that name.

    Raises:
        RecordError: there is none.
    """
    for axis in config.axes:
        if axis.id == axis_id:
            return axis
    raise RecordError(
        f"no axis {axis_id} in the configuration; there is {', '.join(a.id for a in config.axes)}"
    )


def _samples(path: Path, config: Config, axis: NamedAxis) -> AxisSamples:
    suffix = path.suffix.lower()
    if suffix in TABLE_SUFFIXES:
        return table_samples(path, axis)
    if suffix in LOG_SUFFIXES:
        if axis.config.records_only:
            raise RecordError(
                f"{path} is a CAN log, and there is no [[bus]] in the configuration that tells its DBC"
            )
        return log_samples(path, config, axis)
    raise RecordError(f"{path}: no such kind of record; there is {' '.join(RECORD_SUFFIXES)}")


def unwrapped(samples: AxisSamples, axis: NamedAxis) -> AxisSamples:
    """The samples with continuous angles, where the configured one wraps after each turn."""
    turns = turns_of(axis.config)
    if turns is None:
        return samples
    angle, sure = turns.take(samples.block.t_us, samples.block.y)
    block = samples.block._replace(y=angle).select(sure)
    return AxisSamples(block, samples.signal_names, {**samples.dropped, AMBIGUOUS: turns.refused})


def _record(samples: AxisSamples, axis: NamedAxis, name: str) -> Record:
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


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while chunk := file.read(_CHUNK):
                digest.update(chunk)
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}") from None
    return digest.hexdigest()
