"""The quantities of an axis: how a value follows from a signal on the bus, or from a column of a table.

Auxiliary signals are held: each sample gets the last received value, if that is not too old.  The acceleration of
another axis is that of the parabola which fits the last values of its angle best (Savitzky and Golay 1964).
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

    def column(self, signals: Mapping[str, Column]) -> Column:
        """The values in SI units."""
        found = signals[self.signal]
        if self.factor == 1 and self.offset == 0:
            return found
        return Column(self.factor * found.values + self.offset, found.present)


def quantity_of(name: str, source: SignalConfig | FurtherSignalConfig, decoder: Decoder) -> Quantity:
    """The quantity in a message of the bus, which the decoder decodes from now on.

    Raises:
        DescriptionError: the bus has no such message or signal.
    """
    message, signal = source.message, source.signal
    assert message is not None  # a cross-check of the configuration ensures it
    assert signal is not None
    wrap_period = source.wrap_period if isinstance(source, AngleConfig) else None
    return Quantity(name, decoder.want(message, signal), message, signal, *source.scale, wrap_period)


_PARABOLA = tuple(weight / 7 for weight in (2, -1, -2, -1, 2))
"""Second difference of five values, by least squares."""
_LATE = 0.5
"""Intervals that they may take longer, or one was lost."""
_STILL_ACCELERATES = 3.0
"""Intervals for which an acceleration is believed where samples are lost."""


class Acceleration:
    """Second derivative of a signal by time from its last five values, of which none was lost."""

    def __init__(self, interval_s: float) -> None:
        before = len(_PARABOLA) - 1
        self._values, self._t_us = np.full(before, np.nan), np.full(before, np.nan)
        self._interval_s = interval_s

    def take(self, values: Floats, t_us: Floats | Ints) -> Floats:
        """For each of these values (N,), received or sampled at these times (N,); NaN: not known."""
        y, t = np.concatenate([self._values, values]), np.concatenate([self._t_us, t_us])
        self._values, self._t_us = y[len(values) :], t[len(values) :]
        found = np.zeros(len(values))
        for place, weight in enumerate(
            _PARABOLA
        ):  # sums whose last bit does not depend on the length of the block
            found += weight * y[place : place + len(values)]
        span_s = 1e-6 * (t[len(_PARABOLA) - 1 :] - t[: len(values)])
        known = (span_s >= 0) & (span_s < (len(_PARABOLA) - 1 + _LATE) * self._interval_s)
        return np.where(known, found / self._interval_s**2, np.nan)


def acceleration_of(source: FurtherSignalConfig, interval_s: float) -> Acceleration | None:
    """Of a signal whose values come at this interval; None: it is no acceleration."""
    return Acceleration(interval_s) if source.acceleration else None


def _most_s(source: FurtherSignalConfig, interval_s: float) -> float:
    """How old a value may be that is still believed."""
    return min(source.max_age_s, _STILL_ACCELERATES * interval_s) if source.acceleration else source.max_age_s


class HeldSignal:
    """The last value of an auxiliary signal on the bus, with the time of its receipt.

    ``interval_s``: between the samples of the axis.
    """

    def __init__(self, source: FurtherSignalConfig, decoder: Decoder, interval_s: float) -> None:
        self.quantity = quantity_of(f"signal {source.name}", source, decoder)
        self._acceleration = acceleration_of(source, interval_s)
        self._most_us = _most_s(source, interval_s) * 1e6
        self._value, self._t_us = math.nan, 0

    def take(self, decoded: Mapping[FrameKey, Decoded], places: Ints, t_us: Ints) -> Floats:
        """The values (N,) for samples completed by the frames at these places of a block; NaN: none, or too old.

        Args:
            decoded: of the block; its last value that is a number is kept for the blocks to come.
            places: of frames in the block (N,), increasing; a value in the very frame counts.
            t_us: when they were received (N,).
        """
        values, times, since = [self._value], [self._t_us], np.zeros(0, np.int64)
        if (found := decoded.get(self.quantity.key)) is not None:
            raw, column = found.signals[self.quantity.signal], self.quantity.column(found.signals)
            known = np.flatnonzero(raw.present & np.isfinite(raw.values))
            received = column.values[known]
            if self._acceleration is not None:
                received = self._acceleration.take(received, found.t_us[known])
                known, received = known[np.isfinite(received)], received[np.isfinite(received)]
            since = found.places[known]
            values += received.tolist()
            times += found.t_us[known].tolist()
            self._value, self._t_us = values[-1], times[-1]
        last = np.searchsorted(since, places, "right")
        age_us = np.abs(t_us - np.array(times, np.int64)[last])
        return np.where(age_us <= self._most_us, np.array(values)[last], math.nan)


class HeldColumns:
    """The auxiliary signals (at least one) in the rows of a table, block by block.

    An empty cell has the value before it.  ``interval_s``: between the samples of the axis.
    """

    def __init__(self, sources: Sequence[FurtherSignalConfig], interval_s: float) -> None:
        self._sources = tuple(sources)
        self._most_us = 1e6 * np.array([_most_s(source, interval_s) for source in sources])
        found = {k: acceleration_of(source, interval_s) for k, source in enumerate(sources)}
        self._accelerations = {k: acceleration for k, acceleration in found.items() if acceleration}
        self._values = self._times = np.full(len(self._sources), np.nan)

    def take(self, time_us: Floats, columns: Mapping[str, Floats]) -> Floats:
        """The signals (N, S) at these rows; NaN: unknown.

        Args:
            time_us: times of the rows (N,) [us]; rows with NaN are ignored.
            columns: of these rows (N,), by name.
        """
        raw = np.stack([s.factor * columns[str(s.column)] + s.offset for s in self._sources], axis=1)
        for k, acceleration in self._accelerations.items():
            known = np.isfinite(raw[:, k]) & np.isfinite(time_us)
            raw[known, k] = acceleration.take(raw[known, k], time_us[known])
        known_us = np.where(np.isfinite(raw), time_us[:, np.newaxis], np.nan)
        values = forward_fill(np.where(np.isfinite(known_us), raw, np.nan), self._values)
        times = forward_fill(known_us, self._times)
        if len(values):
            self._values, self._times = values[-1], times[-1]
        return np.where(np.abs(time_us[:, np.newaxis] - times) <= self._most_us, values, np.nan)
