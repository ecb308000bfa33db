"""Restart: estimates and trends from the checkpoints, open alarms from the journal, a report of what was lost."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Arrays, Floats
from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisMonitor
from monitor_core.trend import SlowHistory
from monitor_core.wording import joined, sentence
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.axes.trends import Trends, completed_id, gathered_id
from service.pipeline.persistence.checkpointing import StatePart, states_of
from service.store.alarm_filter import AlarmFilter
from service.store.checkpoints import Checkpoint, Checkpoints, QuarantinedCheckpoint
from service.store.journal import Journal

MOST_REOPENED = 20
"""Number of the latest ended alarms that the monitor of an axis gets at the start, as it may reopen them"""

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
