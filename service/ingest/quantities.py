"""The quantities of an axis: how a value follows from a signal on the bus, or from a column of a table.

Auxiliary signals are held: each sample gets the last received value, if that is not too old.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from service.can.dbc import Decoder
from service.can.frames import FrameKey
from service.config.schema import AngleConfig, SignalConfig, Source


class Quantity(NamedTuple):
    """One value of an axis: value = factor * signal + offset.

    SI on the motor side; auxiliary signals in their own unit.
    """

    name: str  # "torque", "angle", "speed", "counter" or "signal NAME"
    key: FrameKey
    message: str
    signal: str
    factor: float = 1.0
    offset: float = 0.0
    wrap_period: float | None = None

    def value(self, signals: Mapping[str, float]) -> float | None:
        """The value in SI units; None where a multiplexed signal is absent."""
        signal = signals.get(self.signal)
        return None if signal is None else self.factor * signal + self.offset


def quantity_of(name: str, source: SignalConfig | Source, decoder: Decoder) -> Quantity:
    """The quantity in a message of the bus, which the decoder decodes from now on.

    Raises:
        DbcError: the DBC has no such message or signal.
    """
    message, signal = source.message, source.signal
    assert message is not None  # a cross-check of the configuration ensures it
    assert signal is not None
    wrap_period = source.wrap_period if isinstance(source, AngleConfig) else None
    return Quantity(name, decoder.want(message, signal), message, signal, source.factor, source.offset, wrap_period)


class HeldSignal:
    """The last value of an auxiliary signal on the bus, with the time of its receipt."""

    def __init__(self, source: Source, decoder: Decoder) -> None:
        self.quantity = quantity_of(f"signal {source.name}", source, decoder)
        self._most_us = source.max_age_s * 1e6
        self._value, self._t_us = math.nan, 0

    def take(self, t_us: int, signals: Mapping[str, float]) -> None:
        """Keep the value in these signals, if there is one that is a number."""
        value = self.quantity.value(signals)
        if value is not None and math.isfinite(signals[self.quantity.signal]):
            self._value, self._t_us = value, t_us

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
