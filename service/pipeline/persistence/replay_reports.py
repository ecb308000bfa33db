"""Replay reports of alarms, made on request, one at a time, each in a process of lowest priority.

The frames around an alarm run again through the monitors of its robot, with the nominal values in force at that time.
"""

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Literal, NamedTuple

import structlog

from monitor_core.wording import Sentence, sentence
from service.config import Config
from service.pipeline.persistence.recording_folder import RecordingFolder
from service.store.alarm_table import RecordedAlarm
from service.store.epochs import Epochs

LONGEST_S = 900.0
"""Time limit of the process [s]; it takes seconds, unless the machine is very busy."""
_MOST_FAILURES = 100

_CHILD = """
import importlib, os, pickle, sys, threading
order = pickle.load(sys.stdin.buffer)
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()  # its end: the parent has ended
importlib.import_module(sys.argv[1]).write_report(order)
"""

log = structlog.get_logger(__name__)


class ReplayOrder(NamedTuple):
    """Input of the process that makes a report."""

    config: Config
    """The configuration, reduced to one robot"""
    named: str
    """Name of the configuration file"""
    epochs: Mapping[str, tuple[str, int]]
    """By axis: content and number of the epoch that was in force"""
    record: Path
    page: Path
    """Path of the report"""


class NoReplayError(Exception):
    """The report cannot be made now; the text says why."""


class ReportState(NamedTuple):
    """State of the report of an alarm."""

    state: Literal["none", "running", "made", "failed"]
    problem: str | None = None
    """Why making the report failed"""


class ReplayReports:
    """Makes reports of alarms; for use by any thread.

    Args:
        folder: the recordings.  A report is kept beside its recording, and is removed with it.
        config: returns the configuration in force.
        named: name of the configuration file.
        epochs: the epochs of the axes.
        writer: name of the module whose ``write_report`` makes the report of a ``ReplayOrder``, in the process.
    """

    def __init__(
        self, folder: RecordingFolder, config: Callable[[], Config], named: str, epochs: Epochs, writer: str
    ) -> None:
        self._folder, self._config, self._named, self._epochs = folder, config, named, epochs
        self._writer = writer
        self._lock = threading.Lock()
        self._running: int | None = None
        self._child: subprocess.Popen[bytes] | None = None
        self._failed: dict[int, str] = {}
        self._stopped = False

    def page(self, alarm: RecordedAlarm) -> Path | None:
        """Path of the report of an alarm, made or not; None: the alarm has no recording, or is not in the journal."""
        name = self._folder.holding(alarm.since_us) if alarm.recorded else None
        return None if name is None else self._folder.report(name, alarm.id)

    def state(self, alarm: RecordedAlarm) -> ReportState | None:
        """State of the report of an alarm; None: no report is possible."""
        page = self.page(alarm)
        if page is None:
            return None
        # Read both together: a process that has just ended has either made the report or failed.
        with self._lock:
            if self._running == alarm.id:
                return ReportState("running")
            problem = self._failed.get(alarm.id)
        if page.is_file():
            return ReportState("made")
        return ReportState("none") if problem is None else ReportState("failed", problem)

    def begin(self, alarm: RecordedAlarm) -> None:
        """Start to make the report of an alarm, unless that is under way; a report that exists is made again.

        Raises:
            NoReplayError: another report is being made, the alarm has no recording, or the axis is no longer
                configured.
            StoreError: the epochs cannot be read.
        """
        page, config = self.page(alarm), self._config()
        if page is None:
            raise NoReplayError(sentence("no frames of alarm", "there is no recording of this alarm"))
        own = next((axis for axis in config.axes if axis.id == alarm.axis), None)
        if own is None:
            words = "the configuration has no axis {axis} any more"
            raise NoReplayError(sentence("axis gone", words, axis=alarm.axis))
        robot = tuple(robot for robot in config.robot if robot.name == own.robot)
        config = config.model_copy(update={"robot": robot})
        epochs = {
            axis.id: (epoch.content, epoch.number)
            for axis in config.axes
            for epoch in self._epochs.of_axis(axis.id)
            if epoch.in_force_us is not None and epoch.in_force_us <= alarm.since_us < (epoch.ended_us or sys.maxsize)
        }
        name = self._folder.holding(alarm.since_us)
        assert name is not None  # otherwise ``page`` would be None
        order = ReplayOrder(config, self._named, epochs, self._folder.path / name, page)
        with self._lock:
            if self._running == alarm.id:
                return
            if self._running is not None or self._stopped:
                words = "the report of alarm {id} is being made; try again after it"
                raise NoReplayError(sentence("replay busy", words, id=self._running or alarm.id))
            self._running = alarm.id
            self._failed.pop(alarm.id, None)
        threading.Thread(target=self._make, args=(alarm.id, order), name="replay", daemon=True).start()

    def stop(self) -> None:
        """End the process that makes a report."""
        with self._lock:
            self._stopped = True
            if self._child is not None:
                self._child.kill()

    def _make(self, alarm_id: int, order: ReplayOrder) -> None:
        problem: str | None = _ENDED
        try:
            problem = self._run(order)
        except OSError as error:
            problem = str(error)
        finally:
            with self._lock:
                self._running = self._child = None
                if problem is not None:
                    self._failed = dict([*self._failed.items(), (alarm_id, problem)][-_MOST_FAILURES:])
        if problem is None:
            log.info("replay report made", alarm=alarm_id, file=order.page.name)
        elif not self._stopped:
            log.warning("no replay report", alarm=alarm_id, reason=problem)

    def _run(self, order: ReplayOrder) -> str | None:
        """Let a process make the report; returns why it failed, or None."""
        with self._lock:
            if self._stopped:
                return _ENDED
            child = self._child = subprocess.Popen(
                [sys.executable, "-P", "-c", _CHILD, self._writer],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                process_group=0,
            )
        limit = threading.Timer(LONGEST_S, child.kill)
        limit.start()
        messages = ""
        try:
            # If the child ends before it has read its order, writing to the pipe fails, and so does closing it.
            with suppress(BrokenPipeError), child:
                assert child.stdin is not None
                assert child.stderr is not None
                # The pipe stays open: its end tells the child that the daemon has ended.
                with suppress(BrokenPipeError):
                    child.stdin.write(pickle.dumps(order))
                    child.stdin.flush()
                messages = child.stderr.read().decode(errors="replace").strip()
        finally:
            limit.cancel()
        if child.returncode == 0:
            return None
        return (messages.rpartition("\n")[2] if child.returncode > 0 else "") or _ENDED


_ENDED: Sentence = sentence("replay ended", "its process was ended, perhaps because memory or time ran out; try again")


def give_way() -> None:
    """Take the lowest priority, and be the first process that the kernel ends when memory runs out."""
    os.nice(19)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
