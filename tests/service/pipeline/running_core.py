"""The core of the daemon with real monitors, journal and checkpoints; a test feeds it frames."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path

from fastapi import FastAPI

from service.can.frames import Frame, FrameBlock
from service.config import Config
from service.pipeline.alarm_recording import Alarms, quantities
from service.pipeline.axis_monitors import FramePipeline
from service.pipeline.baselines import Baselines
from service.pipeline.bus_readers import BusIntake
from service.pipeline.checkpointing import Checkpointer
from service.pipeline.epochs_at_start import at_start, bring_back
from service.pipeline.history_recording import HistoryRecording
from service.pipeline.publishing import WorkerParts
from service.pipeline.recording import Recording
from service.pipeline.snapshot import AxisSnapshot
from service.pipeline.worker import Compiled, Worker
from service.simulation.robot import Fault
from service.store.checkpoints import Checkpoints
from service.store.epochs import Epoch
from service.store.history_store import RESOLUTIONS, Bounds, HistoryStore
from service.store.journal import Journal
from service.web.access import Access
from service.web.app import create_app
from service.web.app_state import AppState
from tests.end_to_end.processes import wait_for
from tests.service.pipeline.robots import START_US, Waiting, blocks, changed, demo

AXIS, OTHER = "demo.axis1", "demo.axis2"
TRUTH = 1.3 * 0.06
"""Friction of the first axis; the configuration has 0.06."""


def cell(folder: Path, axes: int = 2) -> Config:
    """The demo without the multi-model detectors, which take most of the time to start."""
    return changed(demo(folder, axes), detector={"shadow": False})


def changed_axis(folder: Path, seconds_s: float, seed: int) -> list[Frame]:
    """Frames of two axes; the friction of the first is not the configured one, from the start."""
    found = blocks(demo(folder, 2), seconds_s, seed, [Fault(AXIS, {"fm": 1.3}, 0.0)])
    return [frame for block in found for frame in block.frames()]


class Fed(Waiting):
    """A reader whose frames come from the test's thread."""

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()

    def take(self, most: int = 4096) -> FrameBlock:
        with self._lock:
            return super().take(most)

    def add(self, frames: Sequence[Frame]) -> None:
        """Let them wait."""
        with self._lock:
            self.frames += frames


class RunningCore:
    """The core of the daemon in a folder, from its start until ``close``."""

    def __init__(self, folder: Path, config: Config) -> None:
        self.config, self.reader = config, Fed()
        self.now_us = START_US
        self.journal = Journal(folder / "alarms.sqlite")
        self.checkpoints = Checkpoints(folder / "checkpoints.sqlite")
        begun = at_start(config.axes, self.journal.epochs, self.now_us)
        self.core = FramePipeline(config, begun.axes)
        monitors = self.core.monitors
        restored = bring_back(monitors, begun, self.checkpoints, self.journal, self.now_us)
        self.messages = (*begun.messages, *restored.messages)
        alarms = Alarms(self.journal, quantities(monitors.by_id))
        alarms.adopt(restored.open)
        compiled = Compiled(Future(), Future())
        for kernel in compiled:
            kernel.set_result(None)
        self.failed = threading.Event()
        recording = Recording(None)
        bounds = Bounds(dict.fromkeys(RESOLUTIONS, 1e12), 1e9)
        self.checkpointer = Checkpointer(self.checkpoints, monitors, 3600.0, lambda: self.now_us)
        parts = WorkerParts(
            self.core,
            alarms,
            HistoryRecording(lambda: HistoryStore(folder / "history.sqlite", bounds), 10.0),
            recording,
            self.checkpointer,
        )
        buses = [BusIntake("can0", self.reader, self.core.ingests["can0"], recording)]
        self.worker = Worker(
            config, parts, buses, compiled, lambda: self.now_us, self.messages, self.failed.set
        )
        self.baselines = Baselines(
            config.axes, begun.axes, self.worker, self.journal.epochs, lambda: self.now_us
        )
        self.worker.start()

    def feed(self, frames: Sequence[Frame]) -> None:
        """Let it take all samples of these frames."""
        before = sum(axis.status.samples for axis in self.worker.snapshot.axes)
        self.reader.add(frames)
        self.now_us = frames[-1].t_us

        def taken() -> bool:
            assert not self.failed.is_set(), self.worker.error
            samples = sum(axis.status.samples for axis in self.worker.snapshot.axes)
            return not self.reader.frames and samples >= before + len(frames) - 2

        wait_for(taken)

    def axis(self, axis_id: str = AXIS) -> AxisSnapshot:
        """An axis of the newest snapshot."""
        found = self.worker.snapshot.axis(axis_id)
        assert found is not None
        return found

    def epochs(self) -> list[Epoch]:
        """Those of the first axis, the newest first."""
        return self.journal.epochs.of_axis(AXIS)

    def app(self, access: Access | None = None) -> FastAPI:
        """Its web application."""
        state = AppState(
            lambda: self.worker.snapshot,
            self.journal,
            access or Access(),
            lambda: self.now_us,
            baselines=self.baselines,
        )
        return create_app(state)

    def close(self) -> None:
        """End it, with a last checkpoint."""
        self.worker.stop()
        self.journal.close()
        self.checkpoints.close()
        assert self.failed.is_set() or self.worker.error is None
