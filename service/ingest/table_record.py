"""A table as a record: its columns become samples of the axes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock
from service.can.user_errors import RecordError
from service.config.conditions import needed
from service.config.schema import AxisConfig, Config
from service.config.schema_signals import SignalConfig, Source
from service.ingest.assemble import REASONS
from service.ingest.auxiliary_signals import HeldColumns
from service.ingest.bus_samples import Step
from service.ingest.rows import Floats, Rows
from service.ingest.table_files import check_columns, open_table
from service.ingest.timestamp_jitter import Stamps

Times = NDArray[np.int64]
_LATEST_US = 2.0**62


class TableRecord:
    """A .csv, .parquet or .mat file with the columns named in the configuration.

    Axes without columns in the configuration are ignored.

    Raises:
        RecordError: the file cannot be read, or lacks a column.
    """

    def __init__(self, path: Path, config: Config) -> None:
        self.path = path
        self._table = open_table(path)
        axes = [axis for axis in config.axes if _has_columns(axis.config)]
        self._axes = {axis.id: AxisColumns(axis.id, axis.config, needed(axis)) for axis in axes}
        if not self._axes:
            raise RecordError(
                f"{path}: no axis says where it is in a table: set torque.column and angle.column or "
                "speed.column in the configuration"
            )
        self._wanted: dict[str, str] = {}
        for columns in self._axes.values():
            self._wanted |= columns.wanted()
        check_columns(path, self._table, self._wanted)

    @property
    def bus_dropped(self) -> Mapping[str, Mapping[str, int]]:
        """Frames dropped, by bus: a table has none."""
        return {}

    @property
    def axis_dropped(self) -> Mapping[str, Mapping[str, int]]:
        """Rows that became no sample, by axis and reason."""
        return {axis_id: dict(columns.dropped) for axis_id, columns in self._axes.items()}

    @property
    def axis_events(self) -> Mapping[str, Mapping[str, int]]:
        """Restarts of the time line: a table has none."""
        return {}

    @property
    def axis_stamps(self) -> Mapping[str, Stamps]:
        """Time stamps of receipt: a table has none."""
        return {}

    def steps(self) -> Iterator[Step]:
        """The samples in order.

        Raises:
            RecordError: a cell is no number, or the file is damaged.
        """
        first_row = 0
        for rows in self._table.rows(list(self._wanted)):
            samples = {axis_id: axis.samples(rows, first_row) for axis_id, axis in self._axes.items()}
            first_row += len(next(iter(rows.columns.values())))
            yield Step({axis_id: block for axis_id, block in samples.items() if len(block.t_us)}, rows.done)


def _has_columns(config: AxisConfig) -> bool:
    return config.torque.column is not None or config.motion.column is not None


class AxisColumns:
    """The columns of one axis and its auxiliary signals, and the counts of its dropped rows.

    Raises:
        RecordError: the configuration does not name the column of the torque, the motion or one of these signals.
    """

    def __init__(self, axis_id: str, config: AxisConfig, further: Sequence[Source] = ()) -> None:
        if config.torque.column is None or config.motion.column is None:
            missing = "torque" if config.torque.column is None else config.output
            raise RecordError(f"axis {axis_id}: {missing}.column is missing in the configuration")
        for source in further:
            if source.column is None:
                raise RecordError(
                    f"axis {axis_id}: the signal {source.name} has no column in the configuration, and the axis depends"
                    " on it"
                )
        self._id, self._config, self._further = axis_id, config, tuple(further)
        self._held = HeldColumns(further) if further else None
        self._torque, self._motion, self._time = (
            config.torque.column,
            config.motion.column,
            config.time.column,
        )
        self._interval_us = config.sample_interval_s * 1e6
        self._last_us: int | None = None
        self.dropped = dict.fromkeys(REASONS, 0)

    def wanted(self) -> dict[str, str]:
        """The purpose of each column."""
        wanted = {
            self._torque: f"the torque of axis {self._id}",
            self._motion: f"the {self._config.output} of axis {self._id}",
        }
        wanted |= {self._time: f"the time of axis {self._id}"} if self._time is not None else {}
        return {str(s.column): f"the signal {s.name} of axis {self._id}" for s in self._further} | wanted

    def samples(self, rows: Rows, first_row: int) -> SampleBlock:
        """The samples in these rows, the first of which has that number in the file."""
        return self.chosen(rows, first_row)[1]

    def chosen(
        self, rows: Rows, first_row: int, sound: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.int64], SampleBlock]:
        """Indices of the rows that became samples, and the samples; rows that are not ``sound`` are ignored."""
        torque, motion = self.quantities(rows)
        time_us = self._times(rows, first_row, len(torque))
        timed = np.abs(time_us) < _LATEST_US
        finite = np.isfinite(torque) & np.isfinite(motion) & timed
        looked_at = np.ones(len(finite), np.bool_) if sound is None else sound
        self.dropped["not_finite"] += int(np.count_nonzero(~finite & looked_at))
        fine = finite & (abs(torque) <= PHYSICAL_LIMITS["torque"]) & (abs(motion) <= PHYSICAL_LIMITS["angle"])
        self.dropped["absurd"] += int(np.count_nonzero(finite & ~fine & looked_at))
        index = np.flatnonzero(fine & looked_at)
        t_us = time_us[index].astype(np.int64)
        later = self._increasing(t_us)
        index = index[later]
        # A row without a sample may still hold a signal, such as a temperature in a row of its own.
        held = self._held.take(np.where(timed, time_us, np.nan), rows.columns) if self._held else None
        signals = None if held is None else held[index]
        return index, SampleBlock(t_us[later], torque[index], motion[index], signals=signals)

    def quantities(self, rows: Rows) -> tuple[Floats, Floats]:
        """Torque and motion in these rows, in SI units."""
        torque = _si(self._config.torque, rows.columns[self._torque])
        return torque, _si(self._config.motion, rows.columns[self._motion])

    def _times(self, rows: Rows, first_row: int, count: int) -> Floats:
        """Times [us], rounded once to whole ones."""
        if self._time is not None:
            return np.rint(rows.columns[self._time] * 1e6)
        return np.rint(np.arange(first_row, first_row + count, dtype=np.float64) * self._interval_us)

    def _increasing(self, t_us: Times) -> NDArray[np.bool_]:
        """Which times are later than all before; counts the others, and the missing samples in between."""
        if not len(t_us):
            return np.zeros(0, np.bool_)
        before = np.iinfo(np.int64).min if self._last_us is None else self._last_us
        latest = np.maximum.accumulate(np.concatenate(([before], t_us)))
        later = t_us > latest[:-1]
        self.dropped["repeated"] += int(np.count_nonzero(t_us == latest[:-1]))
        self.dropped["out_of_order"] += int(np.count_nonzero(t_us < latest[:-1]))
        kept = t_us[later] if self._last_us is None else np.concatenate(([before], t_us[later]))
        lost = np.rint(np.diff(kept) / self._interval_us) - 1
        self.dropped["missing"] += int(np.sum(np.maximum(lost, 0)))
        self._last_us = int(latest[-1])
        return np.asarray(later, np.bool_)


def _si(source: SignalConfig, values: Floats) -> Floats:
    return np.asarray(source.factor * values + source.offset, np.float64)
