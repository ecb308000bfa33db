"""The parts of the daemon that the web uses, cached answers, and whether the daemon is healthy."""

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from service.pipeline.axes.live_signals import LiveSignals
from service.pipeline.persistence.history_recording import HistoryRecording
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.replay_reports import ReplayReports
from service.pipeline.reconfiguration.baselines import Baselines
from service.pipeline.silence import silent_after_s
from service.pipeline.snapshot import AxisSnapshot, LinkSnapshot, Snapshot
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note
from service.store.journal import Journal
from service.texts.instants import now_us
from service.web.access import Access
from service.web.models import Lack
from service.web.problem_details import UnknownResourceError
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup

VERSION = version("axiswatch")


@dataclass(frozen=True, slots=True)
class AppState:
    """The parts of the daemon that the routes use; its functions are fast, and may be called from any thread."""

    snapshot: Callable[[], Snapshot]
    """Returns the newest snapshot"""
    journal: Journal
    """The alarm journal"""
    setup: RobotSetup
    """The configuration"""
    reports: ReportPages
    """Reports of the commissioning"""
    access: Access = field(default_factory=Access)
    """Access control; by default everyone on this machine has access"""
    now_us: Callable[[], int] = now_us
    """Wall clock, for ages"""
    extracts: Extracts | None = None
    """Recordings of the frames around alarms"""
    history: HistoryRecording | None = None
    """The history of the axes"""
    links: Callable[[], Sequence[LinkSnapshot]] = tuple
    """Returns the state of each plant link"""
    acknowledge: Callable[[int, Note], RecordedAlarm | None] = lambda _id, _note: None
    """Acknowledges an alarm that is not recorded yet; returns None if there is no such alarm"""
    baselines: Baselines | None = None
    """Starts new epochs of axes; None: not possible"""
    stopping: Callable[[], bool] = lambda: False
    """Whether the daemon is stopping, so that streams must end"""
    live: LiveSignals = field(default_factory=LiveSignals)
    """Signals of the last seconds"""
    replays: ReplayReports | None = None
    """Replay reports; None: none are made"""
    prepared: "list[CachedAnswer]" = field(default_factory=list)
    """Slow answers that the worker makes in advance, so that no request waits for them"""

    def axis(self, axis_id: str, parameter: str | None = None) -> AxisSnapshot:
        """The present snapshot of an axis; if ``parameter`` is given, check that the axis monitors it.

        Raises:
            UnknownResourceError: there is no such axis or parameter.
        """
        snapshot = self.snapshot()
        found = snapshot.axis(axis_id)
        if found is None:
            raise UnknownResourceError(f"there is no axis {axis_id!r}", [axis.id for axis in snapshot.axes])
        names = [p.name for p in found.status.parameters]
        if parameter is not None and parameter not in names:
            raise UnknownResourceError(f"{axis_id} has no monitored parameter {parameter!r}", names)
        return found

    def prepare(self, snapshot: Snapshot) -> None:
        """Make the frequently requested answers before the snapshot is published; called by the worker."""
        # Held only when all are made, so that requests for the former snapshot need not wait.
        for answer, made in [(answer, answer.made(snapshot)) for answer in self.prepared]:
            answer.hold(made)

    def recording_of(self, t_us: int, files: Iterable[Path] | None = None) -> str | None:
        """Name of the file with the raw frames of a time; None: there is none (yet).

        ``files``: those to search; None: all.
        """
        return None if self.extracts is None else self.extracts.folder.holding(t_us, files)


_Held = tuple[Snapshot, int, bytes]
"""Snapshot of an answer, time at which the answer was made [us], and the answer"""


class CachedAnswer:
    """An answer made from the newest snapshot, once for all requests, until there is a newer one or it is too old.

    Args:
        make: makes the answer from a snapshot at a time [us].
        longest_s: longest time for which the answer is used [s]; ages in it are wrong by up to this.
    """

    def __init__(self, make: Callable[[Snapshot, int], bytes], longest_s: float) -> None:
        self._make, self._longest_us = make, longest_s * 1e6
        self._lock = threading.Lock()
        self._held: _Held | None = None
        self._asked_us = 0

    def __call__(self, snapshot: Snapshot, now_us: int) -> bytes:
        """The answer; from any thread.  A request waits while the answer is being made."""
        self._asked_us = now_us
        with self._lock:
            held = self._held
            if held is None or held[0] is not snapshot or not 0 <= now_us - held[1] <= self._longest_us:
                held = self._held = (snapshot, now_us, self._make(snapshot, now_us))
            return held[2]

    def made(self, snapshot: Snapshot) -> _Held | None:
        """Make the answer for a snapshot in advance; None: no request in the last minute, or an error."""
        if snapshot.taken_us - self._asked_us <= _WANTED_US:
            with suppress(Exception):  # the next request makes it again, and gets the error
                return snapshot, snapshot.taken_us, self._make(snapshot, snapshot.taken_us)
        return None

    def hold(self, made: _Held | None) -> None:
        """Use this answer from now on; None: keep the former one."""
        if made is not None:
            with self._lock:
                self._held = made


_WANTED_US = 60_000_000


def age_s(t_us: int, now_us: int) -> float:
    """Time since ``t_us`` [s]; 0 if ``t_us`` is from a clock that is ahead."""
    return max(0, now_us - t_us) / 1e6


def sample_age_s(axis: AxisSnapshot, now_us: int) -> float | None:
    """Age of the last sample of an axis [s]; None: no sample yet."""
    last_us = axis.status.time_us if axis.silent_since_us is None else axis.silent_since_us
    return None if last_us is None else age_s(last_us, now_us)


OLDEST_SNAPSHOT_S = 10.0
"""Age at which a snapshot means that the worker hangs; it publishes at least every second, even without samples."""


def is_silent(axis: AxisSnapshot, now_us: int) -> bool:
    """Whether an axis receives no samples now."""
    age = sample_age_s(axis, now_us)
    return age is None or age > silent_after_s(axis.interval_s)


def is_alive(snapshot: Snapshot, now_us: int) -> bool:
    """Whether the worker still publishes snapshots."""
    return age_s(snapshot.taken_us, now_us) <= OLDEST_SNAPSHOT_S


class NotReady(NamedTuple):
    """A reason why not every axis is monitored now, or why alarms are not recorded.

    ``name``: name of the bus or axis; ``state``: state of the bus; ``since_s``: age of the last sample, or of the last
    report of the worker, None: there is none; ``alarms``: number of unrecorded alarms.
    """

    lack: Lack
    name: str = ""
    state: str = ""
    since_s: float | None = None
    alarms: int = 0

    @property
    def words(self) -> str:
        """The reason as a sentence."""
        if self.lack is Lack.WORKER:
            return f"the worker has not reported for {self.since_s:.0f} s"
        if self.lack is Lack.BUS:
            return f"bus {self.name}: {self.state}"
        if self.lack is Lack.RECORD:
            return f"alarms that are not yet recorded: {self.alarms}; the messages say why"
        since = "no sample yet" if self.since_s is None else f"no sample for {self.since_s:.0f} s"
        return f"{self.name}: {since}"


def reasons_not_ready(snapshot: Snapshot, now_us: int) -> Iterator[NotReady]:
    """Reasons why not every axis is monitored now, or why alarms are not recorded."""
    if not is_alive(snapshot, now_us):
        yield NotReady(Lack.WORKER, since_s=age_s(snapshot.taken_us, now_us))
    yield from (NotReady(Lack.BUS, bus.name, bus.state) for bus in snapshot.buses if not bus.up)
    if waiting := snapshot.alarms.waiting:
        yield NotReady(Lack.RECORD, alarms=waiting)
    for axis in snapshot.axes:
        if is_silent(axis, now_us):
            yield NotReady(Lack.SAMPLES, axis.id, since_s=sample_age_s(axis, now_us))
