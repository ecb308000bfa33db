"""The core of the daemon with real monitors, journal and checkpoints; a test feeds it frames."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import NoReturn

from fastapi import FastAPI

from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame, FrameBlock
from service.config import Config
from service.pipeline.axes.axis_alarms import quantities
from service.pipeline.axes.axis_monitors import FramePipeline
from service.pipeline.bus_readers import BusIntake
from service.pipeline.persistence.alarm_recording import AlarmRecorder
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.history_recording import HistoryRecording
from service.pipeline.persistence.recording import Recording
from service.pipeline.persistence.wall_clock import WallClock
from service.pipeline.publishing import WorkerParts
from service.pipeline.reconfiguration.baselines import Baselines
from service.pipeline.reconfiguration.epochs_at_start import epochs_in_force, resume_monitors
from service.pipeline.snapshot import AxisSnapshot
from service.pipeline.worker import Compiled, Worker
from service.simulation.robot import SimulatedFault
from service.store.checkpoints import Checkpoints
from service.store.epochs import Epoch
from service.store.history_store import RESOLUTIONS, Bounds, HistoryStore
from service.store.journal import Journal
from service.web.access import Access
from service.web.app import create_app
from service.web.app_state import AppState
from service.web.report_pages import ReportPages
from service.web.robot_setup import NoLookError, RobotSetup
from tests.end_to_end.processes import wait_for
from tests.service.pipeline.robots import START_US, Waiting, blocks, changed, demo

AXIS, OTHER = "demo.axis1", "demo.axis2"
NOW_US = 1_760_000_100_000_000
"""Of a clock that stands still."""
TRUTH = 1.3 * 0.06
"""Friction of the first axis; the configuration has 0.06."""


def cell(folder: Path, axes: int = 2) -> Config:
    """The demo without the multi-model detectors, which take most of the time to start."""
    return changed(demo(folder, axes, checkpoint_interval_s=3600.0), detector={"shadow": False})


def changed_axis(folder: Path, seconds_s: float, seed: int) -> list[Frame]:
    """Frames of two axes; the friction of the first is not the configured one, from the start."""
    found = blocks(demo(folder, 2), seconds_s, seed, [SimulatedFault(AXIS, {"fm": 1.3}, 0.0)])
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


class StandingCore:
    """The core of the daemon in a folder, whose worker has not been started.

    Args:
        folder: of its files.
        config: the configuration.
        reader: what the worker takes its frames from.
        recorder: of all frames.
        clock_us: the time of the day.
        wall: the same where it is looked at for steps.
        start_messages: further messages of the start.
    """

    def __init__(
        self,
        folder: Path,
        config: Config,
        reader: Waiting,
        recorder: FrameRecorder | None = None,
        clock_us: Callable[[], int] = lambda: NOW_US,
        wall: WallClock | None = None,
        start_messages: Sequence[str] = (),
    ) -> None:
        self.config = config
        self.journal = Journal(folder / "alarms.sqlite")
        self.checkpoints = Checkpoints(folder / "checkpoints.sqlite")
        self.begun = epochs_in_force(config.axes, self.journal.epochs, clock_us())
        self.core = FramePipeline(config, self.begun.axes)
        monitors = self.core.monitors
        restored = resume_monitors(monitors, self.begun, self.checkpoints, self.journal, clock_us())
        self.messages = (*self.begun.messages, *restored.messages, *start_messages)
        alarms = AlarmRecorder(self.journal, quantities(monitors.by_id), wall=wall)
        alarms.adopt(restored.open)
        self.compiled = Compiled(Future(), Future())
        self.failed = threading.Event()
        self.recording = Recording(recorder)
        bounds, service = Bounds(dict.fromkeys(RESOLUTIONS, 1e12), 1e9), config.service
        self.history = HistoryRecording(
            lambda: HistoryStore(folder / "history.sqlite", bounds), service.history_interval_s
        )
        self.checkpointer = Checkpointer(self.checkpoints, monitors, service.checkpoint_interval_s, clock_us)
        self.worker = Worker(
            config,
            WorkerParts(self.core, alarms, self.history, self.recording, self.checkpointer),
            [BusIntake("can0", reader, self.core.ingests["can0"], self.recording)],
            self.compiled,
            wall or clock_us,
            self.messages,
            self.failed.set,
        )

    def compile(self) -> None:
        """The kernels are ready from now on."""
        for kernel in self.compiled:
            kernel.set_result(None)

    def run(self) -> Worker:
        """To the end of the frames, with kernels that are ready at once."""
        self.compile()
        self.worker.start()
        self.worker.stop()
        return self.worker

    def close(self) -> None:
        """Its files."""
        self.history.stop()
        self.journal.close()
        self.checkpoints.close()


def _no_look(axis_id: str) -> NoReturn:
    raise NoLookError(f"no frames of {axis_id} are kept")


class RunningCore(StandingCore):
    """The core of the daemon in a folder, from its start until ``close``; its clock is that of the last frame."""

    def __init__(self, folder: Path, config: Config) -> None:
        self.reader, self.now_us, self.stopping, self._folder = Fed(), START_US, False, folder
        super().__init__(folder, config, self.reader, clock_us=lambda: self.now_us)
        self.baselines = Baselines(config.axes, self.begun.axes, self.worker, self.journal.epochs, lambda: self.now_us)
        self.compile()
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
            RobotSetup(lambda: self.config, self._folder / "axiswatch.toml", _no_look),
            ReportPages(self._folder, ()),
            access or Access(),
            lambda: self.now_us,
            baselines=self.baselines,
        )
        return create_app(state)

    def close(self) -> None:
        """End it, with a last checkpoint."""
        self.worker.stop()
        super().close()
        assert self.failed.is_set() or self.worker.error is None


def seconds(frames: Sequence[Frame], begin: float, end: float) -> list[Frame]:
    return [f for f in frames if begin <= (f.t_us - START_US) / 1e6 < end]


def states(daemon: RunningCore, axis_id: str) -> bytes:
    arrays = daemon.core.monitors.by_id[axis_id].to_arrays()
    return b"".join(arrays[name].tobytes() for name in sorted(arrays))
