"""Snapshots of axes: status of the monitor, recent history of the estimates, alarms as recorded in the journal."""

import math
from collections.abc import Iterable
from dataclasses import replace

from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisStatus, Status
from service.config import NamedAxis
from service.pipeline.alarms import Alarms
from service.pipeline.frame_pipeline import FramePipeline
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


class AxisView:
    """Snapshots of one axis, from its input, its monitor and the journal."""

    def __init__(
        self, axis: NamedAxis, pipeline: FramePipeline, alarms: Alarms, history: RecentHistory
    ) -> None:
        self._axis, self._pipeline, self._alarms, self._history = axis, pipeline, alarms, history
        self._model = model = pipeline.monitors.by_id[axis.id].model
        self._nominal = {p.name: (model.nominal[p.name], p.unit) for p in model.drive.parameters}

    def snapshot(self) -> AxisSnapshot:
        """Snapshot of the axis now.  Its alarms are those of the journal: no others are shown."""
        axis, drive, monitors = self._axis, self._model.drive, self._pipeline.monitors
        monitor = monitors.by_id[axis.id]
        source = self._pipeline.ingests[axis.config.bus].axes[axis.id]
        status, open_alarms = monitor.status(), self._alarms.open(axis.id)
        self._history.add(status)
        return AxisSnapshot(
            id=axis.id,
            robot=axis.robot,
            name=axis.config.name,
            bus=axis.config.bus,
            drive=drive.name,
            output=drive.output,
            interval_s=axis.config.sample_interval_s,
            nominal=self._nominal,
            status=_as_recorded(status, open_alarms),
            open_alarms=open_alarms,
            dropped={**source.dropped, **monitors.dropped(axis.id)},
            clock=source.events,
            history=self._history.history,
            gated_by=monitors.waits_for(axis.id),
            stamps=source.stamps,
            other_causes=tuple(c for c in monitor.causes if c not in self._model.monitored),
            trends=monitors.trends.for_axis(axis.id),
            histories_lost=monitors.trends.lost[axis.id],
        )


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
