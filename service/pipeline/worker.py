"""The worker: one thread that owns all monitors.

Frames from the readers become samples, samples go through the kernel, alarms into the journal; then the
snapshot that shows them is swapped in, in one assignment.
"""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from time import perf_counter

import structlog

from service.config import Config
from service.pipeline.alarm_journaling import Alarms
from service.pipeline.block_timing import ProcessingTime
from service.pipeline.checkpointing import Saver
from service.pipeline.frame_pipeline import Core
from service.pipeline.intake import BusIntake, Recording
from service.pipeline.publishing import AxisView, axis_view
from service.pipeline.snapshot import AxisSnapshot, Snapshot

TICK_S = 0.1
"""Time between blocks and between snapshots: long enough for one call of the kernel to pay."""

MOST_FRAMES = 10_000
"""Frames of a bus in one block, so that a backlog does not keep the snapshots waiting."""

COMPILING = "the numeric kernel is being compiled; frames wait until it is ready"

log = structlog.get_logger(__name__)


class Worker:
    """Owns the core from ``start`` until ``join`` returns.

    Args:
        config: the whole configuration.
        core: ingest and monitors, restored.
        buses: where frames come from.
        recording: where they are also written to.
        alarms: the way to the journal.
        saver: the way to the checkpoints.
        compiled: done when the kernel is ready; until then frames wait in their queues.
        now_us: wall clock.
        messages: for the operator, from the start.
        on_failure: called when the thread ends by a fault.
    """

    def __init__(
        self,
        config: Config,
        core: Core,
        buses: Sequence[BusIntake],
        recording: Recording,
        alarms: Alarms,
        saver: Saver,
        compiled: Future[None],
        now_us: Callable[[], int],
        messages: Sequence[str],
        on_failure: Callable[[], None],
    ) -> None:
        self._core, self._buses, self._recording = core, buses, recording
        self._alarms, self._saver, self._compiled = alarms, saver, compiled
        self._now_us, self._messages, self._on_failure = now_us, tuple(messages), on_failure
        self._time = ProcessingTime()
        self._views = [
            axis_view(
                axis,
                core.monitors.by_id[axis.id],
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
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Process the frames that still wait, save the monitors, end the thread."""
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
        """One block; whether frames may still wait."""
        busy = self._compiled.done() and self._block()
        self.snapshot = self._snapshot()
        self._saver.save_if_due()
        return busy

    def _block(self) -> bool:
        self._compiled.result()
        start = perf_counter()
        counts = [self._take(bus) for bus in self._buses]
        self._alarms.record(self._core.run())
        self._alarms.record(self._core.monitors.trends.look(1))
        if any(counts):
            self._time.observe(perf_counter() - start)
        return any(count >= MOST_FRAMES for count in counts)

    def _take(self, bus: BusIntake) -> int:
        frames = bus.take(MOST_FRAMES)
        self._core.take(bus.name, frames)
        return len(frames)

    def _finish(self) -> None:
        """The frames that still wait, then the last checkpoint."""
        if self._compiled.done():
            while self._block():
                pass
            self._core.flush()
            self._alarms.record(self._core.run())
            self._alarms.record(self._core.monitors.trends.look())
        self._saver.save()
        self.snapshot = self._snapshot()

    def _snapshot(self) -> Snapshot:
        return Snapshot(
            taken_us=self._now_us(),
            started_us=self._started_us,
            axes=tuple(self._axis(view) for view in self._views),
            buses=tuple(bus.snapshot() for bus in self._buses),
            processing=self._time.histogram(),
            checkpoint_us=self._saver.saved_us,
            messages=self._all_messages(),
        )

    def _axis(self, view: AxisView) -> AxisSnapshot:
        axis_id, ingest = view.axis.id, self._core.ingests[view.axis.config.bus]
        open_alarms = self._alarms.open(axis_id)
        dropped = {**ingest.axis_dropped(axis_id), **self._core.monitors.dropped(axis_id)}
        gated_by = self._core.monitors.waits_for(axis_id)
        events, stamps = ingest.axis_events(axis_id), ingest.axis_stamps(axis_id)
        trends = self._core.monitors.trends
        shown = view.snapshot(open_alarms, dropped, events, gated_by, stamps)
        return replace(shown, trends=trends.of(axis_id), histories_lost=trends.lost[axis_id])

    def _all_messages(self) -> tuple[str, ...]:
        now = (self._alarms.problem, self._saver.problem, self._recording.problem)
        compiling = () if self._compiled.done() else (COMPILING,)
        return (*compiling, *(problem for problem in now if problem), *self._messages)
