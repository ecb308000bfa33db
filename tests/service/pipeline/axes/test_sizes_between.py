"""A change whose size lies in the middle between two hypotheses of its cause keeps its name."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.samples import SampleBlock
from service.config import NamedAxis, load
from service.config.drive_sources import shipped
from service.config.drives import axis_model
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import AxisMonitors
from tests.service.robot_tables import course
from tests.shares import soaked

HEALTHY, SAMPLES, BLOCK = 4_000, 14_000, 200


@pytest.fixture(scope="module")
def axis() -> NamedAxis:
    """An axis with Coulomb friction, commissioned, as the demo ships it."""
    return load(shipped("demo/axiswatch.toml"), {}).axes[2]


# kT 0.93 .. 1.16 are e^-0.07 .. e^0.15.  Friction that the scale of the output does not change may make up for the
# error of the nearest size: the scale of the output must not be named for that.
@pytest.mark.parametrize(
    ("name", "factor"),
    soaked(
        [
            *(("kT", factor) for factor in (0.85, 0.93, 1.16, 0.75)),
            *(("1/Ja", factor) for factor in (0.85, 1.16)),
            *(("fm", factor) for factor in (0.75, 1.16)),
        ],
        ("kT", 0.85),
    ),
)
def test_the_cause_is_named(axis: NamedAxis, name: str, factor: float, seed: int) -> None:
    alarms = {a.key: a.alarm for a in changed(axis, {name: factor}, seed)}
    print([(a.parameter, a.stage, a.size, a.size_sd) for a in alarms.values()])
    (alarm,) = alarms.values()
    assert (alarm.stage, alarm.parameter) == ("named", name)
    assert alarm.ended_us is None
    assert alarm.size is not None
    assert alarm.size_sd is not None
    nominal = axis_model(axis.config).nominal
    value = 1 / nominal["Ja"] if name == "1/Ja" else nominal[name]
    assert alarm.size == pytest.approx(value * (factor - 1), abs=3 * alarm.size_sd)


def changed(axis: NamedAxis, fault: dict[str, float], seed: int) -> list[AxisAlarm]:
    """Every change of an alarm of the axis while it is simulated; the fault occurs after a while."""
    u, y = course(axis, seed, SAMPLES, fault, HEALTHY)
    monitors = AxisMonitors([axis])
    t_us = np.arange(SAMPLES, dtype=np.int64) * round(1e6 * axis.config.sample_interval_s)
    found = list[AxisAlarm]()
    for at in range(0, SAMPLES, BLOCK):
        part = slice(at, at + BLOCK)
        found += monitors.update({axis.id: SampleBlock(t_us[part], u[part], y[part])})
    return found
