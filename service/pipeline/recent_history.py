"""The course of the estimates of an axis, one point each interval of its own time."""

import math

from monitor_core.monitoring.axis_status import AxisStatus
from service.pipeline.snapshot import History, HistoryPoint

_CHUNK = 60


class HistoryKeeper:
    """Appends the newest status to the history where a point is due."""

    def __init__(self, interval_s: float, length_s: float) -> None:
        self._interval_us = round(interval_s * 1e6)
        # The oldest chunk goes as a whole: one more, so that the length is there at any time.
        self._chunks = math.ceil(length_s / interval_s / _CHUNK) + 1
        self._last_us: int | None = None
        self.history = History()

    def add(self, status: AxisStatus) -> None:
        """Take the newest status of the axis."""
        t = status.time_us
        # A clock that was set back leaves no hole of that length.
        if t is None or (self._last_us is not None and abs(t - self._last_us) < self._interval_us):
            return
        self._last_us = t
        self.history = self.history.append(_point(t, status), _CHUNK, self._chunks)


def _point(t_us: int, status: AxisStatus) -> HistoryPoint:
    ps = status.parameters
    return HistoryPoint(
        time_us=t_us,
        estimates=tuple(p.estimate for p in ps),
        standard_deviations=tuple(p.standard_deviation for p in ps),
        g_up=tuple(p.g_up for p in ps),
        g_down=tuple(p.g_down for p in ps),
        nominals=tuple(p.nominal for p in ps),
    )
