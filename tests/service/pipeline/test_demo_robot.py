"""The simulated robot of the demo under its commissioned monitor: quiet while healthy, each fault named in a second."""

import re
from pathlib import Path

import pytest

from service.config import Config, load
from service.config.drive_sources import shipped
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import FramePipeline
from service.simulation.robot import FaultError, SimulatedFault, SimulatedRobot
from tests.service.pipeline.robots import START_US, blocks, demo, with_axes
from tests.shares import soaked

FAULT_S = 10.0
NAMED_S = 1.2
"""Within this time of its onset a fault has its name."""


def commissioned(axes: int) -> Config:
    """What the demo's daemon runs with, for its first axes."""
    config = load(shipped("demo/axiswatch.toml"), {})
    return with_axes(config, config.robot[0].axis[:axes])


def alarms(
    folder: Path, axes: int, seconds: float, seed: int, faults: list[SimulatedFault]
) -> list[tuple[float, AxisAlarm]]:
    """Every change of an alarm, with the time since the start at which it is known."""
    core, found, end_s = FramePipeline(commissioned(axes)), list[tuple[float, AxisAlarm]](), 0.0
    for frames in blocks(demo(folder, axes), seconds, seed, faults):
        core.take("can0", frames)
        end_s = 1e-6 * (int(frames.t_us[-1]) - START_US) if frames.size else end_s
        found += [(end_s, change) for change in core.update()]
    assert all(sum(counts.dropped.values()) == 0 for counts in core.ingests["can0"].axes.values())
    return found


def test_healthy_axes_are_quiet(tmp_path: Path, seed: int) -> None:
    assert alarms(tmp_path, 6, 20.0, seed, []) == []


@pytest.mark.parametrize(
    ("name", "factor", "direction"),
    soaked([("fm", 1.3, "up"), ("kT", 0.9, "down"), ("1/Ja", 1.1, "up")], ("kT", 0.9, "down")),
)
def test_a_fault_is_named_in_a_second(tmp_path: Path, seed: int, name: str, factor: float, direction: str) -> None:
    fault = SimulatedFault("demo.axis2", {name: factor}, FAULT_S)
    found = alarms(tmp_path, 2, FAULT_S + 5, seed, [fault])
    assert {(c.axis_id, c.alarm.parameter, c.alarm.direction) for _, c in found if c.alarm.stage == "named"} == {
        ("demo.axis2", name, direction)
    }
    first = found[0][1].alarm
    assert first.raised_us >= START_US + FAULT_S * 1e6
    named_s = next(time_s for time_s, change in found if change.alarm.stage == "named")
    assert named_s - FAULT_S < NAMED_S
    truth = commissioned(2).axes[1].config.model.nominal_file
    assert truth is not None
    nominal = 1 / truth.values["Ja"] if name == "1/Ja" else truth.values[name]
    last = found[-1][1].alarm
    assert 0 < (last.size or 0.0) / ((factor - 1) * nominal) < 1.5


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (SimulatedFault("demo.axis1", {"Jm": -1.0}, 1), "inertia of the motor must be finite and greater than zero"),
        (SimulatedFault("demo.axis1", {"1/Ja": 0.0}, 1), "fault: "),
    ],
)
def test_an_impossible_fault_is_said(tmp_path: Path, fault: SimulatedFault, message: str) -> None:
    with pytest.raises(FaultError, match=re.escape(message)):
        SimulatedRobot(demo(tmp_path), faults=[fault])
