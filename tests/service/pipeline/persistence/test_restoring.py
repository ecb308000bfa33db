"""After a restart: estimates from the checkpoint, open alarms from the journal, and what is said of losses."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monitor_core.detection import Alarm, Crossing, FormerName
from monitor_core.detection.cusum.cusum_evidence import Evidence
from monitor_core.detection.onset import Past
from monitor_core.monitoring import AlarmState, AxisMonitor
from service.can.frames import FrameBlock
from service.config import Config
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.restoring import LostState, Restored, loss_messages, restore
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_filter import AlarmFilter
from service.store.checkpoints import Checkpoints, MonitorState
from service.store.journal import Journal
from tests.service.pipeline.robots import blocks, changed, demo
from tests.service.store.quarantine import quarantined

NOW_US = 1_760_000_100_000_000
AXIS = "demo.axis1"
OPEN = Alarm("fm", "up", 10, 20, 30, None, 0.02, 0.001, 3)


def fresh(tmp_path: Path) -> AxisMonitors:
    return AxisMonitors(demo(tmp_path, 2).axes)


@pytest.fixture
def monitors(tmp_path: Path) -> AxisMonitors:
    return fresh(tmp_path)


def save(monitors: AxisMonitors, checkpoints: Checkpoints) -> None:
    Checkpointer(checkpoints, monitors, 60.0, lambda: NOW_US).save()


def again(tmp_path: Path, checkpoints: Checkpoints, journal: Journal) -> tuple[AxisMonitors, Restored]:
    monitors = fresh(tmp_path)
    return monitors, restore(monitors, checkpoints, journal, NOW_US)


def take(core: FramePipeline, frames: Sequence[FrameBlock]) -> None:
    for block in frames:
        core.take("can0", block)
    core.update()


def restarted(
    config: Config, frames: Sequence[FrameBlock], checkpoints: Checkpoints, journal: Journal
) -> tuple[FramePipeline, FramePipeline]:
    """The core over the first half of these blocks, and another that goes on where it was saved."""
    before, later, half = FramePipeline(config), FramePipeline(config), len(frames) // 2
    take(before, frames[:half])
    save(before.monitors, checkpoints)
    restored = restore(later.monitors, checkpoints, journal, NOW_US)
    assert (restored.checkpoint_us, restored.messages, restored.open) == (NOW_US, (), ())
    later.ingests = before.ingests  # the sample clocks go on, as if nothing had happened
    take(later, frames[half:])
    return before, later


def test_estimates_go_on_bit_for_bit(tmp_path: Path, checkpoints: Checkpoints, journal: Journal, seed: int) -> None:
    config = demo(tmp_path, 2)
    frames, uninterrupted = list(blocks(config, 4.0, seed)), FramePipeline(config)
    take(uninterrupted, frames)
    _, later = restarted(config, frames, checkpoints, journal)
    for axis_id, monitor in uninterrupted.monitors.by_id.items():
        for found, expected in zip(_state(later.monitors.by_id[axis_id]), _state(monitor), strict=True):
            np.testing.assert_array_equal(found, expected)


def _state(monitor: AxisMonitor) -> tuple[np.ndarray, np.ndarray]:
    arrays = monitor.to_arrays()
    return arrays["floats"], arrays["ints"]


def test_nothing_saved_is_no_message(tmp_path: Path, checkpoints: Checkpoints, journal: Journal) -> None:
    _, restored = again(tmp_path, checkpoints, journal)
    assert restored == Restored(None, (), (), ())


@pytest.mark.parametrize("is_saved", [True, False])
def test_an_alarm_newer_than_the_checkpoint_is_adopted_and_can_end(
    is_saved: bool, tmp_path: Path, monitors: AxisMonitors, checkpoints: Checkpoints, journal: Journal
) -> None:
    """Also where there is no checkpoint, as after damage."""
    if is_saved:
        save(monitors, checkpoints)
    journal.record([AlarmEntry(AXIS, "N m s/rad", 0.06, OPEN)])
    found, restored = again(tmp_path, checkpoints, journal)
    assert restored.open == (AxisAlarm(AXIS, OPEN),)
    assert found.by_id[AXIS].open_alarms == (OPEN,)
    assert found.by_id["demo.axis2"].open_alarms == ()
    ((_, ended),) = found.by_id[AXIS].apply([_healthy(99, found.by_id[AXIS].model.monitored)])
    assert (ended.raised_us, ended.ended_us) == (OPEN.raised_us, 99)


def _healthy(time_us: int, names: tuple[str, ...]) -> Evidence:
    """Evidence that nothing has deviated for long."""
    p, t_us = len(names), time_us + np.arange(-20, 1, dtype=np.int64)
    past = Past(t_us, np.zeros((21, p)), np.ones((21, p, p)), 0.9, 1.0, 0.0)
    return Evidence(time_us, names, np.zeros(p), 1e-6 * np.eye(p), np.zeros((p, p)), 4.0, 1.0, (0,) * p, past, 12)


NAMED = replace(OPEN, parameter="kT", stage="named", past=(FormerName(40, "changed", "fm", "up"),))
NEWER = replace(OPEN, updated_us=60, crossings=9)


@pytest.mark.parametrize(
    ("recorded", "open_", "unrecorded"),
    [
        pytest.param([OPEN, replace(OPEN, ended_us=40)], (), (), id="ended later"),
        pytest.param([NEWER], (NEWER,), (), id="the journal is newer"),
        pytest.param([OPEN, NAMED], (NAMED,), (), id="renamed"),
        pytest.param([OPEN, NAMED, replace(NAMED, ended_us=50)], (), (), id="renamed and ended"),
        pytest.param([], (OPEN,), (AxisAlarm(AXIS, OPEN),), id="lost by the journal, so recorded anew"),
    ],
)
def test_the_journal_decides_on_an_alarm_of_the_checkpoint(
    tmp_path: Path, monitors: AxisMonitors, checkpoints: Checkpoints, journal: Journal,
    recorded: list[Alarm], open_: tuple[Alarm, ...], unrecorded: tuple[AxisAlarm, ...],
) -> None:  # fmt: skip
    monitors.by_id[AXIS].adopt([OPEN])
    save(monitors, checkpoints)
    for alarm in recorded:
        journal.record([AlarmEntry(AXIS, "1", 1.0, alarm)])
    found, restored = again(tmp_path, checkpoints, journal)
    assert found.by_id[AXIS].open_alarms == open_
    assert restored.changes == unrecorded
    assert restored.open == tuple(AxisAlarm(AXIS, alarm) for alarm in open_ if not unrecorded)
    if open_ == (NEWER,):
        ((_, updated),) = found.by_id[AXIS].apply([Crossing("fm", "up", 70, 65)])
        assert updated.crossings == 10


def test_an_alarm_that_ended_after_the_checkpoint_is_reopened_and_no_row_overlaps(
    tmp_path: Path, monitors: AxisMonitors, checkpoints: Checkpoints, journal: Journal
) -> None:
    """A second change was detected while the alarm was open, and is found to be its cause after kill -9.

    The checkpoint has the alarm as open and the change as unnamed; only the journal knows that the alarm has ended.
    """
    first = replace(OPEN, stage="named", updated_us=25)
    monitors.by_id[AXIS].adopt([first])
    assert monitors.by_id[AXIS].apply([Crossing("kT", "up", 40, 35)]) == []
    save(monitors, checkpoints)
    journal.record([AlarmEntry(AXIS, "N m s/rad", 0.06, alarm) for alarm in (first, replace(first, ended_us=50))])
    found, _ = again(tmp_path, checkpoints, journal)
    monitor = found.by_id[AXIS]
    healthy = _healthy(99, monitor.model.monitored)
    d = np.array([0.02 if name == "fm" else 0.0 for name in healthy.parameters])
    ((kind, alarm),) = monitor.apply([replace(healthy, deviation=d)])
    assert (kind, alarm.parameter, alarm.raised_us, alarm.reopened_us) == ("reopened", "fm", 20, 40)
    journal.record([AlarmEntry(AXIS, "N m s/rad", 0.06, alarm)])
    rows, _ = journal.query()
    assert [(a.id, a.ended_us, a.state) for a in rows] == [(1, None, "unacknowledged")]


def test_a_checkpoint_of_another_model_is_quarantined_and_said(
    tmp_path: Path, monitors: AxisMonitors, checkpoints: Checkpoints, journal: Journal
) -> None:
    monitors.by_id[AXIS].batch.state.theta[:, monitors.by_id[AXIS].lane] = np.array([1.1, 0.01, 0.07])
    save(monitors, checkpoints)
    config = demo(tmp_path, 2)
    nominal = {**config.robot[0].axis[0].model.nominal, "fm": 0.061}
    found = AxisMonitors(changed(config, "axis1", model={"nominal": nominal}).axes)
    restored = restore(found, checkpoints, journal, NOW_US)
    (message,) = restored.messages
    assert message.startswith(f"{AXIS}: its checkpoint is not used and was quarantined: it was saved with another")
    assert message.endswith("(restarted: the estimates and the long-term history of kT, 1/Ja and fm)")
    assert found.by_id[AXIS].status().parameters[2].estimate == pytest.approx(0.061)
    names = [name for name, _ in quarantined(tmp_path)]
    assert names[0] == AXIS
    assert all(name.startswith(AXIS) for name in names)  # and its histories
    assert restored.checkpoint_us == NOW_US  # that of the other axis


def test_arrays_of_another_shape_are_quarantine(
    tmp_path: Path, monitors: AxisMonitors, checkpoints: Checkpoints, journal: Journal
) -> None:
    arrays = monitors.by_id[AXIS].to_arrays()
    checkpoints.save([MonitorState(AXIS, monitors.by_id[AXIS].key, {**arrays, "floats": np.zeros(3)})], NOW_US)
    found, restored = again(tmp_path, checkpoints, journal)
    (message,) = restored.messages
    assert "does not fit this version" in message
    assert len(quarantined(tmp_path)) == 1
    assert found.by_id[AXIS].status().samples == 0


def test_alarms_of_what_is_no_longer_monitored(tmp_path: Path, checkpoints: Checkpoints, journal: Journal) -> None:
    entries = [AlarmEntry(AXIS, "N m", 0.08, replace(OPEN, parameter="fc")), AlarmEntry("demo.axis7", "1", 1.0, OPEN)]
    journal.record(entries)
    found, restored = again(tmp_path, checkpoints, journal)
    assert restored.messages == (
        "demo.axis1: the alarm of fc was ended: that is no longer monitored",
        "demo.axis7: the alarm of fm was ended: that is no longer monitored",
    )
    assert found.by_id[AXIS].open_alarms == ()
    assert journal.query(AlarmFilter(active=True))[1] == 0
    assert {a.life.state for a in journal.query()[0]} == {AlarmState.RETURNED}


# --- what is lost: one message for each axis ----------------------------------------------------------------


A, B = "cell.axis1", "cell.axis2"
OTHER, DAMAGED = "it was saved with another model", "it is damaged"


def test_losses_in_words() -> None:
    """One message names all that an axis lost; axes and reasons are kept apart."""
    assert list(loss_messages([])) == []
    losses = [LostState(A, "history", OTHER, parameter) for parameter in ("kT", "1/Ja", "fm", "")]
    (message,) = loss_messages([LostState(A, "estimates", OTHER), *losses, LostState(A, "multimodel", OTHER)])
    assert message == (
        "cell.axis1: its checkpoint is not used and was quarantined: it was saved with another model (restarted: the"
        " estimates, the evidence of the multi-model detector and the long-term history of kT, 1/Ja and fm)"
    )
    losses = [
        LostState(A, "estimates", DAMAGED),
        LostState(B, "multimodel", OTHER),
        LostState(A, "history", OTHER, "fm"),
        LostState("cell.axis3", "history", DAMAGED),
    ]
    assert list(loss_messages(losses)) == [
        "cell.axis1: its checkpoint is not used and was quarantined: it is damaged (restarted: the estimates); it was"
        " saved with another model (restarted: the long-term history of fm)",
        "cell.axis2: part of its checkpoint is not used and was quarantined: it was saved with another model"
        " (restarted: the evidence of the multi-model detector)",
        "cell.axis3: part of its checkpoint is not used and was quarantined: it is damaged (restarted: the long-term"
        " history)",
    ]


def test_a_restart_of_seconds_is_no_start_of_the_motion(
    tmp_path: Path, checkpoints: Checkpoints, journal: Journal, seed: int
) -> None:
    """An axis that waits an hour after a start goes on with that hour."""
    detector = {"outside_calibration": "wait"}
    config = changed(demo(tmp_path, 2), "axis1", detector=detector)
    cores = restarted(config, list(blocks(config, 14.0, seed)), checkpoints, journal)
    before_s, later_s = (core.monitors.by_id[AXIS].status().judged_in_s for core in cores)
    assert before_s is not None
    assert later_s == pytest.approx(before_s - 7.0, abs=0.5)
