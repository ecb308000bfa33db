"""Auxiliary signals of an axis: each sample gets the last received value, if that is not too old."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from service.can.decode import FrameKey
from service.config.schema_signals import Source
from service.ingest.rows import Floats


class HeldSignal:
    """The last value of one signal on the bus, with the time of its receipt."""

    def __init__(self, source: Source, key: FrameKey) -> None:
        assert source.message is not None  # a cross-check ensures it
        assert source.signal is not None
        self.name, self.key = source.name, key
        self.message, self.signal = source.message, source.signal
        self.factor, self.offset = source.factor, source.offset
        self._most_us = source.max_age_s * 1e6
        self._value, self._t_us = math.nan, 0

    def take(self, t_us: int, signals: Mapping[str, float]) -> None:
        """Keep the value in these signals, if there is one that is a number."""
        raw = signals.get(self.signal)
        if raw is not None and math.isfinite(raw):
            self._value, self._t_us = self.factor * raw + self.offset, t_us

    def at(self, t_us: int) -> float:
        """The value for a sample received at that time; NaN: there was none, or it is too old."""
        return self._value if abs(t_us - self._t_us) <= self._most_us else math.nan


class HeldColumns:
    """The auxiliary signals in the rows of a table, block by block; an empty cell has the value before it."""

    def __init__(self, sources: Sequence[Source]) -> None:
        self._sources = tuple(sources)
        self._before = [(math.nan, 0.0)] * len(self._sources)

    def take(self, time_us: Floats, columns: Mapping[str, Floats]) -> Floats:
        """The signals (N, S) at these rows; NaN: unknown.

        Args:
            time_us: times of the rows (N,) [us]; rows with NaN are ignored.
            columns: of these rows (N,), by name.
        """
        values = np.empty((len(time_us), len(self._sources)))
        for k, source in enumerate(self._sources):
            raw = source.factor * columns[str(source.column)] + source.offset
            values[:, k] = self._held(k, time_us, raw, source.max_age_s * 1e6)
        return values

    def _held(self, k: int, time_us: Floats, raw: Floats, most_us: float) -> Floats:
        value, since = self._before[k]
        known = np.isfinite(raw) & np.isfinite(time_us)
        # Index of the row, or of the last known one before it; 0: in an earlier block.
        place = np.maximum.accumulate(np.where(known, np.arange(1, len(raw) + 1), 0))
        values, times = np.append(value, raw)[place], np.append(since, time_us)[place]
        if len(raw):
            self._before[k] = float(values[-1]), float(times[-1])
        return np.where(np.abs(time_us - times) <= most_us, values, math.nan)
