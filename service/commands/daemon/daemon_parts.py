"""The parts of the daemon: opens, restores and connects them."""

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import structlog

from monitor_core.wording import sentence
from service.can.bus import blf_channels
from service.can.frame_recorder import FrameRecorder
from service.commands.command_line.signal_handling import stopped_by_signals
from service.commands.daemon.plant_links import PlantLinks
from service.config import Config
from service.pipeline.axes.axis_alarms import alarm_groups, alarm_rules, quantities
from service.pipeline.axes.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.bus_readers import BusReaders
from service.pipeline.kernel_cache import EARLY, CacheFiller, KernelShape, batch_shape
from service.pipeline.persistence.alarm_recording import AlarmRecorder
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.history_recording import HistoryRecording
from service.pipeline.persistence.recording import Extracts, Recording
from service.pipeline.persistence.recording_folder import RecordingFolder
from service.pipeline.persistence.wall_clock import WallClock
from service.pipeline.publishing import WorkerParts
from service.pipeline.reconfiguration.baselines import Baselines
from service.pipeline.reconfiguration.epochs_at_start import EpochsInForce, epochs_in_force, resume_monitors
from service.pipeline.reconfiguration.reloading import ReloadedPart, Reloading
from service.pipeline.worker import Compiled, Worker
from service.store.checkpoints import Checkpoints
from service.store.history_store import Bounds, HistoryStore, Resolution
from service.store.journal import Journal
from service.texts.instants import now_us

ALARMS_FILE, CHECKPOINTS_FILE, HISTORY_FILE = "alarms.sqlite", "checkpoints.sqlite", "history.sqlite"
"""Names of files in the state directory"""

log = structlog.get_logger(__name__)


class DaemonParts:
    """The connected parts of the daemon; the stack closes them in reverse order."""

    def __init__(self, config: Config, record: Path | None, stop: threading.Event, stack: ExitStack) -> None:
        self.config = config
        self.state = _open_state(config, stack)
        begun = self.state.begun
        self.pipeline = FramePipeline(config, begun.axes)
        self.compiled = _in_background(config, stack)
        self.buses = BusReaders(config, self.pipeline.ingests)
        stack.callback(self.buses.close)
        self.extracts = _extracts(config)
        recording = Recording(FrameRecorder(record) if record else None, self.extracts)
        stack.callback(recording.close)
        monitors = self.pipeline.monitors
        self.saver = Checkpointer(self.state.checkpoints, monitors, config.service.checkpoint_interval_s, now_us)
        clock = WallClock()
        alarms, messages = _restored(config, monitors, self.state, self.saver, clock)
        intakes = self.buses.intakes(self.pipeline.ingests, recording)
        worker_parts = WorkerParts(self.pipeline, alarms, self.state.history, recording, self.saver)
        self.worker = Worker(config, worker_parts, intakes, self.compiled, clock, messages, stop.set)
        self.baselines = Baselines(config.axes, begun.axes, self.worker, self.state.journal.epochs, now_us)
        stack.enter_context(stopped_by_signals(stop))
        stack.callback(self.worker.stop)
        stack.callback(self.baselines.stop)
        stack.callback(self.buses.close)
        self.links = PlantLinks(config, self.state.journal, lambda: self.worker.snapshot, self.extracts)
        stack.callback(self.links.stop)

    def start(self) -> None:
        """Start readers, worker, history and links, and resume baselines that were in progress."""
        self.buses.start(self.worker.frames_arrived)
        self.worker.start()
        self.state.history.start()
        self.links.start()
        self.baselines.start()

    def reloading(self, further: Sequence[ReloadedPart]) -> Reloading:
        """Object that applies a new configuration; ``further``: other parts to replace."""
        return Reloading(self.config, self.worker, self.baselines, self.buses, self.state.journal, now_us, further)

    def problems(self) -> dict[str, str | None]:
        """Faults of files in the state directory that cannot be written now, by file."""
        snapshot = self.worker.snapshot
        waiting = snapshot.alarms.waiting
        words = sentence("alarms wait", "alarms that are not recorded yet: {alarms}", alarms=waiting)
        return {
            ALARMS_FILE: words if waiting else None,
            CHECKPOINTS_FILE: self.saver.problem,
            HISTORY_FILE: snapshot.history.problem,
        }


class _State(NamedTuple):
    """Contents of the state directory, and the epochs in force."""

    journal: Journal
    checkpoints: Checkpoints
    history: HistoryRecording
    begun: EpochsInForce


def _open_state(config: Config, stack: ExitStack) -> _State:
    """Open the files of the state directory; they are closed at the end of the block."""
    kept = config.service
    journal = Journal(kept.state_dir / ALARMS_FILE)
    stack.callback(journal.close)
    checkpoints = Checkpoints(kept.state_dir / CHECKPOINTS_FILE)
    stack.callback(checkpoints.close)
    ages_s: dict[Resolution, float] = {
        "raw": kept.history_raw_days * 86400,
        "minute": kept.history_minute_days * 86400,
        "hour": kept.history_hour_days * 86400,
        "day": kept.history_day_days * 86400,
    }
    bounds = Bounds(ages_s, kept.history_mb * 1e6)
    history = HistoryRecording(lambda: HistoryStore(kept.state_dir / HISTORY_FILE, bounds), kept.history_interval_s)
    stack.callback(history.stop)
    return _State(journal, checkpoints, history, epochs_in_force(config.axes, journal.epochs, now_us()))


def _restored(
    config: Config, monitors: AxisMonitors, state: _State, saver: Checkpointer, clock: WallClock
) -> tuple[AlarmRecorder, tuple[str, ...]]:
    """Make the alarms of the journal agree with the restored monitors; returns messages for the operator."""
    restored = resume_monitors(monitors, state.begun, state.checkpoints, state.journal, now_us())
    saver.saved_us = restored.checkpoint_us
    known = quantities(monitors.by_id)
    state.journal.group(alarm_groups(config.axes))
    alarms = AlarmRecorder(state.journal, known, rules=alarm_rules(config.axes, known), wall=clock)
    alarms.adopt(restored.open)
    alarms.record(restored.changes)
    messages = (*state.begun.messages, *restored.messages)
    for message in (*messages, *monitors.restarted_windows):
        log.warning("start", message=message)
    return alarms, messages


def _extracts(config: Config) -> Extracts | None:
    """The recorder of frames around alarms; None: the configuration allows no space for it."""
    kept = config.service
    if not kept.recordings_mb:
        return None
    folder = RecordingFolder(
        kept.state_dir / "recordings",
        round(kept.recordings_mb * 1e6),
        blf_channels(config.bus) if kept.recording_format == "blf" else None,
    )
    return Extracts(folder, kept.recording_before_s, kept.recording_after_s, now_us)


def needs_cyclic_clock(config: Config) -> bool:
    """Whether the clock of an axis is fitted to its cycles, since it has no sample counter."""
    return any(axis.config.time.clock == "cyclic" for axis in config.axes)


_LONGEST_LOAD_S = 5.0
"""How long a stop waits for a kernel that is being loaded [s]"""


def _in_background(config: Config, stack: ExitStack) -> Compiled:
    """Compile the kernels, or load them from the cache, during the start; the kernel of the estimates first.

    On two processors compiling both in parallel would be slower.  It uses monitors of its own, since those of the
    worker belong to one thread.
    """
    compiled = Compiled(Future(), Future())
    filler = EARLY if EARLY.begun else CacheFiller()

    def compile_kernel() -> None:
        try:
            monitors = AxisMonitors(config.axes)
            shapes = {batch_shape(lanes) for lanes in monitors.batch_sizes}
            if needs_cyclic_clock(config):
                shapes.add(KernelShape.CYCLIC_CLOCK)
            if filler.fill(shapes):
                monitors.compile()
                compiled.estimates.set_result(None)
            if filler.fill({KernelShape.MULTIMODEL} if monitors.multimodel else ()):
                monitors.compile_multimodel()
                compiled.multimodel.set_result(None)
        except BaseException as error:
            for done in compiled:
                if not done.done():
                    done.set_exception(error)

    thread = threading.Thread(target=compile_kernel, name="compiler", daemon=True)
    thread.start()
    # Loading creates finalizers. Python runs all of them at exit, and their list must not grow at that time.
    stack.callback(thread.join, _LONGEST_LOAD_S)
    stack.callback(filler.stop)
    return compiled
