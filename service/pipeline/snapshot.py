"""The immutable snapshot that API, metrics and page read; the worker replaces it in one assignment."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from monitor_core.detection import Alarm
from monitor_core.drive import Output
from monitor_core.monitoring import AxisStatus, NotTested, ParameterTrend, Status
from monitor_core.wording import sentence
from service.can.bus_reader import BusSnapshot
from service.config import NamedAxis
from service.config.certificates import Expiry
from service.ingest.samples.timestamp_jitter import NOT_KNOWN, Stamps
from service.pipeline.axes.axis_monitors import FramePipeline
from service.pipeline.axes.axis_pipeline import AxisPipeline, Heat, MonitoredDrive
from service.pipeline.axes.epoch_progress import FIRST_EPOCH, AxisEpoch
from service.pipeline.axes.trends import Trends
from service.pipeline.persistence.alarm_recording import NO_ALARMS, AlarmRecorder, AlarmsSnapshot
from service.pipeline.persistence.history_recording import NO_HISTORY, HistoryRecording, HistoryState
from service.store.alarm_transitions import CONFIGURATION, Note


@dataclass(frozen=True, slots=True)
class AxisSnapshot:
    """One axis at one moment.  ``id`` is "robot.axis" and identifies the axis in the API and in the metrics."""

    id: str
    robot: str
    name: str
    bus: str
    drive: str
    """Name of the drive structure, e.g. three-mass"""
    output: Output
    """What is measured besides torque"""
    interval_s: float
    """Nominal sample interval [s]"""
    nominal: Mapping[str, tuple[float, str]]
    """All nominal values of the model and their units, by name"""
    status: AxisStatus
    open_alarms: tuple[Alarm, ...]
    dropped: Mapping[str, int]
    """Values that did not become a sample, by reason (monitor_core.sampling.DROP_REASONS)"""
    clock: Mapping[str, int]
    """How often the time axis of the samples restarted, by cause: see AxisInput.events of service.ingest"""
    gated_by: str = ""
    """The operating condition that kept the last sample from being used, e.g. mode = 2; empty: it was used"""
    outside_calibration: tuple[str, ...] = ()
    """Operating conditions outside the range of the calibration, in words"""
    heat: Heat | None = None
    """Warm-up state; None: the axis has no thermal model"""
    stamps: Stamps = NOT_KNOWN
    """Jitter of the time stamps"""
    causes: tuple[str, ...] = ()
    """Every cause that an alarm may name: the monitored parameters, then others"""
    trends: tuple[ParameterTrend, ...] = ()
    """The long-term trend of each parameter"""
    histories_lost: int = 0
    """Long-term histories that could not be restored at the start"""
    epoch: AxisEpoch = FIRST_EPOCH
    """The epoch in force, and the progress of a learning or verification window"""
    out_of_service: Note | None = None
    """Author, time and reason of taking the axis out of service, when its alarms are not announced; None: in service"""
    watched: MonitoredDrive | None = None
    """Model and settings of the monitor; None: not known"""
    silent_since_us: int | None = None
    """Since when its samples have stopped, by the present clock of the machine; None: they come, or never have"""


GIVE_UP_REASONS = ("age", "refused")
"""Why a link gives up a transition: it could not be delivered for too long ("age"), or the receiver refuses it."""


@dataclass(frozen=True, slots=True)
class LinkSnapshot:
    """One plant link: whether it works, and its counts of alarm transitions since the start of the daemon."""

    name: str
    kind: str
    """webhook, mqtt, smtp or opcua"""
    connected: bool
    """Whether the last try succeeded; true before the first try for a link that keeps no connection open"""
    problem: str = ""
    """Why the link does not work; empty: it works"""
    pending: int = 0
    """Number of transitions that wait to be delivered"""
    delivered: int = 0
    given_up: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(GIVE_UP_REASONS, 0))
    """Number of transitions that were given up, by reason"""


@dataclass(frozen=True, slots=True)
class Histogram:
    """Processing time of blocks: upper bounds [s], counts per bucket (not cumulative, one more than bounds), sum."""

    bounds: tuple[float, ...]
    counts: tuple[int, ...]
    total_s: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole daemon at one moment.  ``messages``: to the operator, e.g. that a checkpoint was quarantined."""

    taken_us: int
    started_us: int
    axes: tuple[AxisSnapshot, ...]
    buses: tuple[BusSnapshot, ...]
    processing: Histogram
    checkpoint_us: int | None
    messages: tuple[str, ...] = ()
    alarms: AlarmsSnapshot = NO_ALARMS
    """States of the alarms: unrecorded, acknowledged, shelved, out of service"""
    history: HistoryState = NO_HISTORY
    """State of the history writer"""
    configuration_refused: bool = False
    """Whether a changed configuration was refused, so that the former one stays in force; a message says why"""
    certificates: tuple[Expiry, ...] = ()
    """When the certificates of the servers expire"""

    def axis(self, axis_id: str) -> AxisSnapshot | None:
        """The axis with this id; None: there is none."""
        return next((axis for axis in self.axes if axis.id == axis_id), None)


def out_of_service(axes: Iterable[AxisSnapshot]) -> Iterator[str]:
    """A message that lists the axes that are out of service, so that the operator does not forget them."""
    found = [f"{a.id} ({a.out_of_service.who})" for a in axes if a.out_of_service is not None]
    if found:
        words = "out of service, with alarms that are recorded but not announced: {axes}"
        yield sentence("out of service", words, axes=", ".join(found))


# --- Making the snapshot of an axis ---------------------------------------------------------------------------------


class Reception(NamedTuple):
    """How the samples of an axis are received; fields as in AxisSnapshot."""

    dropped: Mapping[str, int]
    clock: Mapping[str, int]
    stamps: Stamps
    silent_since_us: int | None = None


def make_axis_snapshot(
    axis: AxisPipeline,
    trends: Trends,
    status: AxisStatus,
    open_alarms: tuple[Alarm, ...],
    received: Reception,
    out_of_service: Note | None = None,
) -> AxisSnapshot:
    """Make the snapshot of an axis from its monitor, trends, alarms and input."""
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
        epoch=axis.epoch.snapshot(status),
        out_of_service=out_of_service,
        watched=axis.watched,
        silent_since_us=received.silent_since_us,
    )


Silence = Callable[[str, float, int | None], int | None]
"""Since when an axis is silent [us], by its id, sample interval [s] and the time of its last sample [us]; None: it is
not."""


class AxisView:
    """Makes the snapshots of one axis."""

    def __init__(
        self, axis: NamedAxis, pipeline: FramePipeline, alarms: AlarmRecorder, history: HistoryRecording
    ) -> None:
        self._axis, self._pipeline, self._alarms, self._history = axis, pipeline, alarms, history
        self._monitored = pipeline.monitors.axes[axis.id]
        self._by_configuration = Note(0, CONFIGURATION) if axis.config.alarms.out_of_service else None

    def take_point(self) -> None:
        """Give the history a point of the axis, if it is due for one."""
        axis_id, monitor = self._axis.id, self._monitored.monitor
        if self._history.is_due(axis_id, monitor.time_us):
            self._history.take(axis_id, monitor.status(), bool(self._monitored.gated_by))

    def snapshot(self, silence: Silence) -> AxisSnapshot:
        """The present snapshot of the axis."""
        axis, trends = self._axis, self._pipeline.monitors.trends
        source = self._pipeline.ingests[axis.config.bus].axes[axis.id]
        open_alarms = self._alarms.open(axis.id)
        status = _as_recorded(self._monitored.monitor.status(), open_alarms)
        silent_since_us = silence(axis.id, axis.config.sample_interval_s, status.time_us)
        if silent_since_us is not None:
            status = _without_samples(status)
        received = Reception(source.dropped, source.events, source.stamps, silent_since_us)
        removed = self._alarms.removed(axis.id) or self._by_configuration
        return make_axis_snapshot(self._monitored, trends, status, open_alarms, received, removed)


def _without_samples(status: AxisStatus) -> AxisStatus:
    """The status of an axis whose samples have stopped: nothing of it is tested, and nothing may seem to be healthy."""
    return replace(
        status,
        parameters=tuple(
            replace(p, status=p.status if p.status in _LASTING else Status.SILENT, not_tested=NotTested.NO_SAMPLE)
            for p in status.parameters
        ),
    )


_LASTING = (Status.ALARM, Status.INVALID)
"""States that last when the samples stop"""


def _as_recorded(status: AxisStatus, open_alarms: Iterable[Alarm]) -> AxisStatus:
    """The status with parameters in alarm as the journal has them: an alarm ends only when its end is recorded."""
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
