"""The robot of the demo for an hour: no alarm while it is healthy, and the right one when it is not."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from monitor_core.samples import SampleBlock
from service.config import Config, load
from service.config.drive_sources import shipped
from service.pipeline.alarms import AxisAlarm
from service.pipeline.axis_monitors import AxisMonitors
from service.simulation.robot import Fault, Moment, SimulatedRobot

pytestmark = pytest.mark.soak

HOUR_S = 3600
PART_S = 10
FAULT_AFTER_S, FAULTY_S = 60.0, 180
"""As in the demo; the alarm comes within the second minute after it."""


@pytest.fixture(scope="module")
def config() -> Config:
    return load(shipped("demo.toml"), {})


def test_an_hour_without_a_fault_is_an_hour_without_an_alarm(config: Config, seed: int) -> None:
    monitors = AxisMonitors(config.axes)
    changes = list(run(SimulatedRobot(config, seed), monitors, HOUR_S))
    assert changes == []
    for monitor in monitors.by_id.values():
        facts = monitor.status()
        assert facts.counters["used"] > 0.99 * facts.samples > 0.9 * HOUR_S * 200
        for p in facts.parameters:
            print(f"{p.name}: {p.estimate / p.nominal - 1:+.4f}, sd {p.standard_deviation / p.nominal:.4f}")
            assert max(p.g_up, p.g_down) < p.h


@pytest.mark.parametrize("factor", [1.3, 0.7])
def test_a_fault_is_named(factor: float, config: Config, seed: int) -> None:
    axis_id = config.axes[seed % len(config.axes)].id
    robot = SimulatedRobot(config, seed, [Fault(axis_id, {"fm": factor}, FAULT_AFTER_S)])
    changes = list(run(robot, AxisMonitors(config.axes), FAULTY_S))
    found = {(c.axis_id, c.alarm.parameter, c.alarm.direction) for c in changes}
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
