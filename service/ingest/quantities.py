"""The quantities of an axis: how a value follows from a signal on the bus, or from a column of a table.

Auxiliary signals are held: each sample gets the last received value, if that is not too old.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.samples import forward_fill
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
    return Quantity(
        name, decoder.want(message, signal), message, signal, source.factor, source.offset, wrap_period
    )


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
    """The auxiliary signals (at least one) in the rows of a table, block by block.

    An empty cell has the value before it.
    """

    def __init__(self, sources: Sequence[Source]) -> None:
        self._sources = tuple(sources)
        self._most_us = 1e6 * np.array([source.max_age_s for source in sources])
        self._values = self._times = np.full(len(self._sources), np.nan)

    def take(self, time_us: Floats, columns: Mapping[str, Floats]) -> Floats:
        """The signals (N, S) at these rows; NaN: unknown.

        Args:
            time_us: times of the rows (N,) [us]; rows with NaN are ignored.
            columns: of these rows (N,), by name.
        """
        raw = np.stack([s.factor * columns[str(s.column)] + s.offset for s in self._sources], axis=1)
        known_us = np.where(np.isfinite(raw), time_us[:, np.newaxis], np.nan)
        values = forward_fill(np.where(np.isfinite(known_us), raw, np.nan), self._values)
        times = forward_fill(known_us, self._times)
        if len(values):
            self._values, self._times = values[-1], times[-1]
        return np.where(np.abs(time_us[:, np.newaxis] - times) <= self._most_us, values, np.nan)
