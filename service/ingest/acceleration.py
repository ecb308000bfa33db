"""The acceleration of another axis, from its angle.

It is the second derivative of the parabola that fits five values of the angle best (Savitzky and Golay, Analytical
Chemistry 36, 1964).  It belongs to the middle of the five, so it is known some intervals later; ``late_values`` assigns
it to the sample of its time.
"""

import numpy as np

from monitor_core.arrays import Floats, Ints
from service.config.schema import FurtherSignalConfig

_PARABOLA = tuple(weight / 7 for weight in (2, -1, -2, -1, 2))
"""Weights of five values for the second difference in their middle, by least squares."""
_SPAN = len(_PARABOLA) - 1
_MIDDLE = _SPAN // 2
ACCELERATION_LATE = _MIDDLE + 1
"""Intervals until an acceleration is known: two for the later values, one as the other axis may send after this one."""
MAX_ERROR = 4.5
"""Largest difference, in intervals, between the times of an acceleration and of the sample: one lost sample, and the
scatter of the times."""
_MAX_STRETCH = 0.5
"""If the five values take more intervals than this longer than usual, a value was lost."""
_KEPT = 8
"""Number of accelerations among which the one nearest in time is chosen."""


class Acceleration:
    """Second derivative by time of a signal whose values come every ``interval_s``; unknown where a value was lost."""

    def __init__(self, interval_s: float) -> None:
        self._values, self._t_us = np.full(_SPAN, np.nan), np.full(_SPAN, np.nan)
        self._found, self._found_us = np.full(_KEPT, np.nan), np.full(_KEPT, np.nan)
        self._interval_s = interval_s

    def take(self, values: Floats, t_us: Floats | Ints, received: Ints, at_us: Floats | Ints) -> Floats:
        """The accelerations ACCELERATION_LATE intervals before samples (M,); NaN: unknown.

        Args:
            values: new values of the signal (N,).
            t_us: their times (N,).
            received: number of these values that were there when each sample was complete (M,).
            at_us: times of the samples (M,).
        """
        N = len(values)
        y, t = np.concatenate([self._values, values]), np.concatenate([self._t_us, t_us])
        second = np.zeros(N)
        for place, weight in enumerate(_PARABOLA):
            # Summed one by one: the last bit does not depend on the length of the block.
            second += weight * y[place : place + N]
        span_s = 1e-6 * (t[_SPAN:] - t[:N])
        known = (span_s >= 0) & (span_s < (_SPAN + _MAX_STRETCH) * self._interval_s)
        found = np.concatenate([self._found, np.where(known, second / self._interval_s**2, np.nan)])
        found_us = np.concatenate([self._found_us, t[_MIDDLE : _MIDDLE + N]])
        self._values, self._t_us, self._found, self._found_us = y[N:], t[N:], found[N:], found_us[N:]
        latest = received[:, np.newaxis] + np.arange(_KEPT)
        wanted_us = at_us - 1e6 * ACCELERATION_LATE * self._interval_s
        off_us = np.abs(found_us[latest] - wanted_us[:, np.newaxis])
        off_us[~np.isfinite(found[latest])] = np.inf
        nearest, rows = off_us.argmin(axis=1), np.arange(len(received))
        near = off_us[rows, nearest] <= 1e6 * MAX_ERROR * self._interval_s
        return np.where(near, found[latest[rows, nearest]], np.nan)


def acceleration_of(source: FurtherSignalConfig, interval_s: float) -> Acceleration | None:
    """The filter for a signal that is configured as an acceleration; None: it is not."""
    return Acceleration(interval_s) if source.acceleration else None
