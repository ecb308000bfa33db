"""The quantities of an axis: their values from a signal on the bus or from a column of a table.

Auxiliary signals are forward-filled: each sample gets the last received value, if that is not too old.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.samples import forward_fill
from service.can.decode_plan import Column
from service.can.decoder import Decoded, Decoder
from service.can.frames import FrameKey
from service.config.schema import AngleConfig, FurtherSignalConfig, SignalConfig
from service.ingest.motion_derivatives import derivative_of


class Quantity(NamedTuple):
    """One quantity of an axis: value = factor * signal + offset.

    The value is in SI units on the motor side, or in the own unit of an auxiliary signal.
    """

    name: str  # "torque", "angle", "speed", "counter" or "signal NAME"
    key: FrameKey
    message: str
    signal: str
    factor: float = 1.0
    offset: float = 0.0
    wrap_period: float | None = None

    def column(self, signals: Mapping[str, Column]) -> Column:
        """The values in SI units."""
        found = signals[self.signal]
        if self.factor == 1 and self.offset == 0:
            return found
        return Column(self.factor * found.values + self.offset, found.present)


def quantity_of(name: str, source: SignalConfig | FurtherSignalConfig, decoder: Decoder) -> Quantity:
    """The quantity in a message of the bus; registers its signal with the decoder.

    Raises:
        DescriptionError: the bus has no such message or signal.
    """
    message, signal = source.message, source.signal
    assert message is not None  # a cross-check of the configuration ensures it
    assert signal is not None
    wrap_period = source.wrap_period if isinstance(source, AngleConfig) else None
    return Quantity(name, decoder.want(message, signal), message, signal, *source.scale, wrap_period)


class HeldSignal:
    """The last value of an auxiliary signal on the bus, with the time of its receipt.

    ``interval_s``: between the samples of the axis.
    """

    def __init__(self, source: FurtherSignalConfig, decoder: Decoder, interval_s: float) -> None:
        self.quantity = quantity_of(f"signal {source.name}", source, decoder)
        self._derivative = derivative_of(source, interval_s)
        self._most_us = source.max_age_s * 1e6
        self._value, self._t_us = math.nan, 0

    def take(self, decoded: Mapping[FrameKey, Decoded], places: Ints, t_us: Ints) -> Floats:
        """The values (N,) for samples completed by the frames at these places of a block; NaN: no value, or too old.

        Args:
            decoded: decoded messages of the block; the last finite value is kept for the next blocks.
            places: positions of frames in the block (N,), increasing; a value in the same frame counts.
            t_us: times of receipt of these frames (N,).
        """
        values, times, since = [self._value], [self._t_us], np.zeros(0, np.int64)
        if (found := decoded.get(self.quantity.key)) is not None:
            raw, column = found.signals[self.quantity.signal], self.quantity.column(found.signals)
            known = np.flatnonzero(raw.present & np.isfinite(raw.values))
            since = found.places[known]
            values += column.values[known].tolist()
            times += found.t_us[known].tolist()
            self._value, self._t_us = values[-1], times[-1]
        last = np.searchsorted(since, places, "right")
        if self._derivative is not None:
            return self._derivative.take(np.array(values[1:]), np.array(times[1:], np.int64), last, t_us)
        age_us = np.abs(t_us - np.array(times, np.int64)[last])
        return np.where(age_us <= self._most_us, np.array(values)[last], math.nan)


class HeldColumns:
    """The auxiliary signals (at least one) in the rows of a table, forward-filled block by block.

    An empty cell gets the value before it.  ``interval_s``: between the samples of the axis.
    """

    def __init__(self, sources: Sequence[FurtherSignalConfig], interval_s: float) -> None:
        self._sources = tuple(sources)
        self._most_us = 1e6 * np.array([source.max_age_s for source in sources])
        found = {k: derivative_of(source, interval_s) for k, source in enumerate(sources)}
        self._derivatives = {k: derivative for k, derivative in found.items() if derivative}
        self._values = self._times = np.full(len(self._sources), np.nan)

    def take(self, time_us: Floats, columns: Mapping[str, Floats]) -> Floats:
        """The signals (N, S) at these rows; NaN: unknown.

        Args:
            time_us: times of the rows (N,) [us]; rows with NaN are ignored.
            columns: columns of these rows (N,), by name.
        """
        raw = np.stack([s.factor * columns[str(s.column)] + s.offset for s in self._sources], axis=1)
        known_us = np.where(np.isfinite(raw), time_us[:, np.newaxis], np.nan)
        values = forward_fill(np.where(np.isfinite(known_us), raw, np.nan), self._values)
        times = forward_fill(known_us, self._times)
        if len(values):
            self._values, self._times = values[-1], times[-1]
        found = np.where(np.abs(time_us[:, np.newaxis] - times) <= self._most_us, values, np.nan)
        for k, derivative in self._derivatives.items():
            known = np.isfinite(raw[:, k]) & np.isfinite(time_us)
            found[:, k] = derivative.take(raw[known, k], time_us[known], np.cumsum(known), time_us)
        return found
