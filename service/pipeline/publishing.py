"""Snapshots of the monitors, the buses and the alarms."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from monitor_core.detection.alarm import Alarm
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.monitoring.axis_status import AxisStatus, Status
from service.config import NamedAxis
from service.ingest.timestamp_jitter import Stamps
from service.pipeline.recent_history import HistoryKeeper
from service.pipeline.snapshot import AxisSnapshot


@dataclass(frozen=True)
class AxisView:
    """An axis with what its snapshots are made of."""

    axis: NamedAxis
    monitor: AxisMonitor
    history: HistoryKeeper
    nominal: Mapping[str, tuple[float, str]]

    def snapshot(
        self,
        open_alarms: tuple[Alarm, ...],
        dropped: Mapping[str, int],
        clock: Mapping[str, int],
        gated_by: str,
        stamps: Stamps,
    ) -> AxisSnapshot:
        """The axis now.  ``open_alarms`` are those of the journal, and the only ones shown."""
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
    return AxisView(axis, monitor, HistoryKeeper(interval_s, length_s), nominal)


def _as_recorded(status: AxisStatus, open_alarms: Iterable[Alarm]) -> AxisStatus:
    """The status with the alarms of the journal, where the monitor is ahead of it."""
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
