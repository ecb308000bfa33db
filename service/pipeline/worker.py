"""The worker: one thread that takes the frames of all buses and owns all monitors.

Frames of the readers become samples, samples go through the kernel, alarms go to the journal, and what all of them show
is published.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from time import perf_counter, thread_time
from typing import Any, Generic, NamedTuple, TypeVar

import structlog

from monitor_core.wording import sentence
from service.can.bus_reader import BusSnapshot
from service.can.receivers import BLOCK_S
from service.config import Config, NamedAxis
from service.ingest.bus_samples import Ingest
from service.pipeline.alarm_recording import AxisAlarm, alarm_rules, quantities
from service.pipeline.axis_monitors import AxisMonitors
from service.pipeline.bus_readers import BusIntake
from service.pipeline.publishing import Publisher, WorkerParts
from service.pipeline.snapshot import Snapshot

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
        parts: what its thread uses.
        buses: sources of frames.
        compiled: until the kernel of the estimates is ready, frames wait in their queues.
        now_us: wall clock.
        messages: for the operator, from the start.
        on_failure: called when the thread ends by a fault.
    """

    def __init__(
        self,
        config: Config,
        parts: WorkerParts,
        buses: Sequence[BusIntake],
        compiled: Compiled,
        now_us: Callable[[], int],
        messages: Sequence[str],
        on_failure: Callable[[], None],
    ) -> None:
        self.pipeline, self.alarms, self.checkpointer = parts.pipeline, parts.alarms, parts.checkpointer
        self._recording, self._buses, self._compiled = parts.recording, buses, compiled
        self._now_us, self._on_failure = now_us, on_failure
        self._block_s = config.block_s
        self._judge_s = self._took_s = 0.0
        self.pipeline.monitors.defer_multimodel()
        self._actions = deque[_Action[Any]]()
        self._stop = threading.Event()
        self._arrived, self._arrived_s = threading.Event(), 0.0
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
        self.turns = 0
        """How often its loop has turned: frames may be missing, but it turns after each ``block_s``"""
        self.error: BaseException | None = None
        """The fault that ended the thread."""
        self.publisher = Publisher(parts, now_us, messages)
        self.publisher.show_axes(config.axes, [axis.id for axis in config.axes])
        self._publish(at_once=True)

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot, from any thread."""
        return self.publisher.snapshot

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
        gone = self.pipeline.monitors.axes.keys() - set(ids)
        new = [axis for axis in axes if axis.id in made.by_id]
        known = quantities(made.by_id)
        self.pipeline.monitors.change(ids, made)
        self.pipeline.live.forget({*made.by_id, *gone})
        self.alarms.change({*made.by_id, *gone}, known, alarm_rules(new, known))
        self.publisher.show_axes(axes, made.by_id)
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
        self.publisher.take_points()
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
            self.publisher.processing.observe(perf_counter() - start)
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
        self.publisher.take_points()
        self.checkpointer.save()
        self._publish(at_once=True)

    def _publish(self, at_once: bool) -> None:
        self.publisher.publish(self._bus_snapshots(), self._compiling(), at_once)

    def _bus_snapshots(self) -> Iterator[BusSnapshot]:
        return (bus.snapshot() for bus in self._buses)

    def _compiling(self) -> Iterator[str]:
        """Which kernels are not ready, for the operator."""
        if self._waits():
            yield COMPILING
        if self._compiled.estimates.done() and not self._compiled.multimodel.done():
            yield COMPILING_MULTIMODEL
