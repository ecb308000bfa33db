"""Operating conditions from the frames to the alarms: live, replayed from a CAN log, and from a table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.wording import sentence
from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame, FrameBlock
from service.config import Config, load
from service.ingest.records.record_files import LogRecord
from service.pipeline.axes.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.axes.axis_pipeline import lasting_gate
from service.simulation.robot import SimulatedFault
from tests.service.ingest.plant import rows_of
from tests.service.pipeline.robots import START_US, cut, live, replayed, with_axes
from tests.service.pipeline.varying_robot import LENGTH_S, VARYING, frames_of, robot

FAULT_S = 30.0
FEW = 80
"""Samples that have another fate, of some thousands."""
STATE = 1024  # the message of mode and temperature


Ran = tuple[FramePipeline, set[tuple[str, str, str]]]
"""The daemon's core, and its alarms by axis, parameter and direction."""


def without(part: str, file: Path) -> Config:
    other = file.with_name("other.toml")
    other.write_text(file.read_text(encoding="utf-8").replace(part, ""), encoding="utf-8")
    return load(other, {})


def ran(config: Config, frames: Sequence[Frame], every: int = 237) -> Ran:
    """The daemon's core over blocks of frames, and the alarms that it raised."""
    core = FramePipeline(config)
    changes = live(core, cut(frames, every))
    return core, {(c.axis_id, c.alarm.parameter, c.alarm.direction) for c in changes}


def counters(monitors: AxisMonitors) -> Mapping[str, int]:
    return monitors.by_id["demo.axis1"].status().counters


def assert_same(a: AxisMonitor, b: AxisMonitor) -> None:
    """To the last bit."""
    for columns in zip(a.batch.column(a.lane), b.batch.column(b.lane), strict=True):
        np.testing.assert_array_equal(*columns)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return robot(tmp_path_factory.mktemp("conditions"))


@pytest.fixture(scope="module")
def healthy(file: Path, seed: int) -> list[Frame]:
    return frames_of(load(file, {}), seed)


@pytest.fixture(scope="module")
def broken(file: Path, seed: int) -> list[Frame]:
    return frames_of(load(file, {}), seed + 1, [SimulatedFault("demo.axis1", {"fm": 1.4}, FAULT_S)])


@pytest.fixture(scope="module")
def found_broken(file: Path, broken: list[Frame]) -> Ran:
    return ran(load(file, {}), broken)


def test_what_follows_is_quiet_and_what_does_not_is_not(file: Path, healthy: list[Frame]) -> None:
    core, raised = ran(load(file, {}), healthy)
    assert raised == set()
    status = core.monitors.by_id["demo.axis1"].status()
    _, Ja, fm = status.parameters
    assert status.counters["gated"] <= 1, "the first, before another axis has sent"
    assert fm.nominal != pytest.approx(0.06, rel=0.1)
    assert Ja.nominal != pytest.approx(1 / 95.713576, rel=1e-6)
    assert abs(fm.estimate - fm.nominal) < 6 * fm.standard_deviation
    _, still = ran(without(VARYING, file), healthy)
    assert ("demo.axis1", "fm", "down") in still


def test_a_fault_is_found_while_the_nominal_value_moves_and_a_log_replays_it_to_the_last_bit(
    file: Path, broken: list[Frame], found_broken: Ran, tmp_path: Path
) -> None:
    core, raised = found_broken
    assert {alarm[:2] for alarm in raised} == {("demo.axis1", "fm")}
    fm = core.monitors.by_id["demo.axis1"].status().parameters[2]
    assert fm.name == "fm"
    assert fm.estimate / fm.nominal > 1.15
    log, config = tmp_path / "today.log", load(file, {})
    with FrameRecorder(log) as recorder:
        recorder.write("can0", FrameBlock.from_frames(broken))
    again = AxisMonitors(config.axes)
    for step in LogRecord(log, config).steps():
        again.update(step.samples)
    for axis_id, monitor in core.monitors.by_id.items():
        assert_same(monitor, again.by_id[axis_id])
    found = replayed(file, log)
    assert [(a["parameter"], a["direction"]) for a in found["alarms"]] == [("fm", "up")]
    assert found["parameters"][2]["nominal"] == fm.nominal
    assert found["counters"] == dict(counters(core.monitors))


def test_a_table_says_the_same(file: Path, broken: list[Frame], found_broken: Ran, tmp_path: Path) -> None:
    """The samples of the log with their signals as columns, which are held where a cell is empty."""
    core, rows = FramePipeline(load(file, {})), ["t,torque,angle,torque2,angle2,warm,mode"]
    step = core.ingests["can0"].feed(FrameBlock.from_frames(broken))
    before: list[float] = []
    for first, second in zip(rows_of(step["demo.axis1"]), rows_of(step["demo.axis2"]), strict=True):
        temperature, mode, _ = first.signals
        new = [temperature, mode] != before
        before = [temperature, mode] if new else before
        rows.append(
            f"{first.t_us / 1e6:.6f},{first.torque!r},{first.motion!r},{second.torque!r},{second.motion!r},"
            f"{temperature if new else ''},{mode}"
        )
    table = tmp_path / "today.csv"
    table.write_text("\n".join(rows) + "\n", encoding="utf-8")
    found = replayed(file, table)
    assert [(a["parameter"], a["direction"]) for a in found["alarms"]] == [("fm", "up")]
    live_parameters = found_broken[0].monitors.by_id["demo.axis1"].status().parameters
    for parameter, p in zip(found["parameters"], live_parameters, strict=True):
        # Not to the last bit: in a row of the table the other axis is where it was on the bus a sample later.
        assert parameter["estimate"] == pytest.approx(p.estimate, rel=0.02)


def with_state(frames: Sequence[Frame], change: Mapping[str, Any]) -> list[Frame]:
    """The frames, of which those of the robot's state have another mode between two times, or are missing."""
    found = []
    for frame in frames:
        since_s = (frame.t_us - START_US) / 1e6
        if frame.can_id == STATE and change["from"] <= since_s < change["to"]:
            if change["mode"] is None:
                continue
            frame = frame._replace(data=bytes([change["mode"]]) + frame.data[1:])
        found.append(frame)
    return found


def test_nothing_is_learned_in_another_mode(file: Path, broken: list[Frame]) -> None:
    frames = with_state(broken, {"from": 22.0, "to": LENGTH_S, "mode": 1})
    core, raised = ran(load(file, {}), frames)
    assert raised == set(), "the fault is behind the gate"
    assert counters(core.monitors)["gated"] == pytest.approx((LENGTH_S - 22.0) * 200, abs=FEW)
    assert core.monitors.axes["demo.axis1"].gated_by == "mode = 1"
    assert core.monitors.axes["demo.axis2"].gated_by == ""
    open_again, raised = ran(load(file, {}), with_state(broken, {"from": 22.0, "to": 32.0, "mode": 1}))
    assert ("demo.axis1", "fm", "up") in raised
    assert open_again.monitors.axes["demo.axis1"].gated_by == ""


def test_a_signal_that_is_silent_is_no_longer_believed(file: Path, broken: list[Frame]) -> None:
    core, raised = ran(load(file, {}), with_state(broken, {"from": 22.0, "to": LENGTH_S, "mode": None}))
    assert raised == set()
    # The mode is believed for half a second, the temperature for ten, so the gate closes first.
    assert counters(core.monitors)["gated"] == pytest.approx((LENGTH_S - 22.5) * 200, abs=FEW)
    assert core.monitors.axes["demo.axis1"].gated_by == "mode is not known"


def test_an_axis_has_its_own_conditions_and_no_other(file: Path, healthy: list[Frame]) -> None:
    """Whichever its place is in the bank that it shares."""
    frames, config = with_state(healthy[:9000], {"from": 5.0, "to": 7.0, "mode": 1}), load(file, {})
    turned = with_axes(config, config.robot[0].axis[::-1])
    cores = [ran(each, frames)[0] for each in (config, turned)]
    for axis_id, gated in (("demo.axis1", 400), ("demo.axis2", 0)):
        first, second = (core.monitors.by_id[axis_id] for core in cores)
        assert first.status().counters["gated"] == pytest.approx(gated, abs=FEW * bool(gated))
        assert_same(first, second)


HOIST = """
[[robot]]
name = "hoist"

[[robot.axis]]
name = "lift"
sample_interval_s = 0.005
time = { column = "t" }
torque = { column = "u" }
angle = { column = "y" }
estimator = { torque_noise = 0.05, output_noise = 1e-4 }

[robot.axis.model]
drive = "one-mass"
monitor = ["kT", "fm"]
friction_speed_scale = 1.0
nominal = { kT = 1.0, J = 0.01, fm = 0.004, fc = 0.1, tau0 = -1.0 }
"""


def test_an_axis_without_conditions_waits_while_its_brake_holds_it(tmp_path: Path) -> None:
    """Its weight would let it fall by a metre in a quarter of a second."""
    file = tmp_path / "hoist.toml"
    file.write_text(HOIST, encoding="utf-8")
    monitors = AxisMonitors(load(file, {}).axes)
    t_us = START_US + 5000 * np.arange(400, dtype=np.int64)
    monitors.update({"hoist.lift": SampleBlock(t_us, np.zeros(400), np.full(400, 0.3))})
    assert monitors.axes["hoist.lift"].gated_by.startswith("held by its brake")
    assert monitors.by_id["hoist.lift"].status().counters["gated"] == 400 - 20
    later = SampleBlock(t_us + 2_000_000, np.ones(400), np.full(400, 0.3))
    monitors.update({"hoist.lift": later})
    assert monitors.axes["hoist.lift"].gated_by == ""


def test_an_axis_that_stands_in_new_poses_is_kept_from_tests_by_these() -> None:
    slow, poses = sentence("slow", "slower than {speed} rad/s", speed="0.04"), "90 % of the way is in new poses"
    assert lasting_gate(slow, poses) == lasting_gate("", poses) == poses
    assert lasting_gate(slow, "") == slow
    assert lasting_gate("mode = 1", poses) == "mode = 1"
    assert lasting_gate("", "") == ""
