"""The worker: one thread that owns all monitors.

Frames of the readers become samples, samples go through the kernel, alarms go to the journal.  Then the snapshot that
shows them is replaced in one assignment.
"""

import threading
from bisect import bisect_left
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from time import perf_counter

import structlog

from service.config import Config
from service.pipeline.alarms import Alarms
from service.pipeline.bus_intake import BusIntake, Recording
from service.pipeline.checkpointing import Checkpointer
from service.pipeline.frame_pipeline import FramePipeline
from service.pipeline.publishing import AxisView, axis_view
from service.pipeline.snapshot import AxisSnapshot, Histogram, Snapshot

TICK_S = 0.1
"""Time between blocks and between snapshots: long enough for one call of the kernel to pay."""

MOST_FRAMES = 10_000
"""Frames of a bus in one block, so that a backlog does not keep the snapshots waiting."""

COMPILING = "the numeric kernel is being compiled; frames wait until it is ready"

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


class Worker:
    """Owns the pipeline from ``start`` until ``stop`` returns.

    Args:
        config: the whole configuration.
        pipeline: decoding and monitors, restored.
        buses: sources of frames.
        recording: file that frames are recorded to.
        alarms: the way to the journal.
        checkpointer: the way to the checkpoints.
        compiled: done when the kernel is ready; until then frames wait in their queues.
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
        checkpointer: Checkpointer,
        compiled: Future[None],
        now_us: Callable[[], int],
        messages: Sequence[str],
        on_failure: Callable[[], None],
    ) -> None:
        self._pipeline, self._buses, self._recording = pipeline, buses, recording
        self._alarms, self._checkpointer, self._compiled = alarms, checkpointer, compiled
        self._now_us, self._messages, self._on_failure = now_us, tuple(messages), on_failure
        self._time = ProcessingTime()
        self._views = [
            axis_view(
                axis,
                pipeline.monitors.by_id[axis.id],
                config.service.history_interval_s,
                config.service.history_length_s,
            )
            for axis in config.axes
        ]
        self._started_us = now_us()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
        self.error: BaseException | None = None
        """The fault that ended the thread."""
        self.snapshot = self._snapshot()
        """The newest snapshot; readers take it in one assignment."""

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Process the waiting frames, save the monitors, end the thread."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                if not self._tick():
                    self._stop.wait(TICK_S)
            self._finish()
        except BaseException as error:
            self.error = error
            log.critical("the worker has failed; the daemon stops", exc_info=True)
            self._on_failure()

    def _tick(self) -> bool:
        """Process one block; returns whether frames may still wait."""
        busy = self._compiled.done() and self._block()
        self.snapshot = self._snapshot()
        self._checkpointer.save_if_due()
        return busy

    def _block(self) -> bool:
        self._compiled.result()
        start = perf_counter()
        counts = [self._take(bus) for bus in self._buses]
        self._alarms.record(self._pipeline.update())
        self._alarms.record(self._pipeline.monitors.trends.update(1))
        if any(counts):
            self._time.observe(perf_counter() - start)
        return any(count >= MOST_FRAMES for count in counts)

    def _take(self, bus: BusIntake) -> int:
        frames = bus.take(MOST_FRAMES)
        self._pipeline.take(bus.name, frames)
        return len(frames)

    def _finish(self) -> None:
        """Process the waiting frames, then save the last checkpoint."""
        if self._compiled.done():
            while self._block():
                pass
            self._pipeline.flush()
            self._alarms.record(self._pipeline.update())
            self._alarms.record(self._pipeline.monitors.trends.update())
        self._checkpointer.save()
        self.snapshot = self._snapshot()

    def _snapshot(self) -> Snapshot:
        return Snapshot(
            taken_us=self._now_us(),
            started_us=self._started_us,
            axes=tuple(self._axis(view) for view in self._views),
            buses=tuple(bus.snapshot() for bus in self._buses),
            processing=self._time.histogram(),
            checkpoint_us=self._checkpointer.saved_us,
            messages=self._all_messages(),
        )

    def _axis(self, view: AxisView) -> AxisSnapshot:
        axis_id, ingest = view.axis.id, self._pipeline.ingests[view.axis.config.bus]
        open_alarms = self._alarms.open(axis_id)
        dropped = {**ingest.axis_dropped(axis_id), **self._pipeline.monitors.dropped(axis_id)}
        gated_by = self._pipeline.monitors.waits_for(axis_id)
        events, stamps = ingest.axis_events(axis_id), ingest.axis_stamps(axis_id)
        trends = self._pipeline.monitors.trends
        shown = view.snapshot(open_alarms, dropped, events, gated_by, stamps)
        return replace(shown, trends=trends.for_axis(axis_id), histories_lost=trends.lost[axis_id])

    def _all_messages(self) -> tuple[str, ...]:
        now = (self._alarms.problem, self._checkpointer.problem, self._recording.problem)
        compiling = () if self._compiled.done() else (COMPILING,)
        return (*compiling, *(problem for problem in now if problem), *self._messages)
