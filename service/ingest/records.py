"""Records from files: tables and CAN logs with one interface."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from monitor_core.samples import SampleBlock
from service.can.log_files import LOG_SUFFIXES
from service.can.user_errors import RecordError
from service.config.schema import Config
from service.ingest.bus_samples import Step
from service.ingest.log_record import LogRecord
from service.ingest.table_files import TABLE_SUFFIXES
from service.ingest.table_record import TableRecord
from service.ingest.timestamp_jitter import Stamps

__all__ = ["RECORD_SUFFIXES", "Record", "SampleBlock", "Step", "read_record"]

RECORD_SUFFIXES = (*TABLE_SUFFIXES, *LOG_SUFFIXES)


class Record(Protocol):
    """Samples from a file."""

    path: Path

    def steps(self) -> Iterator[Step]:
        """The samples in order, once.

        Raises:
            RecordError: the file is damaged.
        """

    @property
    def axis_dropped(self) -> Mapping[str, Mapping[str, int]]:
        """Values (CAN logs) or rows (tables) that became no sample so far, by axis and reason."""

    @property
    def bus_dropped(self) -> Mapping[str, Mapping[str, int]]:
        """Frames that yielded nothing so far, by bus and reason."""

    @property
    def axis_events(self) -> Mapping[str, Mapping[str, int]]:
        """How often the time line of an axis restarted, by cause."""

    @property
    def axis_stamps(self) -> Mapping[str, Stamps]:
        """Scatter of the time stamps of each axis, where the record has any."""


def read_record(path: Path, config: Config) -> Record:
    """The record in a file, by its suffix.

    Raises:
        RecordError: it cannot be read, has an unknown suffix or lacks a column.
        DbcError, IngestError: the configuration cannot be used.
    """
    suffix = path.suffix.lower()
    if suffix in TABLE_SUFFIXES:
        return TableRecord(path, config)
    if suffix in LOG_SUFFIXES:
        return LogRecord(path, config)
    raise RecordError(f"{path}: no such kind of record; there is {' '.join(RECORD_SUFFIXES)}")
