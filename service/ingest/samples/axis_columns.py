"""Makes the samples of one axis from the rows of a table."""

from collections.abc import Mapping, Sequence

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock, concatenate
from monitor_core.sampling import DROP_REASONS
from service.can.user_errors import RecordError
from service.config.schema import FurtherSignalConfig, NamedAxis, SignalConfig
from service.ingest.samples.late_values import LateValues
from service.ingest.samples.quantities import HeldColumns
from service.ingest.tables.csv_tables import CsvRows
from service.ingest.tables.time_of_day import TimeOfDay

_AT_ONCE = 65_536
"""Rows whose signals are worked on at once: those of an hour would take several times their memory"""
_LATEST_US = 2.0**62


class AxisColumns:
    """The table columns of one axis and its auxiliary signals, with counts of dropped rows.

    Raises:
        RecordError: the configuration names no column for the torque, the motion or one of these signals.
    """

    def __init__(self, axis: NamedAxis, further: Sequence[FurtherSignalConfig] = ()) -> None:
        axis_id, config = axis.id, axis.config
        if config.torque.column is None or config.motion.column is None:
            missing = "torque" if config.torque.column is None else config.output
            raise RecordError(f"axis {axis_id}: {missing}.column is missing in the configuration")
        for source in axis.coupled:
            if source.column is None:
                raise RecordError(
                    f"axis {axis_id}: {source.name} has no column in the configuration, and coupling adds its motion"
                )
        for source in further:
            if source.column is None:
                raise RecordError(
                    f"axis {axis_id}: the signal {source.name} has no column in the configuration, and the axis depends"
                    " on it"
                )
        self._id, self._config, self._further = axis_id, config, tuple(further)
        self._held = HeldColumns(further, config.sample_interval_s) if further else None
        self._coupled = axis.coupled
        self._torque, self._motion = config.torque.column, config.motion.column
        self._time, self._time_unit_us = config.time.column, 1e6 * config.time.factor
        self._interval_us = config.sample_interval_s * 1e6
        self._last_us: int | None = None
        self._day, self._late = TimeOfDay(), LateValues(config, further, len(axis.coupled))
        self.dropped = dict.fromkeys(DROP_REASONS, 0)

    def wanted(self) -> dict[str, str]:
        """The needed columns, each with its purpose in words."""
        wanted = {str(s.column): f"signal {s.name}" for s in self._further}
        wanted |= {str(s.column): f"coupling with {s.name}" for s in self._coupled}
        wanted |= {self._torque: "torque", self._motion: self._config.output}
        wanted |= {self._time: "time"} if self._time is not None else {}
        return {column: f"the {purpose} of axis {self._id}" for column, purpose in wanted.items()}

    def samples(self, rows: CsvRows, first_row: int, sound: Bools | None = None) -> SampleBlock:
        """Make the samples of these rows; ``first_row``: number of the first row in the file.

        ``sound``: mask of the rows to use (N,); None: all.
        """
        torque, motion = self.quantities(rows)
        time_us = self._times(rows, first_row, len(torque))
        timed = np.abs(time_us) < _LATEST_US
        finite = np.isfinite(torque) & np.isfinite(motion) & timed
        looked_at = np.ones(len(finite), np.bool_) if sound is None else sound
        self.dropped["not_finite"] += int(np.count_nonzero(~finite & looked_at))
        fine = finite & ~self.absurd(torque, motion)
        self.dropped["absurd"] += int(np.count_nonzero(finite & ~fine & looked_at))
        index = np.flatnonzero(fine & looked_at)
        t_us = time_us[index].astype(np.int64)
        later = self._increasing(t_us)
        index = index[later]
        # A row without a sample may still hold an auxiliary signal, such as a temperature in a separate row.
        held_us = np.where(timed & looked_at, time_us, np.nan)
        samples = SampleBlock(t_us[later], torque[index], motion[index])
        parts = []
        for first in range(0, len(time_us), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            own = slice(*np.searchsorted(index, [first, first + _AT_ONCE]))
            columns = {name: column[part] for name, column in rows.columns.items()}
            signals = self._signals(columns, held_us[part], index[own] - first)
            parts.append(self._late.paired(samples.select(own)._replace(signals=signals)))
        self.dropped["unpaired"] = self._late.unpaired
        return concatenate(parts)

    def _signals(self, columns: Mapping[str, Floats], held_us: Floats, index: Ints) -> Floats | None:
        """The auxiliary signals and the coupled motions (M, S) in these rows, ``index`` (M,); None: there are none."""
        signals = self._held.take(held_us, columns)[index] if self._held else None
        if not self._coupled:
            return signals
        # The motion of all axes in a row is of one time; a value of another row would be a sample off.
        coupled = np.stack([_si(s, columns[str(s.column)])[index] for s in self._coupled], axis=1)
        return coupled if signals is None else np.hstack([signals, coupled])

    def quantities(self, rows: CsvRows) -> tuple[Floats, Floats]:
        """Torque and motion in these rows, in SI units."""
        torque = _si(self._config.torque, rows.columns[self._torque])
        return torque, _si(self._config.motion, rows.columns[self._motion])

    def absurd(self, torque: Floats, motion: Floats) -> Bools:
        """Mask of the rows (N,) whose torque or motion is beyond physical limits."""
        limits = PHYSICAL_LIMITS["torque"], PHYSICAL_LIMITS[self._config.output]
        return np.asarray((abs(torque) > limits[0]) | (abs(motion) > limits[1]), np.bool_)

    def _times(self, rows: CsvRows, first_row: int, count: int) -> Floats:
        """Times of the rows, rounded to whole us."""
        if self._time is not None:
            return np.rint(self._day.continuous(rows.columns[self._time] * self._time_unit_us))
        return np.rint(np.arange(first_row, first_row + count, dtype=np.float64) * self._interval_us)

    def _increasing(self, t_us: Ints) -> Bools:
        """Mask of the times later than all before; counts the other times, and missing samples in between."""
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


def _si(source: SignalConfig | FurtherSignalConfig, values: Floats) -> Floats:
    factor, offset = source.scale
    return np.asarray(factor * values + offset, np.float64)
