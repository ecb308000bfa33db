"""What the web reads of the daemon: the newest snapshot, the journal and a clock; and whether it is healthy."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import NamedTuple

from service.pipeline.baselines import Baselines
from service.pipeline.history_recording import HistoryRecording
from service.pipeline.live_signals import LiveSignals
from service.pipeline.recording import Extracts, RecordingFolder
from service.pipeline.replay_reports import ReplayReports
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
    """What the routes have; functions are cheap, and may be called from any thread."""

    snapshot: Callable[[], Snapshot]
    """The newest one"""
    journal: Journal
    """Of the alarms"""
    access: Access = field(default_factory=Access)
    """Who may ask; by default everyone on this machine"""
    now_us: Callable[[], int] = now_us
    """The clock for ages"""
    reports: ReportPages | None = None
    """Pages of the commissioning"""
    extracts: Extracts | None = None
    """Recordings of the frames around alarms"""
    history: HistoryRecording | None = None
    """Of the axes"""
    links: Callable[[], Sequence[LinkSnapshot]] = tuple
    """The newest state of each plant link"""
    acknowledge: Callable[[int, Note], RecordedAlarm | None] = lambda _id, _note: None
    """Acknowledges an alarm that the journal does not have yet; None: there is no such alarm"""
    baselines: Baselines | None = None
    """New epochs of axes; None: none can begin"""
    stopping: Callable[[], bool] = lambda: False
    """Whether the daemon ends: streams end then"""
    live: LiveSignals = field(default_factory=LiveSignals)
    """The last seconds of the axes"""
    setup: RobotSetup | None = None
    """The configuration and its robot; None: neither is shown"""
    replays: ReplayReports | None = None
    """Reports of replays; None: none are made"""
    prepared: "list[Latest]" = field(default_factory=list)
    """Answers that take long: the worker makes them, and nobody waits for them, nor for the interpreter meanwhile"""

    def axis(self, axis_id: str, parameter: str | None = None) -> AxisSnapshot:
        """The axis of that id now, checked to monitor ``parameter`` if one is given.

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
        """Make the answers that are asked for often, before the snapshot is shown; by the worker."""
        for answer, made in [(answer, answer.made(snapshot)) for answer in self.prepared]:
            answer.hold(made)  # only now: until then who asks for the snapshot before is not kept waiting

    @property
    def recordings(self) -> RecordingFolder | None:
        """The folder of the frames around alarms; None: none are recorded."""
        return None if self.extracts is None else self.extracts.folder


_Held = tuple[Snapshot, int, bytes]
"""An answer, of which snapshot it was made and when [us]"""


class Latest:
    """An answer made of the newest snapshot: made once, however many ask, until there is a newer one or it is too old.

    Args:
        make: from a snapshot, at a time [us].
        longest_s: how long it may be used; its ages are as old.
    """

    def __init__(self, make: Callable[[Snapshot, int], bytes], longest_s: float) -> None:
        self._make, self._longest_us = make, longest_s * 1e6
        self._lock = threading.Lock()
        self._held: _Held | None = None
        self._asked_us = 0

    def __call__(self, snapshot: Snapshot, now_us: int) -> bytes:
        """From any thread; who asks while it is being made waits for it."""
        self._asked_us = now_us
        with self._lock:
            held = self._held
            if held is None or held[0] is not snapshot or not 0 <= now_us - held[1] <= self._longest_us:
                held = self._held = (snapshot, now_us, self._make(snapshot, now_us))
            return held[2]

    def made(self, snapshot: Snapshot) -> _Held | None:
        """The answer for a snapshot that is about to be shown; None: nobody has asked for a minute, or it failed."""
        if snapshot.taken_us - self._asked_us <= _WANTED_US:
            with suppress(Exception):  # who asks makes it again, and gets the error
                return snapshot, snapshot.taken_us, self._make(snapshot, snapshot.taken_us)
        return None

    def hold(self, made: _Held | None) -> None:
        """Give this answer from now on; None: the one of before."""
        if made is not None:
            with self._lock:
                self._held = made


_WANTED_US = 60_000_000


def age_s(t_us: int, now_us: int) -> float:
    """Time since ``t_us`` [s]; 0 if ``t_us`` comes from a clock that is ahead of this one."""
    return max(0, now_us - t_us) / 1e6


def sample_age_s(axis: AxisSnapshot, now_us: int) -> float | None:
    """Age of the last sample of an axis [s]; None before the first sample."""
    return None if axis.status.time_us is None else age_s(axis.status.time_us, now_us)


OLDEST_SNAPSHOT_S = 10.0
"""The worker publishes a snapshot every second at least, with or without samples; an older one means that it hangs."""

OLDEST_SAMPLE_S = 5.0
OLDEST_SAMPLE_INTERVALS = 10
"""An axis whose last sample is older than both is not being monitored."""


def is_silent(axis: AxisSnapshot, now_us: int) -> bool:
    """Whether an axis gets no samples now."""
    age = sample_age_s(axis, now_us)
    return age is None or age > max(OLDEST_SAMPLE_S, OLDEST_SAMPLE_INTERVALS * axis.interval_s)


def is_alive(snapshot: Snapshot, now_us: int) -> bool:
    """Whether the worker still publishes snapshots."""
    return age_s(snapshot.taken_us, now_us) <= OLDEST_SNAPSHOT_S


class NotReady(NamedTuple):
    """A reason why not every axis is monitored now, or why alarms are not recorded.

    ``name``: of the bus or axis; ``state``: of the bus; ``since_s``: age of the last sample, or of the last report of
    the worker, None: there is none; ``alarms``: that are not recorded.
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
    """Reasons why not every axis is monitored now, or why alarms are not recorded; none when all is well."""
    if not is_alive(snapshot, now_us):
        yield NotReady(Lack.WORKER, since_s=age_s(snapshot.taken_us, now_us))
    yield from (NotReady(Lack.BUS, bus.name, bus.state) for bus in snapshot.buses if not bus.up)
    if waiting := snapshot.alarms.waiting:
        yield NotReady(Lack.RECORD, alarms=waiting)
    for axis in snapshot.axes:
        if is_silent(axis, now_us):
            yield NotReady(Lack.SAMPLES, axis.id, since_s=sample_age_s(axis, now_us))
