"""The quantities of an axis: their values from a signal on the bus or from a column of a table.

Auxiliary signals are forward-filled: each sample gets the last received value, if that is not too old.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from service.can.decode_plan import Column
from service.can.decoder import Decoded, Decoder
from service.can.frames import FrameKey
from service.config.schema import AngleConfig, FurtherSignalConfig, SignalConfig
from service.ingest.samples.motion_derivatives import MotionBeside, derivative_of


class AxisQuantity(NamedTuple):
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


def quantity_of(name: str, source: SignalConfig | FurtherSignalConfig, decoder: Decoder) -> AxisQuantity:
    """The quantity in a message of the bus; registers its signal with the decoder.

    Raises:
        DescriptionError: the bus has no such message or signal.
    """
    message, signal = source.message, source.signal
    assert message is not None  # a cross-check of the configuration ensures it
    assert signal is not None
    wrap_period = source.wrap_period if isinstance(source, AngleConfig) else None
    return AxisQuantity(name, decoder.want(message, signal), message, signal, *source.scale, wrap_period)


class _LastValue:
    """The last value of an auxiliary signal; ``interval_s``: between the samples of the axis."""

    def __init__(self, source: FurtherSignalConfig, interval_s: float) -> None:
        self._derivative = derivative_of(source, interval_s)
        self._most_us = source.max_age_s * 1e6
        self._value = self._t_us = np.array([math.nan])

    def take(self, values: Floats, t_us: Floats | Ints, received: Ints, at_us: Floats | Ints) -> Floats:
        """The values for samples (M,); NaN: no value, or too old.

        Args:
            values: new values (N,), all finite; the last one is kept for the next samples.
            t_us: their times (N,) [us].
            received: number of these values that were there when each sample was complete (M,).
            at_us: times of the samples (M,) [us].
        """
        if self._derivative is not None:
            return self._derivative.take(values, t_us, received, at_us)
        known, known_us = np.concatenate([self._value, values]), np.concatenate([self._t_us, t_us])
        self._value, self._t_us = known[-1:], known_us[-1:]
        return np.where(np.abs(at_us - known_us[received]) <= self._most_us, known[received], math.nan)


class HeldSignal:
    """An auxiliary signal on the bus; ``interval_s``: between the samples of the axis.

    If it is ``coupled`` motion of another axis, its values are those at the sample before.
    """

    def __init__(
        self, source: FurtherSignalConfig, decoder: Decoder, interval_s: float, *, coupled: bool = False
    ) -> None:
        self.quantity = quantity_of(f"{'coupling' if coupled else 'signal'} {source.name}", source, decoder)
        self._held = MotionBeside(interval_s) if coupled else _LastValue(source, interval_s)

    def take(self, decoded: Mapping[FrameKey, Decoded], places: Ints, t_us: Ints) -> Floats:
        """The values (N,) for samples completed by the frames at these places of a block; NaN: no value, or too old.

        Args:
            decoded: decoded messages of the block.
            places: positions of frames in the block (N,), increasing; a value in the same frame counts.
            t_us: times of receipt of these frames (N,).
        """
        if (found := decoded.get(self.quantity.key)) is None:
            return self._held.take(np.zeros(0), np.zeros(0), np.zeros(len(places), np.int64), t_us)
        raw, column = found.signals[self.quantity.signal], self.quantity.column(found.signals)
        known = np.flatnonzero(raw.present & np.isfinite(raw.values))
        received = np.searchsorted(found.places[known], places, "right")
        return self._held.take(column.values[known], found.t_us[known], received, t_us)


class HeldColumns:
    """The auxiliary signals (at least one) in the rows of a table, forward-filled block by block.

    An empty cell gets the value before it.  ``interval_s``: between the samples of the axis.
    """

    def __init__(self, sources: Sequence[FurtherSignalConfig], interval_s: float) -> None:
        self._signals = [(source, _LastValue(source, interval_s)) for source in sources]

    def take(self, time_us: Floats, columns: Mapping[str, Floats]) -> Floats:
        """The signals (N, S) at these rows; NaN: unknown.

        Args:
            time_us: times of the rows (N,) [us]; rows with NaN are ignored.
            columns: columns of these rows (N,), by name.
        """
        found = []
        for source, held in self._signals:
            values = source.factor * columns[str(source.column)] + source.offset
            known = np.isfinite(values) & np.isfinite(time_us)
            found.append(held.take(values[known], time_us[known], np.cumsum(known), time_us))
        return np.stack(found, axis=1)
