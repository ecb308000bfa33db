"""The worker: one thread that takes the frames of all buses and owns all monitors.

Frames of the readers become samples, samples go through the kernel, alarms go to the journal.  The snapshot that shows
them is replaced in one assignment: at once where an alarm, a bus or a message has changed, otherwise as often as
somebody looks.
"""

import threading
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from time import perf_counter, thread_time
from typing import Any, Generic, NamedTuple, TypeVar

import structlog

from monitor_core.wording import sentence
from service.can.bus_reader import BusSnapshot
from service.can.receivers import BLOCK_S
from service.config import Config, NamedAxis
from service.ingest.bus_samples import Ingest
from service.pipeline.alarm_recording import Alarms, AlarmsSnapshot, AxisAlarm, alarm_rules, quantities
from service.pipeline.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.bus_readers import BusIntake
from service.pipeline.checkpointing import Checkpointer
from service.pipeline.giving_way import giving_way
from service.pipeline.history_recording import HistoryRecording, HistoryState
from service.pipeline.recording import Recording
from service.pipeline.snapshot import AxisView, Histogram, Snapshot, out_of_service

LOOKED_AT_S, UNSEEN_S = 0.2, 1.0
"""Age [s] from which on a snapshot is replaced: where somebody has looked at it, and otherwise.  To make it takes as
long as the samples of a block."""
PAUSE_FACTOR = 10
"""A snapshot that somebody looks at is replaced after so many times what it takes to make one (0.1 s for a thousand
axes), at the latest after ``UNSEEN_S``."""

LONGEST_BLOCK_S = 0.5
BLOCK_FACTOR = 4
"""A block costs the same whether an axis has one sample in it or ten.  So a block that takes long, as that of a
thousand axes does, is followed by one of so many times its processor time, at most ``LONGEST_BLOCK_S``."""

MOST_FRAMES = 10_000
"""Frames of a bus in one block, so that a backlog does not keep the snapshots waiting."""

JUDGE_S = 0.1
"""Time between two turns of the multi-model detectors: one for several blocks costs little more than one for each."""

MOST_DEFERRED = 100_000
"""Samples that may wait for the multi-model detectors, some seconds of computation; then frames wait, too."""

COMPILING = sentence("compiling", "the numeric kernel is being compiled; frames wait until it is ready")
COMPILING_MULTIMODEL = sentence(
    "compiling multimodel",
    "the multi-model detector's kernel is being compiled; its samples wait until it is ready",
)

log = structlog.get_logger(__name__)


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


class Compiled(NamedTuple):
    """Done when a kernel is ready.  Estimates need not wait for the multi-model detectors."""

    estimates: Future[None]
    multimodel: Future[None]


T = TypeVar("T")


class _Action(NamedTuple, Generic[T]):
    """Something to be done between two blocks, and its result."""

    action: Callable[[], T]
    done: Future[T]

    def run(self) -> None:
        if not self.done.set_running_or_notify_cancel():
            return
        try:
            self.done.set_result(self.action())
        except BaseException as error:
            self.done.set_exception(error)
            if not isinstance(error, Exception):
                raise


class Worker:
    """Owns the pipeline from ``start`` until ``stop`` returns.

    ``pipeline``, ``alarms`` and ``checkpointer`` are used by its thread only: others use them ``between_blocks``.

    Args:
        config: the whole configuration.
        pipeline: decoding and monitors, restored.
        buses: sources of frames.
        recording: files that frames are recorded to.
        alarms: the way to the journal.
        history: gets the status of all axes.
        checkpointer: the way to the checkpoints.
        compiled: until the kernel of the estimates is ready, frames wait in their queues.
        now_us: wall clock.
        messages: for the operator, from the start.
        on_failure: called when the thread ends by a fault.
    """

    def __init__(
        self,
        config: Config,
        pipeline: FramePipeline,
        buses: Sequence[BusIntake],
        recording: Recording,
        alarms: Alarms,
        history: HistoryRecording,
        checkpointer: Checkpointer,
        compiled: Compiled,
        now_us: Callable[[], int],
        messages: Sequence[str],
        on_failure: Callable[[], None],
    ) -> None:
        self.pipeline, self._buses, self._recording = pipeline, buses, recording
        self.alarms, self.checkpointer, self._compiled = alarms, checkpointer, compiled
        self._now_us, self._messages, self._on_failure = now_us, tuple(messages), on_failure
        self._block_s = config.block_s
        self._judge_s = self._took_s = 0.0
        self._time = ProcessingTime()
        pipeline.monitors.defer_multimodel()
        self._history = history
        self._views = {axis.id: self._view(axis) for axis in config.axes}
        self._actions = deque[_Action[Any]]()
        self._started_us = now_us()
        self._stop = threading.Event()
        self._arrived, self._arrived_s = threading.Event(), 0.0
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
        self.turns = 0
        """How often its loop has turned: frames may be missing, but it turns after each ``block_s``"""
        self.error: BaseException | None = None
        """The fault that ended the thread."""
        self.prepare: Callable[[Snapshot], object] = lambda _: None
        """Called with a snapshot before it is shown, unless the last one was replaced a moment ago"""
        self._looked_at = False
        self._replace(self._news(now_us()))

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot, from any thread.  Whoever looks every second finds none that is older."""
        self._looked_at = True
        return self._published

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Process the waiting frames, save the monitors, end the thread; what waits to be done is cancelled."""
        self._stop.set()
        self._arrived.set()
        if self._thread.is_alive():
            self._thread.join()
        while self._actions:
            self._actions.popleft().done.cancel()

    def frames_arrived(self) -> None:
        """Tell it that frames wait in a reader; from any thread."""
        self._arrived_s = perf_counter()
        self._arrived.set()

    def between_blocks(self, action: Callable[[], T]) -> Future[T]:
        """Have an action done by the worker's thread, between two blocks of samples; from any thread.

        What it raises is raised by the future, too; the worker goes on.
        """
        done = Future[T]()
        self._actions.append(_Action(action, done))
        if self._stop.is_set() and not self._thread.is_alive():
            done.cancel()
        return done

    def change(self, axes: Sequence[NamedAxis], made: AxisMonitors) -> None:
        """Monitor these axes from now on, those of ``made`` by its monitors; between two blocks.

        The others keep their monitors and the state in them, and take every sample as without it.
        """
        ids = [axis.id for axis in axes]
        gone = [axis_id for axis_id in self._views if axis_id not in ids]
        new = [axis for axis in axes if axis.id in made.by_id]
        known = quantities(made.by_id)
        self.pipeline.monitors.change(ids, made)
        self.pipeline.live.forget({*made.by_id, *gone})
        self.alarms.change({*made.by_id, *gone}, known, alarm_rules(new, known))
        self._views = {axis_id: view for axis_id, view in self._views.items() if axis_id in ids}
        self._views |= {axis.id: self._view(axis) for axis in new}
        self._views = {axis_id: self._views[axis_id] for axis_id in ids}
        self.checkpointer.save_soon()

    def take_all(self) -> None:
        """Take all frames that wait; between two blocks."""
        while not self.compiles and self._block():
            pass

    def change_buses(
        self, names: Sequence[str], new: Mapping[str, BusIntake], ingests: Mapping[str, Ingest]
    ) -> None:
        """Take frames of these buses from now on, those of ``new`` in place of the former; between two blocks."""
        kept = {bus.name: bus for bus in self._buses}
        self.pipeline.change_buses(names, ingests)
        self._buses = [new.get(name) or kept[name] for name in names]

    @property
    def compiles(self) -> bool:
        """Whether frames wait for the compiler; from any thread."""
        return not self._compiled.estimates.done()

    def _view(self, axis: NamedAxis) -> AxisView:
        return AxisView(axis, self.pipeline, self.alarms, self._history)

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                begun_s = perf_counter()
                busy = self._tick()
                self.turns += 1
                if not busy:
                    longer_s = min(BLOCK_FACTOR * self._took_s, LONGEST_BLOCK_S)
                    self._await_frames(begun_s + max(self._block_s, longer_s))
            self._finish()
        except BaseException as error:
            self.error = error
            log.critical("the worker has failed; the daemon stops", exc_info=True)
            self._on_failure()

    def _await_frames(self, due_s: float) -> None:
        """Until a reader, which passes frames on at least each BLOCK_S, has done so at about that time."""
        early_s = due_s - min(self._block_s, BLOCK_S) / 2
        self._stop.wait(early_s - perf_counter())
        self._arrived.clear()
        if self._arrived_s < early_s and not self._stop.is_set():
            self._arrived.wait(2 * BLOCK_S)

    def _tick(self) -> bool:
        """Process one block; returns whether frames may still wait."""
        acted = bool(self._actions)
        while self._actions:
            self._actions.popleft().run()
        busy = not self._waits() and self._block()
        self._recording.tick()
        for view in giving_way(self._views.values()):
            view.take_point()
        self._publish(at_once=acted)
        # While samples wait for the detectors, these would be older than the estimates.
        if not self.pipeline.monitors.deferred_samples:
            self.checkpointer.save_if_due()
        return busy

    def _waits(self) -> bool:
        """Whether frames wait for the compiler."""
        if self.compiles:
            return True
        full = self.pipeline.monitors.deferred_samples >= MOST_DEFERRED
        return full and not self._compiled.multimodel.done()

    def _block(self) -> bool:
        self._compiled.estimates.result()
        start, before_s = perf_counter(), thread_time()
        self._now_us()  # if the clock was set, this is known before the frames with the new times
        counts = [self._take(bus) for bus in self._buses]
        self._record(self.pipeline.update())
        if start >= self._judge_s:
            self._judge()
        self._record(self.pipeline.monitors.trends.update(1))
        if any(counts):
            self._time.observe(perf_counter() - start)
        self._took_s = thread_time() - before_s
        return any(count >= MOST_FRAMES for count in counts)

    def _judge(self) -> None:
        """Let the multi-model detectors take the samples that wait for them."""
        if self._compiled.multimodel.done():
            self._compiled.multimodel.result()
            self._record(self.pipeline.monitors.update_multimodel())
            self._judge_s = perf_counter() + JUDGE_S

    def _record(self, changes: Iterable[AxisAlarm]) -> None:
        changes = list(changes)
        self.alarms.record(changes)
        self._recording.follow(changes)

    def _take(self, bus: BusIntake) -> int:
        frames = bus.take(MOST_FRAMES)
        self.pipeline.take(bus.name, frames)
        return frames.size

    def _finish(self) -> None:
        """Process the waiting frames, then save the last checkpoint."""
        if self._compiled.estimates.done():
            while self._block():
                pass
            self.pipeline.flush()
            self._record(self.pipeline.update())
            self._record(self.pipeline.monitors.trends.update())
            self._judge()
        if left := self.pipeline.monitors.deferred_samples:
            log.warning("the multi-model detector was not ready: it does not get its samples", samples=left)
        for view in self._views.values():
            view.take_point()
        self.checkpointer.save()
        self._publish(at_once=True)

    def _publish(self, at_once: bool) -> None:
        """Replace the snapshot where it is old, or does not show what people wait for."""
        news = self._news(self._now_us())
        age_s = perf_counter() - self._published_s
        due_s = (
            min(UNSEEN_S, max(LOOKED_AT_S, PAUSE_FACTOR * self._making_s)) if self._looked_at else UNSEEN_S
        )
        if at_once or age_s >= due_s or news.differs(self._published):
            self._looked_at = False
            self._replace(news, prepare=age_s >= UNSEEN_S / 2)

    def _replace(self, news: _News, prepare: bool = False) -> None:
        start = perf_counter()
        new = self._snapshot(news)
        if prepare:
            self.prepare(new)
        self._published = new
        self._published_s = perf_counter()
        self._making_s = self._published_s - start

    def _news(self, now_us: int) -> _News:
        history, buses = self._history.state(), tuple(bus.snapshot() for bus in self._buses)
        return _News(now_us, buses, self.alarms.snapshot(now_us), history, self._all_messages(history))

    def _snapshot(self, news: _News) -> Snapshot:
        axes = tuple(view.snapshot() for view in giving_way(self._views.values()))
        return Snapshot(
            taken_us=news.now_us,
            started_us=self._started_us,
            axes=axes,
            buses=news.buses,
            processing=self._time.histogram(),
            checkpoint_us=self.checkpointer.saved_us,
            messages=(*out_of_service(axes), *news.messages),
            alarms=news.alarms,
            history=news.history,
        )

    def _all_messages(self, history: HistoryState) -> tuple[str, ...]:
        alarms = self.alarms.problem, self.alarms.clock_message
        now = (*alarms, self.checkpointer.problem, history.problem, *self._recording.problems)
        compiling = [COMPILING] if self._waits() else []
        if self._compiled.estimates.done() and not self._compiled.multimodel.done():
            compiling.append(COMPILING_MULTIMODEL)
        problems = (problem for problem in now if problem)
        again = self.pipeline.monitors.begun_again
        return (*compiling, *problems, *self._messages, *again, *history.messages)
