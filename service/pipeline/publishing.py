"""Publishes snapshots of the whole daemon, more often while they are read.

Making a snapshot costs as much as processing a block of samples.  A new alarm, bus state or message leads to a new
snapshot at once.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from time import perf_counter
from typing import NamedTuple

from service.can.bus_reader import BusSnapshot
from service.config import NamedAxis
from service.pipeline.axes.axis_monitors import FramePipeline
from service.pipeline.certificate_watch import CertificateWatch
from service.pipeline.pauses import with_pauses
from service.pipeline.persistence.alarm_recording import AlarmRecorder, AlarmsSnapshot
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.history_recording import HistoryRecording, HistoryState
from service.pipeline.persistence.recording import Recording
from service.pipeline.silence import SilenceWatch
from service.pipeline.snapshot import AxisView, Histogram, Snapshot, out_of_service

READ_S, UNREAD_S = 0.2, 1.0
"""Age at which a snapshot is replaced [s], if it has been read and if it has not."""
PAUSE_FACTOR = 10
"""A snapshot that has been read is replaced at the earliest after ``PAUSE_FACTOR`` times the time that it takes to make
one (0.1 s for a thousand axes), and at the latest after ``UNREAD_S``."""

BOUNDS_S = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


class ProcessingTime:
    """Histogram of the processing time of a block."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_S) + 1)
        self._total_s = 0.0

    def observe(self, duration_s: float) -> None:
        """Count one block of this duration [s]."""
        self._counts[bisect_left(BOUNDS_S, duration_s)] += 1
        self._total_s += duration_s

    def histogram(self) -> Histogram:
        """The histogram now."""
        return Histogram(BOUNDS_S, tuple(self._counts), self._total_s)


class WorkerParts(NamedTuple):
    """The parts that the worker's thread uses; other threads use them only between two blocks."""

    pipeline: FramePipeline
    """Decoding and monitors, with their restored states"""
    alarms: AlarmRecorder
    """Writes alarms to the journal"""
    history: HistoryRecording
    """Writes the estimates to the history"""
    recording: Recording
    """Writes frames to files"""
    checkpointer: Checkpointer
    """Saves the states of the monitors"""


class _Surroundings(NamedTuple):
    """The part of a snapshot that is cheap to make: all but the axes."""

    now_us: int
    buses: tuple[BusSnapshot, ...]
    alarms: AlarmsSnapshot
    history: HistoryState
    messages: tuple[str, ...]

    @property
    def urgent(self) -> tuple[object, ...]:
        """What is published at once when it changes: alarms, messages, bus states."""
        return self.alarms, self.messages, [bus.state for bus in self.buses]


class Publisher:
    """Makes the snapshots.  The worker's thread publishes them, any thread reads them.

    Args:
        parts: the sources of the snapshots.
        now_us: wall clock.
        messages: messages to the operator that stay in every snapshot.
    """

    def __init__(self, parts: WorkerParts, now_us: Callable[[], int], messages: Sequence[str]) -> None:
        self._parts, self._now_us, self._messages = parts, now_us, tuple(messages)
        self._started_us = now_us()
        self._views = dict[str, AxisView]()
        self._silence = SilenceWatch(parts.pipeline.messages_of)
        self._was_read = False
        self._shown: _Surroundings
        self.newest: Snapshot
        """The newest snapshot.  Reading it here does not make snapshots more frequent, as reading ``snapshot`` does"""
        self._published_s = self._making_s = 0.0
        self.processing = ProcessingTime()
        self.refused: str | None = None
        """Message to the operator that a changed configuration was refused; None: the last one is in force"""
        self.certificates: CertificateWatch | None = None
        """Knows when the certificates of the servers expire; None: there are no servers"""
        self.prepare: Callable[[Snapshot], object] = lambda _: None
        """Called with a snapshot before it is published, unless the last one was published a moment ago"""

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot, from any thread.  A reader that polls every second gets none that is older than that."""
        self._was_read = True
        return self.newest

    def show_axes(self, axes: Sequence[NamedAxis], new: Iterable[str]) -> None:
        """Include exactly these axes from now on; ``new``: ids of the axes whose monitor is new."""
        fresh, before = set(new), self._views
        self._views = {axis.id: self._view(axis) if axis.id in fresh else before[axis.id] for axis in axes}
        # A daemon runs for years, and each reload may rename axes.
        self._parts.history.keep_only(self._views.keys())

    def _view(self, axis: NamedAxis) -> AxisView:
        return AxisView(axis, self._parts.pipeline, self._parts.alarms, self._parts.history)

    def take_points(self) -> None:
        """Give the history a point of each axis that is due for one."""
        for view in with_pauses(self._views.values()):
            view.take_point()

    def publish(self, buses: Iterable[BusSnapshot], compiling: Iterable[str], at_once: bool, takes: bool) -> None:
        """Replace the snapshot if it is old or lacks urgent news.

        Args:
            buses: present states of the buses.
            compiling: messages about kernels that are not ready.
            at_once: replace it in any case.
            takes: whether frames are taken; they wait while the kernel is compiled.
        """
        news = self._news(buses, compiling)
        age_s = perf_counter() - self._published_s
        due_s = min(UNREAD_S, max(READ_S, PAUSE_FACTOR * self._making_s)) if self._was_read else UNREAD_S
        if at_once or age_s >= due_s or news.urgent != self._shown.urgent:
            self._was_read = False
            self._replace(news, prepare=age_s >= UNREAD_S / 2)
            self._silence.report(self.newest, takes)

    def _replace(self, news: _Surroundings, prepare: bool) -> None:
        start = perf_counter()
        new = self._snapshot(news)
        if prepare:
            self.prepare(new)
        self.newest, self._shown = new, news
        self._published_s = perf_counter()
        self._making_s = self._published_s - start

    def _news(self, buses: Iterable[BusSnapshot], compiling: Iterable[str]) -> _Surroundings:
        now_us, history = self._now_us(), self._parts.history.state()
        messages = *compiling, *self._all_messages(history, now_us)
        return _Surroundings(now_us, tuple(buses), self._parts.alarms.snapshot(now_us), history, messages)

    def _snapshot(self, news: _Surroundings) -> Snapshot:
        since = partial(self._silence.since, now_us=news.now_us)
        axes = tuple(view.snapshot(since) for view in with_pauses(self._views.values()))
        return Snapshot(
            taken_us=news.now_us,
            started_us=self._started_us,
            axes=axes,
            buses=news.buses,
            processing=self.processing.histogram(),
            checkpoint_us=self._parts.checkpointer.saved_us,
            messages=(*out_of_service(axes), *news.messages),
            alarms=news.alarms,
            history=news.history,
            configuration_refused=self.refused is not None,
            certificates=() if self.certificates is None else self.certificates.expiries,
        )

    def _all_messages(self, history: HistoryState, now_us: int) -> tuple[str, ...]:
        parts = self._parts
        alarms = parts.alarms.problem, parts.alarms.clock_message
        now = (*alarms, self.refused, parts.checkpointer.problem, history.problem, *parts.recording.problems)
        problems = (problem for problem in now if problem)
        warnings = () if self.certificates is None else self.certificates.warnings(now_us)
        return (*problems, *warnings, *self._messages, *parts.pipeline.monitors.restarted_windows, *history.messages)
