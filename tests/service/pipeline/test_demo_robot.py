"""The simulated robot of the demo under the demo's settings: quiet while healthy, each fault named."""

import re
from pathlib import Path

import pytest

from service.pipeline.alarms import AxisAlarm
from service.pipeline.axis_monitors import FramePipeline
from service.simulation.robot import Fault, FaultError, SimulatedRobot
from tests.service.pipeline.robots import blocks, demo, live

FAULT_S = 20.0


def alarms(folder: Path, axes: int, seconds: float, seed: int, faults: list[Fault]) -> list[AxisAlarm]:
    """The first change of every alarm, and the one that gave it its name."""
    config = demo(folder, axes)
    core = FramePipeline(config)
    found: dict[tuple[str, ...], AxisAlarm] = {}
    for change in live(core, blocks(config, seconds, seed, faults)):
        alarm = change.alarm
        found.setdefault((change.axis_id, alarm.parameter, alarm.direction, alarm.stage), change)
    assert all(sum(core.ingests["can0"].axes[axis.id].dropped.values()) == 0 for axis in config.axes)
    return list(found.values())


def test_healthy_axes_are_quiet(tmp_path: Path, seed: int) -> None:
    assert alarms(tmp_path, 6, 30.0, seed, []) == []


@pytest.mark.parametrize(
    ("name", "factor", "direction"), [("fm", 1.3, "up"), ("kT", 0.9, "down"), ("1/Ja", 1.1, "up")]
)
def test_a_fault_is_found_and_named(
    tmp_path: Path, seed: int, name: str, factor: float, direction: str
) -> None:
    fault = Fault("demo.axis2", {name: factor}, FAULT_S)
    found = alarms(tmp_path, 2, FAULT_S + 30, seed, [fault])
    first = found[0]
    assert (first.alarm.parameter, first.alarm.direction) == (name, direction)
    assert {change.axis_id for change in found} == {"demo.axis2"}
    assert first.alarm.onset_us >= 1_760_000_000_000_000 + FAULT_S * 1e6
    nominal = demo(tmp_path).axes[1].config.model.nominal
    change = (factor - 1) * (1 / nominal["Ja"] if name == "1/Ja" else nominal[name])
    named = [c.alarm for c in found if c.alarm.size is not None]
    assert {a.parameter for a in named} == {name}
    assert 0 < (named[-1].size or 0.0) / change < 1.5


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (Fault("demo.axis1", {"fn": 1.3}, 1), "no parameter 'fn' in axis demo.axis1; there is Jm, Jg"),
        (Fault("demo.axis1", {"Jm": -1.0}, 1), "inertia of the motor must be finite and greater than zero"),
        (Fault("demo.axis1", {"1/Ja": 0.0}, 1), "fault: "),
    ],
)
def test_an_impossible_fault_is_said(tmp_path: Path, fault: Fault, message: str) -> None:
    with pytest.raises(FaultError, match=re.escape(message)):
        SimulatedRobot(demo(tmp_path), faults=[fault])
