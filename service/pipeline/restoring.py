"""Restart: estimates and trends from the checkpoints, open alarms from the journal, and a report of what was lost."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Literal, NamedTuple

from monitor_core.detection import Alarm
from monitor_core.monitoring import Arrays, AxisMonitor
from service.pipeline.alarms import AxisAlarm
from service.pipeline.checkpointing import multimodel_id
from service.pipeline.trends import Trends
from service.store.checkpoints import Checkpoints, QuarantinedCheckpoint
from service.store.journal import Journal

Part = Literal["estimates", "multimodel", "history"]
PART_NAMES: Mapping[Part, str] = {
    "estimates": "the estimates",
    "multimodel": "the evidence of the multi-model detector",
    "history": "the long-term history",
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

    ``open`` are the alarms that are open in the journal; ``unrecorded`` those that it does not have yet.
    """

    checkpoint_us: int | None
    open: tuple[AxisAlarm, ...]
    unrecorded: tuple[AxisAlarm, ...]
    messages: tuple[str, ...]
    losses: tuple[Loss, ...] = ()


def restore(
    monitors: Mapping[str, AxisMonitor], checkpoints: Checkpoints, journal: Journal, now_us: int
) -> Restored:
    """Bring the monitors to the state of the last run.

    The journal decides which alarms are open, as it may be newer than the checkpoint.  Only an alarm that the journal
    has never seen, as its file was damaged and created again, is taken from the checkpoint.

    Raises:
        StoreError: a file cannot be read or written.
    """
    messages: list[str] = [*checkpoints.messages, *journal.messages]
    losses: list[Loss] = []
    times: list[int] = []
    opened: list[AxisAlarm] = []
    unrecorded: list[AxisAlarm] = []
    for axis_id, monitor in monitors.items():
        for state in _states(axis_id, monitor):
            loaded = _load(state, checkpoints, now_us)
            if isinstance(loaded, QuarantinedCheckpoint):
                losses.append(Loss(axis_id, state.part, loaded.reason))
            elif loaded is not None:
                times.append(loaded)
        messages += _close_unmonitored(axis_id, monitor, journal, now_us)
        recorded = journal.open_alarms(axis_id)
        opened += [AxisAlarm(axis_id, alarm) for alarm in recorded]
        changes = [alarm for alarm in recorded if alarm.kind != "forecast"]  # those belong to the trends
        unrecorded += [AxisAlarm(axis_id, alarm) for alarm in _adopt(axis_id, monitor, changes, journal)]
    messages += _removed_axes(monitors, journal)
    found = tuple(opened), tuple(unrecorded), tuple(messages), tuple(losses)
    return Restored(min(times, default=None), *found)


def restore_trends(trends: Trends, checkpoints: Checkpoints, now_us: int) -> list[Loss]:
    """Restore the long-term histories; returns those that cannot be used.

    A history that is damaged, or was made with other nominal values, is quarantined, counted, and starts again.

    Raises:
        StoreError: the file cannot be read or written.
    """
    found: dict[str, Arrays] = {}
    losses = []
    parts = list(trends.to_load())
    for axis_id, part in parts:
        loaded = checkpoints.load(part.name, part.key, now_us)
        if isinstance(loaded, QuarantinedCheckpoint):
            trends.lost[axis_id] += 1
            losses.append(Loss(axis_id, "history", loaded.reason, part.parameter))
        elif loaded is not None:
            found[part.name] = loaded.arrays
    by_name = {part.name: (axis_id, part.parameter) for axis_id, part in parts}
    for name, reason in trends.restore(found):
        checkpoints.quarantine(name, reason, now_us)
        axis_id, parameter = by_name[name]
        losses.append(Loss(axis_id, "history", reason, parameter))
    return losses


# --- states of a monitor --------------------------------------------------------------------------------


class _State(NamedTuple):
    """A state that is saved separately: its name and key, and what restores it."""

    part: Part
    name: str
    key: str
    restore: Callable[[Arrays], None]


def _states(axis_id: str, monitor: AxisMonitor) -> Iterator[_State]:
    yield _State("estimates", axis_id, monitor.key, monitor.from_arrays)
    multimodel = monitor.multimodel
    if multimodel is not None:
        name, key = multimodel_id(axis_id), monitor.multimodel_key
        yield _State("multimodel", name, key, lambda arrays: multimodel.bank.from_arrays(arrays))


def _load(state: _State, checkpoints: Checkpoints, now_us: int) -> int | QuarantinedCheckpoint | None:
    """The time of the checkpoint that is used now, or why it is not used; None: there never was one."""
    found = checkpoints.load(state.name, state.key, now_us)
    if found is None or isinstance(found, QuarantinedCheckpoint):
        return found
    try:
        state.restore(dict(found.arrays))
    except (KeyError, ValueError) as error:
        quarantined = QuarantinedCheckpoint(
            state.name, found.at_us, f"it does not fit this version ({error})"
        )
        checkpoints.quarantine(state.name, quarantined.reason, now_us)
        return quarantined
    return found.at_us


# --- open alarms ----------------------------------------------------------------------------------------


def _close_unmonitored(axis_id: str, monitor: AxisMonitor, journal: Journal, now_us: int) -> list[str]:
    ended = journal.close_unmonitored(axis_id, monitor.causes, now_us)
    return [f"{axis_id}: the alarm of {a.parameter} was ended: that is no longer monitored" for a in ended]


def _adopt(axis_id: str, monitor: AxisMonitor, recorded: Iterable[Alarm], journal: Journal) -> list[Alarm]:
    """Let the monitor have the open alarms of the journal; returns those that the journal has never seen."""
    now = {alarm.key: alarm for alarm in recorded}
    unknown = [a for a in monitor.open_alarms if a.key not in now and not _is_known(axis_id, a, journal)]
    monitor.adopt([*now.values(), *unknown])
    return unknown


def _is_known(axis_id: str, alarm: Alarm, journal: Journal) -> bool:
    found, _ = journal.query(axis_id, since_us=alarm.raised_us, until_us=alarm.raised_us + 1)
    return any(recorded.first == alarm.first for recorded in found)


def _removed_axes(monitors: Mapping[str, AxisMonitor], journal: Journal) -> list[str]:
    alarms, _ = journal.query(active=True, limit=1000)
    removed = dict.fromkeys(alarm.axis for alarm in alarms if alarm.axis not in monitors)
    return [f"{axis} is no longer configured, but has open alarms in the journal" for axis in removed]


# --- report ---------------------------------------------------------------------------------------------


def loss_messages(losses: Iterable[Loss]) -> Iterator[str]:
    """One message for each axis: why its checkpoint is not used, and what restarts because of that."""
    by_axis: dict[str, list[Loss]] = {}
    for loss in losses:
        by_axis.setdefault(loss.axis_id, []).append(loss)
    for axis_id, lost in by_axis.items():
        share = "" if "estimates" in {loss.part for loss in lost} else "part of "
        by_reason: dict[str, list[Loss]] = {}
        for loss in lost:
            by_reason.setdefault(loss.reason, []).append(loss)
        reasons = "; ".join(f"{reason} (restarted: {_parts(found)})" for reason, found in by_reason.items())
        yield f"{axis_id}: {share}its checkpoint is not used and was quarantined: {reasons}"


def _parts(losses: list[Loss]) -> str:
    """The estimates, the evidence of .. and the long-term history of kT and fm."""
    found = []
    for part, name in PART_NAMES.items():
        of_part = [loss for loss in losses if loss.part == part]
        parameters = list(dict.fromkeys(loss.parameter for loss in of_part if loss.parameter))
        if of_part:
            found.append(f"{name} of {_listed(parameters)}" if parameters else name)
    return _listed(found)


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
