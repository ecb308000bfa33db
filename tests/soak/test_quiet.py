"""The robot of the demo for an hour: no alarm while it is healthy, and the right one when it is not.

And from records of an axis that follows a temperature and another axis to its nominal values, and to its alarms.
"""

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from monitor_core.samples import SampleBlock
from service.can.frame_recorder import FrameRecorder
from service.can.frames import FrameBlock
from service.commands.main import app
from service.config import Config, load
from service.config.drive_sources import shipped
from service.config.schema.found_file import read_found
from service.config.schema.nominal_file import NominalFile
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.simulation.robot import Moment, SimulatedFault, SimulatedRobot
from tests.service.pipeline.robots import replayed
from tests.service.pipeline.varying_robot import VARYING, frames_of
from tests.service.pipeline.varying_robot import robot as following

pytestmark = pytest.mark.soak

HOUR_S = 3600
PART_S = 10
FAULT_AFTER_S, FAULTY_S = 60.0, 180
"""As in the demo"""


@pytest.fixture(scope="module")
def config() -> Config:
    """The robot."""
    return load(shipped("demo.toml"), {})


@pytest.fixture
def monitors() -> AxisMonitors:
    """As the robot was commissioned."""
    return AxisMonitors(load(shipped("demo/axiswatch.toml"), {}).axes)


def test_an_hour_without_a_fault_is_an_hour_without_an_alarm(config: Config, monitors: AxisMonitors, seed: int) -> None:
    changes = list(run(SimulatedRobot(config, seed), monitors, HOUR_S))
    assert changes == []
    for monitor in monitors.by_id.values():
        facts = monitor.status()
        assert facts.counters["used"] > 0.99 * facts.samples > 0.9 * HOUR_S * 200
        for p in facts.parameters:
            print(f"{p.name}: {p.estimate / p.nominal - 1:+.4f}, sd {p.standard_deviation / p.nominal:.4f}")
            assert max(p.g_up, p.g_down) < p.h


@pytest.mark.parametrize("factor", [1.3, 0.7])
def test_a_fault_is_named(factor: float, config: Config, monitors: AxisMonitors, seed: int) -> None:
    axis_id = config.axes[seed % len(config.axes)].id
    robot = SimulatedRobot(config, seed, [SimulatedFault(axis_id, {"fm": factor}, FAULT_AFTER_S)])
    changes = list(run(robot, monitors, FAULTY_S))
    found = {(c.axis_id, c.alarm.parameter, c.alarm.direction) for c in changes if c.alarm.stage == "named"}
    assert found == {(axis_id, "fm", "up" if factor > 1 else "down")}
    assert min(c.alarm.raised_us for c in changes) > FAULT_AFTER_S * 1e6


def run(robot: SimulatedRobot, monitors: AxisMonitors, length_s: int) -> Iterator[AxisAlarm]:
    """All that changes while the monitors take the robot's samples."""
    moments = robot.moments()
    for _ in range(length_s // PART_S):
        part = list(islice(moments, PART_S * 200))
        yield from monitors.update({axis_id: block(part, axis_id) for axis_id in monitors.by_id})


def block(moments: list[Moment], axis_id: str) -> SampleBlock:
    t_us = np.array([round(m.time_s * 1e6) for m in moments])
    torque = np.array([m.readings[axis_id].torque for m in moments])
    return SampleBlock(t_us, torque, np.array([m.readings[axis_id].motion for m in moments]))


FAULT_S = 30.0


def test_what_was_identified_is_followed(tmp_path: Path, seed: int) -> None:
    """Slopes within one per cent; quiet on a second record; a fault of the friction is named."""
    config = load(following(tmp_path), {})
    broken = [SimulatedFault("demo.axis1", {"fm": 1.4}, FAULT_S)]
    for number, (name, faults) in enumerate((("healthy", []), ("second", []), ("faulty", broken))):
        with FrameRecorder(tmp_path / f"{name}.log") as recorder:
            recorder.write("can0", FrameBlock.from_frames(frames_of(config, seed + number, faults, 60.0)))
    text = (tmp_path / "robot.toml").read_text(encoding="utf-8").replace(VARYING, "")
    (tmp_path / "plain.toml").write_text(text, encoding="utf-8")
    where = [
        *("--config", str(tmp_path / "plain.toml")),
        *("--axis", "axis1", "-o", str(tmp_path / "nominal.toml")),
    ]
    schedule = ("--schedule", "fm: temperature", "--schedule", "Ja: cos(angle2)")
    result = CliRunner().invoke(app, ["identify", str(tmp_path / "healthy.log"), *where, *schedule])
    assert result.exit_code == 0, result.output
    found = read_found(NominalFile, tmp_path / "nominal.toml")
    slopes = {v.parameter: v.slope for v in found.schedule}
    print(f"slopes {slopes}, colour {found.predictor.colour:.3g}")
    assert slopes["fm"] == pytest.approx(-0.0012, rel=0.01)
    assert slopes["Ja"] == pytest.approx(15.0, rel=0.05)
    assert replayed(watching(tmp_path, text), tmp_path / "second.log")["alarms"] == []
    (alarm,) = replayed(tmp_path / "watch.toml", tmp_path / "faulty.log")["alarms"]
    assert (alarm["parameter"], alarm["direction"]) == ("fm", "up")


def watching(folder: Path, text: str) -> Path:
    """The first axis with the nominal values that were found, and without any of its own."""
    first, second = text.split('[[robot.axis]]\nname = "axis2"')
    before, after = first.split("[robot.axis.model.nominal]")
    estimator = after[after.index("[robot.axis.estimator]") :]
    estimator = re.sub(r"(initial_p|torque_noise|output_noise) = .*\n", "", estimator)
    replacement = 'nominal_file = "nominal.toml"\nmonitor ='
    first = before.replace("monitor =", replacement, 1) + estimator
    (folder / "watch.toml").write_text(f'{first}[[robot.axis]]\nname = "axis2"{second}', encoding="utf-8")
    return folder / "watch.toml"
