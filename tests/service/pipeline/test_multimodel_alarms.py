"""The multi-model detector in the daemon: faults of axes and of sensors named, in the journal, over a restart."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.detection import Alarm
from service.can.frames import FrameBlock
from service.config import Config
from service.config.schema import DetectorConfig
from service.pipeline.axes.axis_alarms import AxisAlarm, quantities
from service.pipeline.axes.axis_monitors import FramePipeline
from service.pipeline.persistence.alarm_recording import AlarmRecorder
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.restoring import restore
from service.simulation.axis import SimulatedSample
from service.simulation.robot import Moment, SimulatedFault
from service.store.alarm_filter import AlarmFilter
from service.store.checkpoints import Checkpoints, MonitorState
from service.store.journal import Journal
from service.texts.alarm_words import episode_words
from tests.service.pipeline.robots import START_US, blocks, changed, demo, live

BROKEN_S, ENDS_S = 12.0, 20.0
BLOCK_S = 0.5
FAULTS = (SimulatedFault("demo.axis1", {"kT": 0.8}, BROKEN_S), SimulatedFault("demo.axis2", {"fm": 1.4}, BROKEN_S))
SWAPPED = "demo.axis3"


def watched(folder: Path, axes: int = 3, **detector: object) -> Config:
    """The demo, whose axes alarm by the multi-model detector."""
    own = {"alarm_source": "multimodel", "budget_s": 86400.0, **detector}
    return changed(demo(folder, axes), detector=DetectorConfig.model_validate(own))


def measured(moment: Moment) -> Mapping[str, SimulatedSample]:
    """The third axis measures its torque with the wrong sign from some time on."""
    readings = dict(moment.readings)
    if moment.time_s >= BROKEN_S:
        readings[SWAPPED] = readings[SWAPPED]._replace(torque=-readings[SWAPPED].torque)
    return readings


def frames(config: Config, seed: int) -> list[FrameBlock]:
    return list(blocks(config, ENDS_S, seed, FAULTS, BLOCK_S, measured))


class Run(NamedTuple):
    """A daemon without clock, threads and buses: its core, its journal, its checkpoints."""

    core: FramePipeline
    alarms: AlarmRecorder
    saver: Checkpointer
    messages: tuple[str, ...]

    def take(self, block: FrameBlock) -> list[AxisAlarm]:
        self.core.take("can0", block)
        changes = self.core.update()
        self.alarms.record(changes)
        return changes

    def open(self, axis_id: str) -> list[Alarm]:
        return list(self.alarms.open(axis_id))


def start(config: Config, journal: Journal, checkpoints: Checkpoints) -> Run:
    core = FramePipeline(config)
    restored = restore(core.monitors, checkpoints, journal, START_US)
    alarms = AlarmRecorder(journal, quantities(core.monitors.by_id))
    alarms.adopt(restored.open)
    alarms.record(restored.changes)
    saver = Checkpointer(checkpoints, core.monitors, 60.0, lambda: START_US)
    return Run(core, alarms, saver, restored.messages)


def test_faults_of_axes_and_of_a_sensor_are_named_over_a_restart(
    tmp_path: Path, journal: Journal, checkpoints: Checkpoints, seed: int
) -> None:
    config = watched(tmp_path)
    all_blocks = frames(config, seed)
    straight = FramePipeline(config)
    live(straight, all_blocks)
    run, half = start(config, journal, checkpoints), round((BROKEN_S + 1) / BLOCK_S)
    for block in all_blocks[:half]:
        run.take(block)
    run.saver.save()
    again = start(config, journal, checkpoints)
    assert again.messages == ()
    again.core.ingests = run.core.ingests  # the sample clocks go on, as if nothing had happened
    for block in all_blocks[half:]:
        again.take(block)
    # Coulomb friction alone tells the second names from the first.
    expected = {
        "demo.axis1": ("kT", "output scale"),
        "demo.axis2": ("fm",),
        SWAPPED: ("torque sign", "output sign"),
    }
    for axis_id, names in expected.items():
        assert run.open(axis_id), "raised before the restart"
        (e,) = again.open(axis_id)
        assert e.parameter in names
        assert e.stage == "named"
        assert repr(straight.monitors.by_id[axis_id].open_alarms) == repr((e,))  # sizes may be NaN
        assert BROKEN_S - 1 < (e.onset_us - START_US) * 1e-6 < BROKEN_S + 1
        assert journal.query(AlarmFilter(axis_id))[1] == 1
        (alarm,) = journal.query(AlarmFilter(axis_id))[0]
        assert alarm.causes == e.causes
    sizes = {axis_id: again.open(axis_id)[0].size for axis_id in expected}
    assert sizes["demo.axis1"] == pytest.approx(-0.2, abs=0.06)
    assert sizes["demo.axis2"] == pytest.approx(0.024, abs=0.01)
    words = episode_words(again.open(SWAPPED)[0], 0.0, "1")
    assert re.match("the measured (torque|motion) has changed its sign", words)
    status = again.core.monitors.by_id["demo.axis1"].status()
    assert [(d.name, d.alarms) for d in status.detectors] == [("cusum", False), ("multimodel", True)]


def test_a_damaged_state_of_the_bank_is_quarantined_and_the_estimates_go_on(
    tmp_path: Path, journal: Journal, checkpoints: Checkpoints, seed: int
) -> None:
    config = watched(tmp_path)
    run = start(config, journal, checkpoints)
    for block in frames(config, seed)[:10]:
        run.take(block)
    run.saver.save()
    monitor = run.core.monitors.by_id["demo.axis1"]
    assert monitor.multimodel is not None
    broken = monitor.multimodel.bank.to_arrays() | {"memory_x": monitor.multimodel.bank.to_arrays()["memory_x"][:2]}
    other = monitor.multimodel.bank.to_arrays()
    names = ("demo.axis1 (multi-model detector)", "demo.axis2 (multi-model detector)")
    states = [(monitor.multimodel_key, broken), ("another version", other)]
    checkpoints.save([MonitorState(n, *state) for n, state in zip(names, states, strict=True)], START_US)
    again = start(config, journal, checkpoints)
    broken_state, other_version = again.messages
    assert broken_state.startswith("demo.axis1: part of its checkpoint is not used")
    assert "does not fit this version" in broken_state
    assert other_version.startswith("demo.axis2: part of its checkpoint is not used")
    for message in again.messages:
        assert message.endswith("(restarted: the evidence of the multi-model detector)")
    for axis_id, found in again.core.monitors.by_id.items():
        assert found.status().samples == run.core.monitors.by_id[axis_id].status().samples > 0


def test_open_alarms_of_the_other_detector_are_taken_over(
    tmp_path: Path, journal: Journal, checkpoints: Checkpoints, seed: int
) -> None:
    """The configuration is changed while an alarm is open: the same alarm stays open, and is not raised again."""
    all_blocks = frames(watched(tmp_path), seed)
    first = start(watched(tmp_path, alarm_source="cusum"), journal, checkpoints)
    for block in all_blocks[: round((ENDS_S - 3) / BLOCK_S)]:
        first.take(block)
    first.saver.save()
    (before,) = first.open("demo.axis2")
    assert (before.parameter, before.stage) == ("fm", "named")
    second = start(watched(tmp_path), journal, checkpoints)
    second.core.ingests = first.core.ingests
    for block in all_blocks[round((ENDS_S - 3) / BLOCK_S) :]:
        second.take(block)
    assert [(e.raised_us, e.parameter) for e in second.open("demo.axis2")] == [(before.raised_us, "fm")]
    third = start(watched(tmp_path, alarm_source="cusum"), journal, checkpoints)
    assert [e.raised_us for e in third.open("demo.axis2")] == [before.raised_us]


def test_samples_of_several_blocks_at_once_change_nothing(tmp_path: Path, seed: int) -> None:
    """As the worker passes them on; while the axis is not judged, they have a gate."""
    config = watched(tmp_path, 1)
    (at_once, together), changes = (FramePipeline(config), FramePipeline(config)), list[AxisAlarm]()
    together.monitors.defer_multimodel()
    for number, block in enumerate(blocks(config, ENDS_S, seed, FAULTS[:1], BLOCK_S)):
        for core in (at_once, together):
            core.monitors.by_id["demo.axis1"].judge(number % 7 != 2)
            core.take("can0", block)
            changes += core.update()
        if number % 5 == 4:
            assert together.monitors.deferred_samples
            changes += together.monitors.update_multimodel()
    changes += together.monitors.update_multimodel()
    assert not together.monitors.deferred_samples
    assert {change.alarm.parameter for change in changes} == {"kT"}
    banks = [core.monitors.multimodel[0].bank.to_arrays() for core in (at_once, together)]
    for name, values in banks[0].items():
        np.testing.assert_array_equal(values, banks[1][name])
    alarms, same = (core.monitors.by_id["demo.axis1"].to_arrays()["alarms"] for core in (at_once, together))
    assert len(alarms)
    np.testing.assert_array_equal(alarms, same)
