"""Publishing: the newest snapshot for everybody who looks, made as often as somebody does.

A snapshot costs as much as the samples of a block.  One that shows an alarm, a bus or a message that is new is made at
once.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from time import perf_counter
from typing import NamedTuple

from service.can.bus_reader import BusSnapshot
from service.config import NamedAxis
from service.pipeline.alarm_recording import Alarms, AlarmsSnapshot
from service.pipeline.axis_monitors import FramePipeline
from service.pipeline.checkpointing import Checkpointer
from service.pipeline.giving_way import giving_way
from service.pipeline.history_recording import HistoryRecording, HistoryState
from service.pipeline.recording import Recording
from service.pipeline.snapshot import AxisView, Histogram, Snapshot, out_of_service

LOOKED_AT_S, UNSEEN_S = 0.2, 1.0
"""Age [s] from which on a snapshot is replaced: where somebody has looked at it, and otherwise."""
PAUSE_FACTOR = 10
"""A snapshot that somebody looks at is replaced after so many times what it takes to make one (0.1 s for a thousand
axes), at the latest after ``UNSEEN_S``."""

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
    """What the worker's thread uses, and nobody else but between two blocks."""

    pipeline: FramePipeline
    """Decoding and monitors, restored"""
    alarms: Alarms
    """The way to the journal"""
    history: HistoryRecording
    """Gets the status of all axes"""
    recording: Recording
    """Files that frames are recorded to"""
    checkpointer: Checkpointer
    """The way to the checkpoints"""


class _News(NamedTuple):
    """What may be new in a snapshot beside the status of the axes; it costs little."""

    now_us: int
    buses: tuple[BusSnapshot, ...]
    alarms: AlarmsSnapshot
    history: HistoryState
    messages: tuple[str, ...]

    def differs(self, shown: Snapshot) -> bool:
        """Whether people wait for something in it that the snapshot does not have."""
        states, shown_states = ([bus.state for bus in buses] for buses in (self.buses, shown.buses))
        return (self.alarms, self.messages, states) != (shown.alarms, shown.messages, shown_states)


class Publisher:
    """Makes the snapshots; the worker's thread publishes, any thread looks.

    Args:
        parts: what the snapshots show.
        now_us: wall clock.
        messages: for the operator, from the start.
    """

    def __init__(self, parts: WorkerParts, now_us: Callable[[], int], messages: Sequence[str]) -> None:
        self._parts, self._now_us, self._messages = parts, now_us, tuple(messages)
        self._started_us = now_us()
        self._views = dict[str, AxisView]()
        self._looked_at = False
        self._published: Snapshot
        self._published_s = self._making_s = 0.0
        self.processing = ProcessingTime()
        self.prepare: Callable[[Snapshot], object] = lambda _: None
        """Called with a snapshot before it is shown, unless the last one was replaced a moment ago"""

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot, from any thread.  Whoever looks every second finds none that is older."""
        self._looked_at = True
        return self._published

    def show_axes(self, axes: Sequence[NamedAxis], new: Iterable[str]) -> None:
        """Show these axes from now on; ``new``: ids of those that have another monitor than before."""
        fresh, before = set(new), self._views
        self._views = {axis.id: self._view(axis) if axis.id in fresh else before[axis.id] for axis in axes}

    def _view(self, axis: NamedAxis) -> AxisView:
        return AxisView(axis, self._parts.pipeline, self._parts.alarms, self._parts.history)

    def take_points(self) -> None:
        """Give the history a point of each axis for which one is due."""
        for view in giving_way(self._views.values()):
            view.take_point()

    def publish(self, buses: Iterable[BusSnapshot], compiling: Iterable[str], at_once: bool) -> None:
        """Replace the snapshot where it is old, or does not show what people wait for.

        Args:
            buses: as they are now.
            compiling: which kernels are not ready, for the operator.
            at_once: whether it is replaced in any case.
        """
        news = self._news(buses, compiling)
        age_s = perf_counter() - self._published_s
        due_s = (
            min(UNSEEN_S, max(LOOKED_AT_S, PAUSE_FACTOR * self._making_s)) if self._looked_at else UNSEEN_S
        )
        if at_once or age_s >= due_s or news.differs(self._published):
            self._looked_at = False
            self._replace(news, prepare=age_s >= UNSEEN_S / 2)

    def _replace(self, news: _News, prepare: bool) -> None:
        start = perf_counter()
        new = self._snapshot(news)
        if prepare:
            self.prepare(new)
        self._published = new
        self._published_s = perf_counter()
        self._making_s = self._published_s - start

    def _news(self, buses: Iterable[BusSnapshot], compiling: Iterable[str]) -> _News:
        now_us, history = self._now_us(), self._parts.history.state()
        messages = *compiling, *self._all_messages(history)
        return _News(now_us, tuple(buses), self._parts.alarms.snapshot(now_us), history, messages)

    def _snapshot(self, news: _News) -> Snapshot:
        axes = tuple(view.snapshot() for view in giving_way(self._views.values()))
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
        )

    def _all_messages(self, history: HistoryState) -> tuple[str, ...]:
        parts = self._parts
        alarms = parts.alarms.problem, parts.alarms.clock_message
        now = (*alarms, parts.checkpointer.problem, history.problem, *parts.recording.problems)
        problems = (problem for problem in now if problem)
        return (*problems, *self._messages, *parts.pipeline.monitors.begun_again, *history.messages)
