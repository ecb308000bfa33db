"""Checkpoints of all monitors, at an interval and at the end; and the restart from them."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from time import monotonic
from typing import Literal, NamedTuple

import numpy as np
import structlog

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.drive import Operating
from monitor_core.monitoring import Arrays, AxisMonitor
from monitor_core.trend import SlowHistory
from monitor_core.wording import joined, sentence
from service.pipeline.alarm_recording import AxisAlarm
from service.pipeline.axis_monitors import AxisMonitors
from service.pipeline.epoch_progress import EpochProgress
from service.pipeline.giving_way import giving_way
from service.pipeline.trends import Trends, completed_id, gathered_id
from service.store.checkpoints import AxisState, Checkpoint, Checkpoints, QuarantinedCheckpoint
from service.store.database import StoreError
from service.store.journal import Journal

log = structlog.get_logger(__name__)

THERMAL_SCHEMA = "thermal schema=1"
"""Beginning of the key of a saved warm-up state; the rest is its thermal model, without how it starts and
what it lacks."""

MOST_REOPENED = 20
"""Number of alarms that have ended last which the monitor of an axis gets back, as they may be reopened"""

Part = Literal["estimates", "multimodel", "thermal", "learning", "history"]
FIRST = EpochProgress(1)
"""Of an axis that has always had the nominal values of its configuration"""


class SavedState(NamedTuple):
    """A state of an axis that is saved separately: its name and key, its arrays, and what restores it."""

    part: Part
    name: str
    key: str
    arrays: Callable[[], Arrays | None]
    """None: there is none yet"""
    restore: Callable[[Arrays], None]


def states_of(
    axis_id: str, monitor: AxisMonitor, operating: Operating | None = None, epoch: EpochProgress = FIRST
) -> Iterator[SavedState]:
    """The states of a monitor: estimates, evidence of its multi-model detector, a learning window; how warm it is.

    All but the heat belong to the epoch.
    """
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
    if operating is not None and operating.thermal is not None:
        m = operating.thermal.model
        tau = " ".join(f"tau={tau_s}" for tau_s, _ in m.parts)
        key = f"{THERMAL_SCHEMA} {tau} fm={m.fm} fc={m.fc} largest={m.largest}"
        name = f"{axis_id} (warm-up state)"
        yield SavedState("thermal", name, key, operating.to_arrays, operating.from_arrays)


class Checkpointer:
    """Saves all monitors together, so that the saved states belong to one time.

    Args:
        checkpoints: the store.
        monitors: of all axes, with their long-term trends.
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
        """When the last one was saved, also by the daemon before; None: not yet"""
        self.problem: str | None = None
        """Why the last try failed, for the operator; None when it did not."""

    def save_soon(self) -> None:
        """Let the next checkpoint be due now: monitors have been replaced."""
        self._due = monotonic()

    def save_if_due(self) -> None:
        """Save when the interval is over."""
        if monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Save now; a failure is reported to the operator and retried after the interval."""
        self._due = monotonic() + self._interval_s
        now_us = self._now_us()
        states = [*giving_way(self._states()), *giving_way(self._monitors.trends.to_save())]
        try:
            self.checkpoints.save(states, now_us)
        except StoreError as error:
            if self.problem is None:
                log.error("checkpoint failed; it is tried again", reason=str(error))
            self.problem = sentence(
                "not saved", "the state of the monitors cannot be saved: {why}", why=error
            )
            return
        if self.problem is not None:
            log.info("checkpoints are saved again")
        self.saved_us, self.problem = now_us, None
        self._monitors.trends.saved()

    def _states(self) -> Iterator[AxisState]:
        for axis_id, axis in self._monitors.axes.items():
            for state in states_of(axis_id, axis.monitor, axis.operating, axis.epoch):
                arrays = state.arrays()
                if arrays is not None:
                    yield AxisState(state.name, state.key, arrays)


# --- Restart: estimates and trends from the checkpoints, open alarms from the journal, a report of what was lost ------


PART_NAMES: Mapping[Part, str] = {
    "estimates": sentence("part estimates", "the estimates"),
    "multimodel": sentence("part evidence", "the evidence of the multi-model detector"),
    "thermal": sentence("part warmth", "the warm-up state"),
    "learning": sentence("part window", "the learning window"),
    "history": sentence("part history", "the long-term history"),
}


class Loss(NamedTuple):
    """A saved state that cannot be used and was quarantined."""

    axis_id: str
    part: Part
    reason: str
    parameter: str = ""
    """Of a history; empty: the entries that were being gathered, of all parameters"""


class Restored(NamedTuple):
    """What was restored.

    ``open`` are the alarms that are open in the journal, ``changes`` what it does not have yet: alarms of the
    checkpoint, ends of forecasts whose limit is gone.  ``messages`` tell the operator what was lost.
    """

    checkpoint_us: int | None
    open: tuple[AxisAlarm, ...]
    changes: tuple[AxisAlarm, ...]
    messages: tuple[str, ...]


class _Loader:
    """Loads checkpoints; those that cannot be used are quarantined, and are ``losses``."""

    def __init__(self, checkpoints: Checkpoints, now_us: int) -> None:
        self._checkpoints, self._now_us = checkpoints, now_us
        self.losses: list[Loss] = []

    def load(self, at: Loss, name: str, key: str) -> Checkpoint | None:
        found = self._checkpoints.load(name, key, self._now_us)
        if isinstance(found, QuarantinedCheckpoint):
            self.losses.append(at._replace(reason=found.reason))
            return None
        return found

    def use(self, at: Loss, name: str, restore: Callable[[Arrays], None], arrays: Arrays) -> bool:
        """Restore the state; whether it fits."""
        try:
            restore(dict(arrays))
        except (KeyError, ValueError) as error:
            reason = sentence("version", "it does not fit this version ({why})", why=error)
            self._checkpoints.quarantine(name, reason, self._now_us)
            self.losses.append(at._replace(reason=reason))
            return False
        return True


def restore(
    monitors: AxisMonitors,
    checkpoints: Checkpoints,
    journal: Journal,
    now_us: int,
    configured: Collection[str] | None = None,
) -> Restored:
    """Bring the monitors and their trends to the state of the last run.

    ``configured``: all axes, where the monitors are only those of some.

    The journal decides which alarms are open and which have ended, as it may be newer than the checkpoint.  Only an
    alarm that the journal has never seen, as its file was damaged and created again, is taken from the checkpoint.

    Raises:
        StoreError: a file cannot be read or written.
    """
    messages: list[str] = [*checkpoints.messages, *journal.messages]
    loader, times = _Loader(checkpoints, now_us), list[int]()
    opened: list[AxisAlarm] = []
    changes: list[AxisAlarm] = []
    for axis_id, axis in monitors.axes.items():
        monitor = axis.monitor
        for state in states_of(axis_id, monitor, axis.operating, axis.epoch):
            at = Loss(axis_id, state.part, "")
            found = loader.load(at, state.name, state.key)
            if found is not None and loader.use(at, state.name, state.restore, found.arrays):
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
    """A history that is damaged, or was made with other nominal values, is counted, and starts again."""
    for axis_id, (names, monitor, key) in trends.axes.items():
        each = [(Loss(axis_id, "history", "", name), completed_id(axis_id, name)) for name in names]
        completed = [loader.load(at, name, key) for at, name in each]
        gathered = loader.load(Loss(axis_id, "history", ""), gathered_id(axis_id), key)
        opened = {} if gathered is None else gathered.arrays
        for (at, name), history, found in zip(each, monitor.histories, completed, strict=True):
            nothing: Arrays = {"entries": history.closed_to_array()}
            resume = partial(_restore_history, history, np.asarray(opened.get(at.parameter, ()), float))
            loader.use(at, name, resume, nothing if found is None else found.arrays)
    trends.resume(loss.axis_id for loss in loader.losses if loss.part == "history")


def _restore_history(history: SlowHistory, gathered: Floats, arrays: Arrays) -> None:
    history.restore(np.asarray(arrays["entries"], float), gathered)


# --- open alarms ----------------------------------------------------------------------------------------


def _close_unmonitored(axis_id: str, causes: Collection[str], journal: Journal, now_us: int) -> list[str]:
    """End the alarms that nothing would ever end: of other causes, or of an axis that is no longer configured."""
    ended = journal.close_unmonitored(axis_id, causes, now_us)
    words = "{axis}: the alarm of {name} was ended: that is no longer monitored"
    return [sentence("unmonitored", words, axis=axis_id, name=a.parameter) for a in ended]


def _adopt(axis_id: str, monitor: AxisMonitor, recorded: Iterable[Alarm], journal: Journal) -> list[Alarm]:
    """Let the monitor have the open alarms of the journal; returns those that the journal has never seen."""
    now = {alarm.key: alarm for alarm in recorded}
    ended = [a for a in journal.ended_alarms(axis_id, MOST_REOPENED) if a.parameter in monitor.causes]
    unknown = [a for a in monitor.open_alarms if a.key not in now and not _is_known(axis_id, a, journal)]
    monitor.adopt([*now.values(), *unknown], ended)
    return unknown


def _is_known(axis_id: str, alarm: Alarm, journal: Journal) -> bool:
    found, _ = journal.query(axis_id, since_us=alarm.raised_us, until_us=alarm.raised_us + 1)
    return any(recorded.first == alarm.first for recorded in found)


# --- report ---------------------------------------------------------------------------------------------


def loss_messages(losses: Iterable[Loss]) -> Iterator[str]:
    """One message for each axis: why its checkpoint is not used, and what restarts because of that."""
    by_axis: dict[str, list[Loss]] = {}
    for loss in losses:
        by_axis.setdefault(loss.axis_id, []).append(loss)
    for axis_id, lost in by_axis.items():
        by_reason: dict[str, list[Loss]] = {}
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


def _parts(losses: list[Loss]) -> str:
    """The estimates, the evidence of .. and the long-term history of kT and fm."""
    found = list[str]()
    for part, name in PART_NAMES.items():
        of_part = [loss for loss in losses if loss.part == part]
        parameters = list(dict.fromkeys(loss.parameter for loss in of_part if loss.parameter))
        if of_part:
            names = joined(parameters, ", and ")
            found.append(
                sentence("part of", "{part} of {names}", part=name, names=names) if parameters else name
            )
    return joined(found, ", and ")
