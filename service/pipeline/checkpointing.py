"""Saves the states of all monitors at intervals and at the end, and restores them at the start."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from time import monotonic
from typing import Literal, NamedTuple

import numpy as np
import structlog

from monitor_core.arrays import Arrays, Floats
from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisMonitor
from monitor_core.trend import SlowHistory
from monitor_core.wording import joined, sentence
from service.pipeline.axis_alarms import AxisAlarm
from service.pipeline.axis_monitors import AxisMonitors
from service.pipeline.axis_pipeline import AxisPipeline
from service.pipeline.pauses import with_pauses
from service.pipeline.trends import Trends, completed_id, gathered_id
from service.store.alarm_filter import AlarmFilter
from service.store.checkpoints import Checkpoint, Checkpoints, MonitorState, QuarantinedCheckpoint
from service.store.database import StoreError
from service.store.journal import Journal

log = structlog.get_logger(__name__)

THERMAL_SCHEMA = "thermal schema=2"
"""Start of the key of a saved warm-up state.  The rest of the key is the thermal model, without its initial state and
its missing parameters."""
STARTS_SCHEMA = "starts schema=1"
"""Key of the saved starts of the motion, which belong to the robot and not to its model"""

MOST_REOPENED = 20
"""Number of the latest ended alarms that the monitor of an axis gets at the start, as it may reopen them"""

StatePart = Literal["estimates", "multimodel", "thermal", "learning", "history"]


class SavedState(NamedTuple):
    """One separately saved state of an axis: its name and key, and how to save and restore it."""

    part: StatePart
    name: str
    key: str
    arrays: Callable[[], Arrays | None]
    """Returns the arrays to save; None: there is no state yet"""
    restore: Callable[[Arrays], None]


def states_of(axis: AxisPipeline) -> Iterator[SavedState]:
    """The saved states of an axis: estimates, evidence of the multi-model detector, learning window, warm-up state.

    An axis without a warm-up state has the starts of its motion instead.  All but these two belong to one epoch and
    have it in their keys.
    """
    axis_id, monitor, epoch = axis.config.id, axis.monitor, axis.epoch
    key = epoch.key(monitor.key)
    yield SavedState("estimates", axis_id, key, monitor.to_arrays, monitor.from_arrays)
    multimodel = monitor.multimodel
    if multimodel is not None:
        yield SavedState(
            "multimodel",
            f"{axis_id} (multi-model detector)",
            epoch.key(monitor.multimodel_key),
            multimodel.to_arrays,
            multimodel.from_arrays,
        )
    if epoch.learning is not None:
        number, window, _ = epoch.learning
        key = f"learning window 1 for epoch {number} of {window.length_s:g} s {monitor.key}"
        name = f"{axis_id} (learning window)"
        yield SavedState("learning", name, key, window.to_arrays, window.from_arrays)
    operating, starts = axis.operating, axis.unrecorded_heat
    if operating is not None and operating.thermal is not None:
        m = operating.thermal.model
        tau = " ".join(f"tau={tau_s}" for tau_s, _ in m.parts)
        key = f"{THERMAL_SCHEMA} {tau} fm={m.fm} fc={m.fc} largest={m.largest} ambient={m.ambient}"
        name = f"{axis_id} (warm-up state)"
        yield SavedState("thermal", name, key, operating.to_arrays, operating.from_arrays)
    if starts is not None:
        name = f"{axis_id} (starts of the motion)"
        yield SavedState("thermal", name, STARTS_SCHEMA, starts.to_arrays, starts.from_arrays)


class Checkpointer:
    """Saves the states of all monitors in one transaction, so that they belong to the same time.

    Args:
        checkpoints: the store.
        monitors: the monitors of all axes, with their long-term trends.
        interval_s: time between two checkpoints [s].
        now_us: wall clock.
    """

    def __init__(
        self,
        checkpoints: Checkpoints,
        monitors: AxisMonitors,
        interval_s: float,
        now_us: Callable[[], int],
    ) -> None:
        self.checkpoints, self._monitors, self._interval_s = checkpoints, monitors, interval_s
        self._now_us = now_us
        self._due = monotonic() + interval_s
        self.saved_us: int | None = None
        """Time of the last checkpoint, which may be from an earlier run [us]; None: there is none"""
        self.problem: str | None = None
        """Message to the operator: why the last checkpoint failed; None: it did not fail."""

    def save_soon(self) -> None:
        """Make the next checkpoint due now, as monitors have been replaced."""
        self._due = monotonic()

    def save_if_due(self) -> None:
        """Save when the interval is over."""
        if monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Save now; a failure is reported to the operator and retried after the interval."""
        self._due = monotonic() + self._interval_s
        now_us = self._now_us()
        states = [*with_pauses(self._states()), *with_pauses(self._monitors.trends.to_save())]
        try:
            self.checkpoints.save(states, now_us)
        except StoreError as error:
            if self.problem is None:
                log.error("checkpoint failed; retrying", reason=str(error))
            self.problem = sentence("not saved", "the state of the monitors cannot be saved: {why}", why=error.args[0])
            return
        if self.problem is not None:
            log.info("checkpoints are saved again")
        self.saved_us, self.problem = now_us, None
        self._monitors.trends.saved()

    def _states(self) -> Iterator[MonitorState]:
        for axis in self._monitors.axes.values():
            for state in states_of(axis):
                arrays = state.arrays()
                if arrays is not None:
                    yield MonitorState(state.name, state.key, arrays)


# --- Restart: estimates and trends from the checkpoints, open alarms from the journal, a report of what was lost ------


PART_NAMES: Mapping[StatePart, str] = {
    "estimates": sentence("part estimates", "the estimates"),
    "multimodel": sentence("part evidence", "the evidence of the multi-model detector"),
    "thermal": sentence("part warmth", "the warm-up state"),
    "learning": sentence("part window", "the learning window"),
    "history": sentence("part history", "the long-term history"),
}


class LostState(NamedTuple):
    """A saved state that cannot be used and was quarantined."""

    axis_id: str
    part: StatePart
    reason: str
    parameter: str = ""
    """The parameter of a lost history; empty: the open entries of all parameters"""


class Restored(NamedTuple):
    """Result of a restore.

    ``open``: alarms that are open in the journal.  ``changes``: changes that the journal does not have yet, namely
    alarms from the checkpoint, and ends of forecast alarms whose limit is no longer configured.  ``messages``: what was
    lost, for the operator.
    """

    checkpoint_us: int | None
    open: tuple[AxisAlarm, ...]
    changes: tuple[AxisAlarm, ...]
    messages: tuple[str, ...]


class _Loader:
    """Loads checkpoints.  One that cannot be used is quarantined and added to ``losses``."""

    def __init__(self, checkpoints: Checkpoints, now_us: int) -> None:
        self._checkpoints, self._now_us = checkpoints, now_us
        self.losses: list[LostState] = []

    def load(self, loss: LostState, name: str, key: str) -> Checkpoint | None:
        found = self._checkpoints.load(name, key, self._now_us)
        if isinstance(found, QuarantinedCheckpoint):
            self.losses.append(loss._replace(reason=found.reason))
            return None
        return found

    def use(self, loss: LostState, name: str, restore: Callable[[Arrays], None], arrays: Arrays) -> bool:
        """Restore a state; returns whether the arrays fit it."""
        try:
            restore(dict(arrays))
        except (KeyError, ValueError) as error:
            reason = sentence("version", "it does not fit this version ({why})", why=error)
            self._checkpoints.quarantine(name, reason, self._now_us)
            self.losses.append(loss._replace(reason=reason))
            return False
        return True


def restore(
    monitors: AxisMonitors,
    checkpoints: Checkpoints,
    journal: Journal,
    now_us: int,
    configured: Collection[str] | None = None,
) -> Restored:
    """Restore the monitors and their trends to the state of the last run.

    ``configured``: ids of all configured axes, if ``monitors`` has only some of them.

    The journal decides which alarms are open and which have ended, as it may be newer than the checkpoint.  An alarm is
    taken from the checkpoint only if the journal has never seen it: the journal's file was damaged and created again.

    Raises:
        StoreError: a file cannot be read or written.
    """
    messages: list[str] = [*checkpoints.messages, *journal.messages]
    loader, times = _Loader(checkpoints, now_us), list[int]()
    opened: list[AxisAlarm] = []
    changes: list[AxisAlarm] = []
    for axis_id, axis in monitors.axes.items():
        monitor = axis.monitor
        for state in states_of(axis):
            loss = LostState(axis_id, state.part, "")
            found = loader.load(loss, state.name, state.key)
            if found is not None and loader.use(loss, state.name, state.restore, found.arrays):
                times.append(found.at_us)
        messages += _close_unmonitored(axis_id, monitor.causes, journal, now_us)
        recorded = journal.open_alarms(axis_id)
        opened += [AxisAlarm(axis_id, alarm) for alarm in recorded]
        own = [alarm for alarm in recorded if alarm.kind != "forecast"]  # those belong to the trends
        changes += [AxisAlarm(axis_id, alarm) for alarm in _adopt(axis_id, monitor, own, journal)]
    for axis_id in sorted({a.axis for a in journal.standing()}.difference(configured or monitors.by_id)):
        messages += _close_unmonitored(axis_id, (), journal, now_us)
    _restore_trends(monitors.trends, loader)
    changes += monitors.trends.adopt(opened, now_us)
    messages += loss_messages(loader.losses)
    return Restored(min(times, default=None), tuple(opened), tuple(changes), tuple(messages))


def _restore_trends(trends: Trends, loader: _Loader) -> None:
    """Restore the histories.  One that is damaged, or has other nominal values, is counted as lost and starts empty."""
    for axis_id, (names, monitor, key) in trends.axes.items():
        each = [(LostState(axis_id, "history", "", name), completed_id(axis_id, name)) for name in names]
        completed = [loader.load(loss, name, key) for loss, name in each]
        open_state = loader.load(LostState(axis_id, "history", ""), gathered_id(axis_id), key)
        open_entries = {} if open_state is None else open_state.arrays
        for (loss, name), history, found in zip(each, monitor.histories, completed, strict=True):
            nothing: Arrays = {"entries": history.closed_to_array()}
            resume = partial(_restore_history, history, np.asarray(open_entries.get(loss.parameter, ()), float))
            loader.use(loss, name, resume, nothing if found is None else found.arrays)
    trends.resume(loss.axis_id for loss in loader.losses if loss.part == "history")


def _restore_history(history: SlowHistory, open_entries: Floats, arrays: Arrays) -> None:
    history.restore(np.asarray(arrays["entries"], float), open_entries)


# --- open alarms ----------------------------------------------------------------------------------------


def _close_unmonitored(axis_id: str, causes: Collection[str], journal: Journal, now_us: int) -> list[str]:
    """End alarms of causes or axes that are no longer monitored, as no detector would ever end them."""
    ended = journal.close_unmonitored(axis_id, causes, now_us)
    words = "{axis}: the alarm of {name} was ended: that is no longer monitored"
    return [sentence("unmonitored", words, axis=axis_id, name=a.parameter) for a in ended]


def _adopt(axis_id: str, monitor: AxisMonitor, recorded: Iterable[Alarm], journal: Journal) -> list[Alarm]:
    """Pass the journal's open alarms to the monitor; returns alarms of the monitor that the journal has never seen."""
    in_journal = {alarm.key: alarm for alarm in recorded}
    ended = [a for a in journal.ended_alarms(axis_id, MOST_REOPENED) if a.parameter in monitor.causes]
    unknown = [a for a in monitor.open_alarms if a.key not in in_journal and not _is_known(axis_id, a, journal)]
    monitor.adopt([*in_journal.values(), *unknown], ended)
    return unknown


def _is_known(axis_id: str, alarm: Alarm, journal: Journal) -> bool:
    found, _ = journal.query(AlarmFilter(axis_id, since_us=alarm.raised_us, until_us=alarm.raised_us + 1))
    return any(recorded.first == alarm.first for recorded in found)


# --- report ---------------------------------------------------------------------------------------------


def loss_messages(losses: Iterable[LostState]) -> Iterator[str]:
    """One message for each axis: why its checkpoint is not used, and what restarts as a result."""
    by_axis: dict[str, list[LostState]] = {}
    for loss in losses:
        by_axis.setdefault(loss.axis_id, []).append(loss)
    for axis_id, lost in by_axis.items():
        by_reason: dict[str, list[LostState]] = {}
        for loss in lost:
            by_reason.setdefault(loss.reason, []).append(loss)
        reasons = [
            sentence("lost", "{why} (restarted: {parts})", why=reason, parts=_parts(found))
            for reason, found in by_reason.items()
        ]
        why = joined(reasons)
        if "estimates" in {loss.part for loss in lost}:
            words = "{axis}: its checkpoint is not used and was quarantined: {why}"
            yield sentence("not used", words, axis=axis_id, why=why)
        else:
            words = "{axis}: part of its checkpoint is not used and was quarantined: {why}"
            yield sentence("part not used", words, axis=axis_id, why=why)


def _parts(losses: list[LostState]) -> str:
    """The list of lost parts in words, e.g. "the estimates, and the long-term history of kT and fm"."""
    found = list[str]()
    for part, name in PART_NAMES.items():
        of_part = [loss for loss in losses if loss.part == part]
        parameters = list(dict.fromkeys(loss.parameter for loss in of_part if loss.parameter))
        if of_part:
            names = joined(parameters, ", and ")
            found.append(sentence("part of", "{part} of {names}", part=name, names=names) if parameters else name)
    return joined(found, ", and ")
