"""Makes times of day continuous over midnight."""

import math

import numpy as np

from monitor_core.arrays import Floats

_DAY_US = 86_400e6
_MIDNIGHT_STEP = 23 / 24
"""A time of day that decreases by more than this part of a day has passed midnight; up to an hour may be missing."""


class TimeOfDay:
    """Makes times of day continuous over midnight, for one table, block by block."""

    def __init__(self) -> None:
        self._last, self._passed = math.nan, 0.0

    def continuous(self, time_us: Floats) -> Floats:
        """Times (N,) [us] with a day added after each midnight; NaN and times since 1970 are not changed."""
        known = np.isfinite(time_us)
        t = np.concatenate([[self._last], time_us[known]])
        of_day, days = (t >= 0) & (t < _DAY_US), np.diff(t) / _DAY_US
        near = of_day[1:] & of_day[:-1] & (abs(days) > _MIDNIGHT_STEP)
        falls = near & (days < 0)
        falls[:-1] &= ~near[1:]  # if it jumps back at once, the time of a single row is wrong
        passed = self._passed + np.cumsum(falls)
        out = time_us.copy()
        out[known] += _DAY_US * passed
        self._last, self._passed = float(t[-1]), float(passed[-1]) if passed.size else self._passed
        return out
