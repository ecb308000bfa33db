"""Snapshots: the immutable state that API, metrics and page read; the worker replaces it in one assignment."""

from collections.abc import Mapping
from dataclasses import dataclass

from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisStatus, ParameterTrend
from service.ingest.timestamp_jitter import NOT_KNOWN, Stamps


@dataclass(frozen=True, slots=True)
class HistoryPoint:
    """Estimates of an axis at one time, parameters in the order of its status."""

    time_us: int
    estimates: tuple[float, ...]
    standard_deviations: tuple[float, ...]
    g_up: tuple[float, ...]
    g_down: tuple[float, ...]
    nominals: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class History:
    """The last points, oldest first, in immutable chunks: appending shares all chunks but the last."""

    chunks: tuple[tuple[HistoryPoint, ...], ...] = ()

    def append(self, point: HistoryPoint, chunk: int = 60, most: int = 60) -> "History":
        """A history with one more point; the oldest chunk of ``chunk`` points goes when there are ``most``."""
        if self.chunks and len(self.chunks[-1]) < chunk:
            return History((*self.chunks[:-1], (*self.chunks[-1], point)))
        return History((*self.chunks, (point,))[-most:])

    @property
    def points(self) -> tuple[HistoryPoint, ...]:
        """All points, oldest first."""
        return tuple(point for chunk in self.chunks for point in chunk)


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
    """Values that did not become a sample, by reason (service.ingest.assemble.REASONS)"""
    clock: Mapping[str, int]
    """How often the time line of the samples restarted, by cause (service.ingest.axis_input.AxisInput.events)"""
    history: History
    gated_by: str = ""
    """The operating condition by which the last sample was not used, e.g. mode = 2; empty: it was used"""
    stamps: Stamps = NOT_KNOWN
    """Jitter of its time stamps"""
    other_causes: tuple[str, ...] = ()
    """Causes of alarms other than the monitored parameters"""
    trends: tuple[ParameterTrend, ...] = ()
    """The long-term trend of each parameter"""
    histories_lost: int = 0
    """Long-term histories that could not be restored at the start"""

    @property
    def causes(self) -> tuple[str, ...]:
        """Every cause that an alarm may name."""
        return (*(p.name for p in self.status.parameters), *self.other_causes)


@dataclass(frozen=True, slots=True)
class BusSnapshot:
    """One bus: its state in words ("up", "down: ..."), frames received, frames dropped by reason."""

    name: str
    state: str
    up: bool
    frames: int
    dropped: Mapping[str, int]


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

    def axis(self, axis_id: str) -> AxisSnapshot | None:
        """The axis of that id."""
        return next((axis for axis in self.axes if axis.id == axis_id), None)
