"""A time of day starts again at midnight: its record goes on."""

from __future__ import annotations

import math

import numpy as np

from monitor_core.arrays import Floats

_DAY_US = 86_400e6
_NEARLY = 23 / 24
"""Part of a day: a time of day that falls by this much has passed midnight; up to an hour may be missing there."""


class TimeOfDay:
    """Counts the midnights in the times of one table, in blocks."""

    def __init__(self) -> None:
        self._last, self._passed = math.nan, 0.0

    def continuous(self, time_us: Floats) -> Floats:
        """Times (N,) [us] with a day more after each midnight; NaN stays, and times since 1970 are as they were."""
        known = np.isfinite(time_us)
        t = np.concatenate([[self._last], time_us[known]])
        of_day, days = (t >= 0) & (t < _DAY_US), np.diff(t) / _DAY_US
        near = of_day[1:] & of_day[:-1] & (abs(days) > _NEARLY)
        falls = near & (days < 0)
        falls[:-1] &= ~near[1:]  # else the time of a single row is wrong
        passed = self._passed + np.cumsum(falls)
        out = time_us.copy()
        out[known] += _DAY_US * passed
        self._last, self._passed = float(t[-1]), float(passed[-1]) if passed.size else self._passed
        return out
