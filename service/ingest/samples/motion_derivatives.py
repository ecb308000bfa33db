"""Speed and acceleration of an axis as signals, from its angle.

They are the derivatives of the parabola that fits the values of the angle around a time best (Savitzky and Golay,
Analytical Chemistry 36, 1964): those within 8 ms on either side, two at least.  With fewer at a short interval, the
steps of an encoder would be a large acceleration.  They belong to the middle, so they are known some intervals later;
``late_values`` assigns them to the sample of their time.
"""

from typing import Literal

import numpy as np

from monitor_core.arrays import Floats, Ints
from service.config.schema import FurtherSignalConfig

_HALF_S, _LEAST_HALF = 0.008, 2
"""Half of the time over which a derivative is taken, and its least length in intervals"""
MAX_ERROR = 4.5
"""Largest difference, in intervals, between the times of a derivative and of the sample: one lost sample, and the
scatter of the times."""
_MAX_STRETCH = 0.5
"""If the values take more intervals than this longer than usual, a value was lost."""
_BESIDE = 0.75
"""Longest time, in intervals, between a sample and the motion of another axis that belongs to it: half an interval, and
the scatter of the times.  Another value would be a sample off."""
_KEPT = 8
"""Number of values among which the one nearest in time is chosen."""


def derivative_late(interval_s: float) -> int:
    """Intervals until a derivative is known: for the later values, and one as another axis may send after this one."""
    return _half(interval_s) + 1


def _half(interval_s: float) -> int:
    return max(_LEAST_HALF, round(_HALF_S / interval_s))


def _weights(order: Literal[1, 2], half: int) -> list[float]:
    """Weights of 2 half + 1 values for the first or second difference in their middle, by least squares."""
    k = np.arange(-half, half + 1.0)
    powers = k**order - np.mean(k**order)
    return [float(weight) for weight in order * powers / (powers @ k**order)]


class MotionDerivative:
    """First or second derivative by time of an angle whose values come every ``interval_s``.

    It is unknown where a value was lost.
    """

    def __init__(self, order: Literal[1, 2], interval_s: float) -> None:
        half = _half(interval_s)
        self._weights, self._unit = _weights(order, half), interval_s**order
        self._half, self._late = half, derivative_late(interval_s)
        self._values, self._t_us = np.full(2 * half, np.nan), np.full(2 * half, np.nan)
        self._found, self._found_us = np.full(_KEPT, np.nan), np.full(_KEPT, np.nan)
        self._interval_s = interval_s

    def take(self, values: Floats, t_us: Floats | Ints, received: Ints, at_us: Floats | Ints) -> Floats:
        """The derivatives ``derivative_late`` intervals before samples (M,); NaN: unknown.

        Args:
            values: new values of the signal (N,).
            t_us: their times (N,).
            received: number of these values that were there when each sample was complete (M,).
            at_us: times of the samples (M,).
        """
        N = len(values)
        y, t = np.concatenate([self._values, values]), np.concatenate([self._t_us, t_us])
        difference = np.zeros(N)
        for place, weight in enumerate(self._weights):
            # Summed one by one: the last bit does not depend on the length of the block.
            difference += weight * y[place : place + N]
        span = 2 * self._half
        span_s = 1e-6 * (t[span:] - t[:N])
        known = (span_s >= 0) & (span_s < (span + _MAX_STRETCH) * self._interval_s)
        found = np.concatenate([self._found, np.where(known, difference / self._unit, np.nan)])
        found_us = np.concatenate([self._found_us, t[self._half : self._half + N]])
        self._values, self._t_us, self._found, self._found_us = y[N:], t[N:], found[N:], found_us[N:]
        wanted_us = np.asarray(at_us, np.float64) - 1e6 * self._late * self._interval_s
        return _nearest(found, found_us, received, wanted_us, 1e6 * MAX_ERROR * self._interval_s)


class MotionBeside:
    """The motion of another axis at the time of the sample before: the value that is received nearest to that sample.

    Of two axes whose values a controller sends together, either may be sent first.
    """

    def __init__(self, interval_s: float) -> None:
        self._most_us = 1e6 * _BESIDE * interval_s
        self._values, self._t_us, self._at_us = np.full(_KEPT, np.nan), np.full(_KEPT, np.nan), np.full(1, np.nan)

    def take(self, values: Floats, t_us: Floats | Ints, received: Ints, at_us: Floats | Ints) -> Floats:
        """The values at the sample before each of these (M,); NaN: unknown.  Arguments as of MotionDerivative."""
        known, known_us = np.concatenate([self._values, values]), np.concatenate([self._t_us, t_us])
        times_us: Floats = np.concatenate([self._at_us, np.asarray(at_us, np.float64)])
        self._values, self._t_us, self._at_us = known[-_KEPT:], known_us[-_KEPT:], times_us[-1:]
        return _nearest(known, known_us, received, times_us[:-1], self._most_us)


def _nearest(found: Floats, found_us: Floats, received: Ints, wanted_us: Floats, most_us: float) -> Floats:
    """Of the last values that were there, those nearest to these times (M,); NaN: none is within ``most_us``.

    ``found``: ``_KEPT`` earlier values, then N new ones.  ``received``: number of the new ones that were there (M,).
    """
    latest = received[:, np.newaxis] + np.arange(_KEPT)
    off_us = np.abs(found_us[latest] - wanted_us[:, np.newaxis])
    off_us[~np.isfinite(off_us) | ~np.isfinite(found[latest])] = np.inf
    nearest, rows = off_us.argmin(axis=1), np.arange(len(received))
    return np.where(off_us[rows, nearest] <= most_us, found[latest[rows, nearest]], np.nan)


def derivative_of(source: FurtherSignalConfig, interval_s: float) -> MotionDerivative | None:
    """The filter for a signal that is configured as a speed or an acceleration; None: it is neither."""
    if not source.is_derivative:
        return None
    return MotionDerivative(2 if source.acceleration else 1, interval_s)
