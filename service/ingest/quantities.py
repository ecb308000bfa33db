"""The quantities of an axis: their values from a signal on the bus or from a column of a table.

Auxiliary signals are forward-filled: each sample gets the last received value, if that is not too old.

The acceleration of another axis is that of the parabola that fits five values of its angle best (Savitzky and Golay
1964).  It belongs to the middle of the five, so it is known some intervals later; ``late_values`` assigns it to the
sample of its time.
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


_PARABOLA = tuple(weight / 7 for weight in (2, -1, -2, -1, 2))
"""Second difference of five values, by least squares: that in their middle"""
_MIDDLE = len(_PARABOLA) // 2
ACCELERATION_LATE = _MIDDLE + 1
"""Intervals after which an acceleration is known: the other axis may send after the one that needs it."""
HOLDS = 4.5
"""Intervals by which an acceleration may be off: as many as one lost sample takes away, and the scatter of times."""
_LATE = 0.5
"""Intervals that the values may take longer, or one was lost"""
_KEPT = 8
"""Accelerations among which the one at a time is looked for"""


class Acceleration:
    """Second derivative of a signal by time from five values, of which none was lost."""

    def __init__(self, interval_s: float) -> None:
        before = len(_PARABOLA) - 1
        self._values, self._t_us = np.full(before, np.nan), np.full(before, np.nan)
        self._found, self._middle_us = np.full(_KEPT, np.nan), np.full(_KEPT, np.nan)
        self._interval_s = interval_s

    def take(self, values: Floats, t_us: Floats | Ints, come: Ints, at_us: Floats | Ints) -> Floats:
        """What it was ACCELERATION_LATE intervals before these samples (M,); NaN: not known.

        Args:
            values: of the signal (N,), new ones.
            t_us: when they were received or sampled (N,).
            come: how many of them had come when a sample was complete (M,).
            at_us: when the samples were received or sampled (M,).
        """
        y, t = np.concatenate([self._values, values]), np.concatenate([self._t_us, t_us])
        second = np.zeros(len(values))
        for place, weight in enumerate(_PARABOLA):
            # Sums whose last bit does not depend on the length of the block
            second += weight * y[place : place + len(values)]
        span_s = 1e-6 * (t[len(_PARABOLA) - 1 :] - t[: len(values)])
        known = (span_s >= 0) & (span_s < (len(_PARABOLA) - 1 + _LATE) * self._interval_s)
        found = np.concatenate([self._found, np.where(known, second / self._interval_s**2, np.nan)])
        middle_us = np.concatenate([self._middle_us, t[_MIDDLE : _MIDDLE + len(values)]])
        self._values, self._t_us = y[len(values) :], t[len(values) :]
        self._found, self._middle_us = found[len(values) :], middle_us[len(values) :]
        last = come[:, np.newaxis] + np.arange(_KEPT)
        wanted_us = at_us - 1e6 * ACCELERATION_LATE * self._interval_s
        off_us = np.abs(middle_us[last] - wanted_us[:, np.newaxis])
        off_us[~np.isfinite(found[last])] = np.inf
        nearest, rows = off_us.argmin(axis=1), np.arange(len(come))
        near = off_us[rows, nearest] <= 1e6 * HOLDS * self._interval_s
        return np.where(near, found[last[rows, nearest]], np.nan)


def acceleration_of(source: FurtherSignalConfig, interval_s: float) -> Acceleration | None:
    """Of a signal whose values come at this interval; None: it is no acceleration."""
    return Acceleration(interval_s) if source.acceleration else None


class HeldSignal:
    """The last value of an auxiliary signal on the bus, with the time of its receipt.

    ``interval_s``: between the samples of the axis.
    """

    def __init__(self, source: FurtherSignalConfig, decoder: Decoder, interval_s: float) -> None:
        self.quantity = quantity_of(f"signal {source.name}", source, decoder)
        self._acceleration = acceleration_of(source, interval_s)
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
        if self._acceleration is not None:
            return self._acceleration.take(np.array(values[1:]), np.array(times[1:], np.int64), last, t_us)
        age_us = np.abs(t_us - np.array(times, np.int64)[last])
        return np.where(age_us <= self._most_us, np.array(values)[last], math.nan)


class HeldColumns:
    """The auxiliary signals (at least one) in the rows of a table, forward-filled block by block.

    An empty cell gets the value before it.  ``interval_s``: between the samples of the axis.
    """

    def __init__(self, sources: Sequence[FurtherSignalConfig], interval_s: float) -> None:
        self._sources = tuple(sources)
        self._most_us = 1e6 * np.array([source.max_age_s for source in sources])
        found = {k: acceleration_of(source, interval_s) for k, source in enumerate(sources)}
        self._accelerations = {k: acceleration for k, acceleration in found.items() if acceleration}
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
        for k, acceleration in self._accelerations.items():
            known = np.isfinite(raw[:, k]) & np.isfinite(time_us)
            found[:, k] = acceleration.take(raw[known, k], time_us[known], np.cumsum(known), time_us)
        return found
