"""Snapshots of axes: status of the monitor, recent history of the estimates, alarms as recorded in the journal."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisMonitor, AxisStatus, Status
from service.config import NamedAxis
from service.ingest.timestamp_jitter import Stamps
from service.pipeline.snapshot import AxisSnapshot, History, HistoryPoint

_CHUNK = 60


class RecentHistory:
    """Estimates of an axis, one point in each interval of its sample time."""

    def __init__(self, interval_s: float, length_s: float) -> None:
        self._interval_us = round(interval_s * 1e6)
        # The oldest chunk is dropped as a whole: one more, so that the length is covered at any time.
        self._chunks = math.ceil(length_s / interval_s / _CHUNK) + 1
        self._last_us: int | None = None
        self.history = History()

    def add(self, status: AxisStatus) -> None:
        """Append the newest status of the axis, if a point is due."""
        t = status.time_us
        # A clock that was set back leaves no gap of that length.
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


@dataclass(frozen=True)
class AxisView:
    """An axis and the sources of its snapshots."""

    axis: NamedAxis
    monitor: AxisMonitor
    history: RecentHistory
    nominal: Mapping[str, tuple[float, str]]

    def snapshot(
        self,
        open_alarms: tuple[Alarm, ...],
        dropped: Mapping[str, int],
        clock: Mapping[str, int],
        gated_by: str,
        stamps: Stamps,
    ) -> AxisSnapshot:
        """Snapshot of the axis now.  ``open_alarms`` are those of the journal: no others are shown."""
        status = self.monitor.status()
        self.history.add(status)
        drive = self.monitor.model.drive
        return AxisSnapshot(
            id=self.axis.id,
            robot=self.axis.robot,
            name=self.axis.config.name,
            bus=self.axis.config.bus,
            drive=drive.name,
            output=drive.output,
            interval_s=self.axis.config.sample_interval_s,
            nominal=self.nominal,
            status=_as_recorded(status, open_alarms),
            open_alarms=open_alarms,
            dropped=dropped,
            clock=clock,
            history=self.history.history,
            gated_by=gated_by,
            stamps=stamps,
            other_causes=tuple(c for c in self.monitor.causes if c not in self.monitor.model.monitored),
        )


def axis_view(axis: NamedAxis, monitor: AxisMonitor, interval_s: float, length_s: float) -> AxisView:
    """The view of an axis with an empty history of that interval and length."""
    model = monitor.model
    nominal = {p.name: (model.nominal[p.name], p.unit) for p in model.drive.parameters}
    return AxisView(axis, monitor, RecentHistory(interval_s, length_s), nominal)


def _as_recorded(status: AxisStatus, open_alarms: Iterable[Alarm]) -> AxisStatus:
    """The status with the alarms of the journal, where the monitor is ahead of the journal."""
    recorded = {e.parameter for e in open_alarms if e.kind != "forecast"}
    if all((p.status is Status.ALARM) == (p.name in recorded) for p in status.parameters):
        return status
    return replace(
        status,
        parameters=tuple(replace(p, status=_status(p.status, p.name in recorded)) for p in status.parameters),
    )


def _status(status: Status, recorded: bool) -> Status:
    if recorded:
        return Status.ALARM
    return Status.TRACKING if status is Status.ALARM else status
