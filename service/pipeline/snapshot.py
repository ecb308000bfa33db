"""Snapshots: the immutable state that API, metrics and page read; the worker replaces it in one assignment."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from monitor_core.detection import Alarm
from monitor_core.drive import AxisModel
from monitor_core.modeling import FlatComponent
from monitor_core.monitoring import AxisStatus, ParameterTrend, Status
from monitor_core.settings import Settings
from monitor_core.wording import sentence
from service.can.bus_reader import BusSnapshot
from service.config import NamedAxis
from service.config.drive_sources import model_of_axis
from service.ingest.timestamp_jitter import NOT_KNOWN, Stamps
from service.pipeline.alarm_recording import NO_ALARMS, Alarms, AlarmsSnapshot
from service.pipeline.axis_monitors import FramePipeline
from service.pipeline.axis_pipeline import AxisPipeline, Heat
from service.pipeline.epoch_progress import FIRST_EPOCH, AxisEpoch
from service.pipeline.history_recording import NO_HISTORY, HistoryRecording, HistoryState
from service.pipeline.trends import Trends
from service.store.alarm_transitions import CONFIGURATION, Note


@dataclass(frozen=True, slots=True)
class MonitoredDrive:
    """What an axis is monitored by; it changes with the configuration and with the epoch only."""

    model: AxisModel
    settings: Settings
    components: tuple[FlatComponent, ...]
    """As the drive was drawn"""


@dataclass(frozen=True, slots=True)
class AxisSnapshot:
    """One axis.  ``id`` is "robot.axis" and identifies it in the API and in the metrics."""

    id: str
    robot: str
    name: str
    bus: str
    drive: str
    """Name of the drive structure, e.g. three-mass"""
    output: str
    """"speed" or "angle": what is measured besides torque"""
    interval_s: float
    """Nominal sample interval [s]"""
    nominal: Mapping[str, tuple[float, str]]
    """All values of the model, by name, with their units"""
    status: AxisStatus
    open_alarms: tuple[Alarm, ...]
    dropped: Mapping[str, int]
    """Values that did not become a sample, by reason (monitor_core.sampling.DROP_REASONS)"""
    clock: Mapping[str, int]
    """How often the time line of the samples restarted, by cause (service.ingest.axis_input.AxisInput.events)"""
    gated_by: str = ""
    """The operating condition by which the last sample was not used, e.g. mode = 2; empty: it was used"""
    outside_calibration: tuple[str, ...] = ()
    """Conditions that are outside the range of its calibration, in words"""
    heat: Heat | None = None
    """How warm it is; None: nothing follows its heat"""
    stamps: Stamps = NOT_KNOWN
    """Jitter of its time stamps"""
    causes: tuple[str, ...] = ()
    """Every cause that an alarm may name: the monitored parameters, then others"""
    trends: tuple[ParameterTrend, ...] = ()
    """The long-term trend of each parameter"""
    histories_lost: int = 0
    """Long-term histories that could not be restored at the start"""
    epoch: AxisEpoch = FIRST_EPOCH
    """Which nominal values are in force, and what is under way"""
    out_of_service: Note | None = None
    """Since when, by whom and why its alarms are not announced; None: they are"""
    watched: MonitoredDrive | None = None
    """Model and settings of its monitor; None: not known"""


GIVE_UP_REASONS = ("age", "refused")
"""Why a link gives a transition up: it could not be delivered for too long; the receiver does not want it."""


@dataclass(frozen=True, slots=True)
class LinkSnapshot:
    """One plant link: whether it works, and transitions of alarms since the start of the daemon."""

    name: str
    kind: str
    """webhook, mqtt, smtp or opcua"""
    connected: bool
    """Whether the last try has succeeded; of a link without a lasting connection also before the first one"""
    problem: str = ""
    """Why it does not work; empty: it does"""
    pending: int = 0
    """Those that wait"""
    delivered: int = 0
    given_up: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(GIVE_UP_REASONS, 0))
    """Those that are given up, by reason"""


@dataclass(frozen=True, slots=True)
class Histogram:
    """Processing time of blocks: upper bounds [s], counts per bucket (not cumulated, one more than bounds), sum."""

    bounds: tuple[float, ...]
    counts: tuple[int, ...]
    total_s: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything at one moment.  ``messages`` are for the operator (e.g. a checkpoint that was quarantined)."""

    taken_us: int
    started_us: int
    axes: tuple[AxisSnapshot, ...]
    buses: tuple[BusSnapshot, ...]
    processing: Histogram
    checkpoint_us: int | None
    messages: tuple[str, ...] = ()
    alarms: AlarmsSnapshot = NO_ALARMS
    """What operators have done about the alarms"""
    history: HistoryState = NO_HISTORY
    """How the history is being written"""

    def axis(self, axis_id: str) -> AxisSnapshot | None:
        """The axis of that id."""
        return next((axis for axis in self.axes if axis.id == axis_id), None)


def out_of_service(axes: Iterable[AxisSnapshot]) -> Iterator[str]:
    """That axes are out of service, for the operator: it must not be forgotten."""
    found = [f"{a.id} ({a.out_of_service.who})" for a in axes if a.out_of_service is not None]
    if found:
        words = "out of service, with alarms that are recorded but not announced: {axes}"
        yield sentence("out of service", words, axes=", ".join(found))


# --- How they are made: status of the monitor, alarms as they are shown ---------------------------------------------


class Reception(NamedTuple):
    """What became of the values of an axis before its samples: as in AxisSnapshot."""

    dropped: Mapping[str, int]
    clock: Mapping[str, int]
    stamps: Stamps


def axis_snapshot(
    axis: AxisPipeline,
    trends: Trends,
    status: AxisStatus,
    open_alarms: tuple[Alarm, ...],
    received: Reception,
    out_of_service: Note | None = None,
    watched: MonitoredDrive | None = None,
) -> AxisSnapshot:
    """What the monitor of an axis, its trends, its alarms and its input show now."""
    named, drive = axis.config, axis.monitor.model.drive
    return AxisSnapshot(
        id=named.id,
        robot=named.robot,
        name=named.config.name,
        bus=named.config.bus,
        drive=drive.name,
        output=drive.output,
        interval_s=named.config.sample_interval_s,
        nominal=axis.nominal,
        status=status,
        open_alarms=open_alarms,
        dropped={**received.dropped, **axis.dropped},
        clock=received.clock,
        gated_by=axis.gated_by,
        outside_calibration=axis.outside_calibration,
        heat=axis.heat,
        stamps=received.stamps,
        causes=axis.causes,
        trends=trends.for_axis(named.id),
        histories_lost=trends.lost[named.id],
        epoch=axis.epoch.shown(status),
        out_of_service=out_of_service,
        watched=watched,
    )


class AxisView:
    """Snapshots of one axis of the daemon."""

    def __init__(
        self, axis: NamedAxis, pipeline: FramePipeline, alarms: Alarms, history: HistoryRecording
    ) -> None:
        self._axis, self._pipeline, self._alarms, self._history = axis, pipeline, alarms, history
        self._monitored = pipeline.monitors.axes[axis.id]
        monitor, components = self._monitored.monitor, model_of_axis(axis.config).components
        self._watched = MonitoredDrive(monitor.model, monitor.settings, components)
        self._by_configuration = Note(0, CONFIGURATION) if axis.config.alarms.out_of_service else None

    def take_point(self) -> None:
        """Give the history a point of the axis, if one is due."""
        axis_id, monitor = self._axis.id, self._monitored.monitor
        if self._history.is_due(axis_id, monitor.time_us):
            self._history.take(axis_id, monitor.status(), bool(self._monitored.gated_by))

    def snapshot(self) -> AxisSnapshot:
        """Snapshot of the axis now."""
        axis, trends = self._axis, self._pipeline.monitors.trends
        source = self._pipeline.ingests[axis.config.bus].axes[axis.id]
        open_alarms = self._alarms.open(axis.id)
        status = _as_recorded(self._monitored.monitor.status(), open_alarms)
        received = Reception(source.dropped, source.events, source.stamps)
        removed = self._alarms.removed(axis.id) or self._by_configuration
        return axis_snapshot(self._monitored, trends, status, open_alarms, received, removed, self._watched)


def _as_recorded(status: AxisStatus, open_alarms: Iterable[Alarm]) -> AxisStatus:
    """The status with the alarms that are shown: the end of an alarm counts when it is recorded."""
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
