"""The worker: the thread that takes the frames of all buses and owns all monitors.

It makes samples from frames, runs the kernel on the samples, writes alarms to the journal and publishes snapshots.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from time import perf_counter, thread_time
from typing import Any, Generic, NamedTuple, TypeVar

import structlog

from monitor_core.wording import sentence
from service.can.receivers import BLOCK_S
from service.config import Config, NamedAxis
from service.ingest.samples.bus_samples import Ingest
from service.pipeline.axes.axis_alarms import AxisAlarm, alarm_rules, quantities
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.bus_readers import BusIntake
from service.pipeline.publishing import Publisher, WorkerParts
from service.pipeline.snapshot import Snapshot

LONGEST_BLOCK_S = 0.5
BLOCK_FACTOR = 4
"""A block costs the same whether an axis has one sample in it or ten.  So the next block is at least ``BLOCK_FACTOR``
times as long as the processor time of the last one, up to ``LONGEST_BLOCK_S``.  That matters for a thousand axes."""

MOST_FRAMES = 10_000
"""Most frames of a bus in one block, so that a backlog does not delay the snapshots."""

MULTIMODEL_S = 0.1
"""Time between two updates of the multi-model detectors: one for several blocks costs little more than one a block."""

MOST_DEFERRED = 100_000
"""Most samples that wait for the multi-model detectors, some seconds of computation.  With more, frames wait, too."""

COMPILING = sentence("compiling", "the numeric kernel is being compiled; frames wait until it is ready")
COMPILING_MULTIMODEL = sentence(
    "compiling multimodel",
    "the multi-model detector's kernel is being compiled; its samples wait until it is ready",
)

log = structlog.get_logger(__name__)


def next_block_s(block_s: float, took_s: float) -> float:
    """Time in which the next block is collected [s]; ``took_s``: processor time of the last one [s]."""
    return max(block_s, min(BLOCK_FACTOR * took_s, LONGEST_BLOCK_S))


class Compiled(NamedTuple):
    """Futures that are done when a kernel is ready.  Estimates need not wait for the multi-model detectors."""

    estimates: Future[None]
    multimodel: Future[None]


T = TypeVar("T")


class _Action(NamedTuple, Generic[T]):
    """An action to run between two blocks, and its result."""

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
    """Owns the pipeline from the call of ``start`` until ``stop`` returns.

    Only its thread uses ``pipeline``, ``alarms`` and ``checkpointer``; others use them through ``between_blocks``.

    Args:
        config: the whole configuration.
        parts: the parts that its thread uses.
        buses: sources of frames.
        compiled: whether the kernels are ready.  Frames wait in their queues for the kernel of the estimates.
        now_us: wall clock.
        messages: messages to the operator that stay in every snapshot.
        on_failure: called when an exception ends the thread.
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
        self._next_multimodel_s = self._last_block_s = 0.0
        self.pipeline.monitors.defer_multimodel()
        self._actions = deque[_Action[Any]]()
        self._stop = threading.Event()
        self._arrived, self._arrived_s = threading.Event(), 0.0
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
        self.turns = 0
        """Number of loops, to see that the thread is alive: it loops after each ``block_s``, with or without frames"""
        self.error: BaseException | None = None
        """The exception that ended the thread; None: none did."""
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
        """Process the waiting frames, save the monitors and end the thread; waiting actions are cancelled."""
        self._stop.set()
        self._arrived.set()
        if self._thread.is_alive():
            self._thread.join()
        while self._actions:
            self._actions.popleft().done.cancel()

    def frames_arrived(self) -> None:
        """Wake the worker, as frames wait in a reader; from any thread."""
        self._arrived_s = perf_counter()
        self._arrived.set()

    def between_blocks(self, action: Callable[[], T]) -> Future[T]:
        """Let the worker's thread run an action between two blocks of samples; from any thread.

        The future also raises what the action raises; the worker continues.
        """
        done = Future[T]()
        self._actions.append(_Action(action, done))
        if self._stop.is_set() and not self._thread.is_alive():
            done.cancel()
        return done

    def change(self, axes: Sequence[NamedAxis], new: AxisMonitors) -> None:
        """Monitor exactly these axes from now on; to be called between two blocks.

        Axes in ``new`` get its monitors.  The others keep their monitors and states, and miss no sample.
        """
        ids = [axis.id for axis in axes]
        gone = self.pipeline.monitors.axes.keys() - set(ids)
        changed = [axis for axis in axes if axis.id in new.by_id]
        values = quantities(new.by_id)
        self.pipeline.monitors.change(ids, new)
        self.pipeline.live.forget({*new.by_id, *gone})
        self.alarms.change({*new.by_id, *gone}, values, alarm_rules(changed, values))
        self.publisher.show_axes(axes, new.by_id)
        self.checkpointer.save_soon()

    def take_all(self) -> None:
        """Process all waiting frames; to be called between two blocks."""
        while not self.compiles and self._block():
            pass

    def change_buses(self, names: Sequence[str], new: Mapping[str, BusIntake], ingests: Mapping[str, Ingest]) -> None:
        """Take frames of exactly these buses from now on; those in ``new`` replace former ones.  Between two blocks."""
        kept = {bus.name: bus for bus in self._buses}
        self.pipeline.change_buses(names, ingests)
        self._buses = [new.get(name) or kept[name] for name in names]

    @property
    def compiles(self) -> bool:
        """Whether the kernel of the estimates is still being compiled, so that frames wait; from any thread."""
        return not self._compiled.estimates.done()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                start_s = perf_counter()
                busy = self.turn()
                self.turns += 1
                if not busy:
                    self._await_frames(start_s + next_block_s(self._block_s, self._last_block_s))
            self._finish()
        except BaseException as error:
            self.error = error
            log.critical("the worker has failed; the daemon stops", exc_info=True)
            self._on_failure()

    def _await_frames(self, due_s: float) -> None:
        """Wait until a reader has passed on frames at about ``due_s``; a reader does so at least each BLOCK_S."""
        early_s = due_s - min(self._block_s, BLOCK_S) / 2
        self._stop.wait(early_s - perf_counter())
        self._arrived.clear()
        if self._arrived_s < early_s and not self._stop.is_set():
            self._arrived.wait(2 * BLOCK_S)

    def turn(self) -> bool:
        """Process one block, in the thread of the worker; returns whether frames may still wait."""
        acted = bool(self._actions)
        while self._actions:
            self._actions.popleft().run()
        busy = not self._waits() and self._block()
        self._recording.tick()
        self.publisher.take_points()
        self._publish(at_once=acted)
        # While samples wait for the multi-model detectors, their saved states would be older than the estimates.
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
        self._now_us()  # notices a step of the clock before frames with the new times are taken
        counts = [self._take(bus) for bus in self._buses]
        self._record(self.pipeline.update())
        if start >= self._next_multimodel_s:
            self._update_multimodel()
        self._record(self.pipeline.monitors.trends.update(1))
        if any(counts):
            self.publisher.processing.observe(perf_counter() - start)
        self._last_block_s = thread_time() - before_s
        return any(count >= MOST_FRAMES for count in counts)

    def _update_multimodel(self) -> None:
        """Pass the waiting samples to the multi-model detectors, if their kernel is ready."""
        if self._compiled.multimodel.done():
            self._compiled.multimodel.result()
            self._record(self.pipeline.monitors.update_multimodel())
            self._next_multimodel_s = perf_counter() + MULTIMODEL_S

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
            self._update_multimodel()
        if left := self.pipeline.monitors.deferred_samples:
            log.warning("the multi-model detector was not ready: its waiting samples are lost", samples=left)
        self.alarms.finish()
        self.publisher.take_points()
        self.checkpointer.save()
        self._publish(at_once=True)

    def _publish(self, at_once: bool) -> None:
        buses = (bus.snapshot() for bus in self._buses)
        self.publisher.publish(buses, self._compiling(), at_once, not self._waits())

    def _compiling(self) -> Iterator[str]:
        """Messages to the operator about kernels that are not ready."""
        if self._waits():
            yield COMPILING
        if self._compiled.estimates.done() and not self._compiled.multimodel.done():
            yield COMPILING_MULTIMODEL
