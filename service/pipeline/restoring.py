"""Start where the last run ended: estimates from the checkpoints, open alarms from the journal."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from monitor_core.detection.alarm import Alarm
from monitor_core.monitoring.axis_monitor import Arrays, AxisMonitor
from service.pipeline.axis_change import Change
from service.pipeline.checkpointing import bank_id
from service.pipeline.restore_report import BANK, ESTIMATES, Loss
from service.store.checkpoints import Checkpoints, QuarantinedCheckpoint
from service.store.journal import Journal


class Restored(NamedTuple):
    """What was found.

    ``open`` are the alarms open in the journal; ``unrecorded`` it has yet to get; ``losses`` are no messages yet, as
    the slow histories may have more of them.
    """

    checkpoint_us: int | None
    open: tuple[Change, ...]
    unrecorded: tuple[Change, ...]
    messages: tuple[str, ...]
    losses: tuple[Loss, ...] = ()


def restore(
    monitors: Mapping[str, AxisMonitor], checkpoints: Checkpoints, journal: Journal, now_us: int
) -> Restored:
    """Bring the monitors to the state of the last run.

    The journal is right about which alarms are open: it may be newer than the checkpoint.  Only an alarm that
    it has never seen (its file was damaged and begun anew) is taken from the checkpoint.

    Raises:
        StoreError: a file cannot be read or written.
    """
    messages: list[str] = [*checkpoints.messages, *journal.messages]
    losses: list[Loss] = []
    times: list[int] = []
    opened: list[Change] = []
    unrecorded: list[Change] = []
    for axis_id, monitor in monitors.items():
        for state in _states(axis_id, monitor):
            loaded = _load(state, checkpoints, now_us)
            if isinstance(loaded, QuarantinedCheckpoint):
                losses.append(Loss(axis_id, state.what, loaded.reason))
            elif loaded is not None:
                times.append(loaded)
        messages += _close_unmonitored(axis_id, monitor, journal, now_us)
        recorded = journal.open_alarms(axis_id)
        opened += [Change(axis_id, e) for e in recorded]
        changes = [e for e in recorded if e.kind != "forecast"]  # those are not the monitor's
        unrecorded += [Change(axis_id, e) for e in _agree(axis_id, monitor, changes, journal)]
    messages += _of_removed_axes(monitors, journal)
    found = tuple(opened), tuple(unrecorded), tuple(messages), tuple(losses)
    return Restored(min(times, default=None), *found)


class _State(NamedTuple):
    """What is saved by itself: what it is, under which name and key, and who takes it."""

    what: str
    name: str
    key: str
    take: Callable[[Arrays], None]


def _states(axis_id: str, monitor: AxisMonitor) -> Iterator[_State]:
    """Of the monitor, and of the bank beside it."""
    yield _State(ESTIMATES, axis_id, monitor.key, monitor.from_arrays)
    if monitor.beside is not None:
        yield _State(BANK, bank_id(axis_id), monitor.beside_key, monitor.beside.from_arrays)


def _load(state: _State, checkpoints: Checkpoints, now_us: int) -> int | QuarantinedCheckpoint | None:
    """The time of the checkpoint that is used now, or why there is none, or None: there never was one."""
    found = checkpoints.load(state.name, state.key, now_us)
    if found is None or isinstance(found, QuarantinedCheckpoint):
        return found
    try:
        state.take(dict(found.arrays))
    except (KeyError, ValueError) as error:
        quarantined = QuarantinedCheckpoint(
            state.name, found.at_us, f"it does not fit this version ({error})"
        )
        checkpoints.quarantine(state.name, quarantined.reason, now_us)
        return quarantined
    return found.at_us


def _close_unmonitored(axis_id: str, monitor: AxisMonitor, journal: Journal, now_us: int) -> list[str]:
    ended = journal.close_unmonitored(axis_id, monitor.causes, now_us)
    return [f"{axis_id}: the alarm of {a.parameter} was ended: that is no longer monitored" for a in ended]


def _agree(axis_id: str, monitor: AxisMonitor, recorded: Iterable[Alarm], journal: Journal) -> list[Alarm]:
    """Let the monitor have the open episodes of the journal; returns those that it has yet to get.

    A detector that only looked on has episodes that the journal never was to get.
    """
    counted = monitor.book.open if monitor.alarmed_by == monitor.alarms else ()
    before = {(e.raised_us, *e.first): e for e in counted}
    now = {(e.raised_us, *e.first): e for e in recorded}
    unknown = {key: e for key, e in before.items() if key not in now and not _is_known(axis_id, e, journal)}
    monitor.adopt([*now.values(), *unknown.values()])
    return list(unknown.values())


def _is_known(axis_id: str, e: Alarm, journal: Journal) -> bool:
    found, _ = journal.query(axis_id, since_us=e.raised_us, until_us=e.raised_us + 1)
    return any(alarm.first == e.first for alarm in found)


def _of_removed_axes(monitors: Mapping[str, AxisMonitor], journal: Journal) -> list[str]:
    alarms, _ = journal.query(active=True, limit=1000)
    removed = dict.fromkeys(alarm.axis for alarm in alarms if alarm.axis not in monitors)
    return [f"{axis} is no longer configured, but has open alarms in the journal" for axis in removed]
