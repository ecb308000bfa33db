"""Joint 1 of a UR10e, watched as the daemon would: friction over 60 s at 94 Hz, with all the jitter of its times."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from monitor_core.identification.greybox import Estimate, colour_of
from monitor_core.identification.records import Record
from monitor_core.kernel.block import Trace
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from service.config import AxisConfig, NamedAxis
from service.config.axis_settings import axis_settings
from service.config.base_table import Reading
from service.config.drives import axis_model
from tests.core.alarm_versions import alarm_versions
from tests.real.drives import ONE_MASS
from tests.real.test_ur10e import INTERVAL_S, SPEED_SCALE, estimate, read

pytestmark = pytest.mark.records

WATCHED = ("fv", "fc")
MEMORY_S = 3.0
"""The joint swings with periods of up to ten seconds: in one of them alone fv and fc look alike."""


@pytest.fixture(scope="module")
def record(records_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read(records_dir, "ur-20_01_22-joint_1.csv", tmp_path_factory.mktemp("ur10e"), 1).record


@pytest.fixture(scope="module")
def found(record: Record) -> Estimate:
    return estimate(record, 1)


@pytest.fixture(scope="module")
def watched(
    found: Estimate, record: Record, tmp_path_factory: pytest.TempPathFactory
) -> tuple[AxisModel, Settings]:
    """What the daemon makes of a configuration with these values and noises, and else its defaults."""
    folder = tmp_path_factory.mktemp("joint")
    (folder / "joint.mo").write_text(ONE_MASS, encoding="utf-8")
    nominal = {name: float(found.values[name]) for name in ("kT", "J", *WATCHED, "tau0")}
    values: dict[str, Any] = {
        "name": "joint1",
        "sample_interval_s": INTERVAL_S,
        "torque": {"column": "torque"},
        "angle": {"column": "angle"},
        "model": {
            "drive": "joint.mo",
            "monitor": WATCHED,
            "friction_speed_scale": SPEED_SCALE,
            "nominal": nominal,
        },
        "estimator": {
            "memory_s": MEMORY_S,
            "torque_noise": float(found.noise["torque"]),
            "output_noise": float(found.noise["output"]),
            "innovation_variance": found.lam0 * colour_of(found, WATCHED, [record]),
        },
    }
    config = AxisConfig.model_validate(values, context=Reading(folder))
    model = axis_model(config)
    return model, axis_settings(NamedAxis("ur10e.joint1", "ur10e", config), model)


def run(
    watched: tuple[AxisModel, Settings], record: Record, u: Floats
) -> tuple[list[Alarm], Trace, AxisMonitor]:
    monitor = AxisMonitor(*watched)
    episodes, trace = alarm_versions(
        monitor, SampleBlock(np.round(record.t * 1e6).astype(np.int64), u, record.y)
    )
    return episodes, trace, monitor


@pytest.mark.parametrize("memory_s", [1.0, MEMORY_S])
def test_friction_is_tracked_for_a_minute_without_an_alarm(
    memory_s: float, watched: tuple[AxisModel, Settings], record: Record
) -> None:
    model, settings = watched
    assert set(np.rint(record.intervals * 1e3)) <= {2, 10, 12}  # the jitter is still there
    settings = replace(settings, lam=1 - INTERVAL_S / memory_s)
    episodes, trace, monitor = run((model, settings), record, record.u)
    assert episodes == []
    assert (trace.g < model.scale).all()
    counters = monitor.status().counters
    assert counters["used"] + counters["seeding"] > 0.97 * len(record)
    learned = np.isfinite(trace.eps) & (trace.theta != model.theta0).any(axis=1)
    reported = np.sqrt(settings.lam0 * trace.P[learned] / (1 + settings.lam))
    deviation = trace.theta[learned] - model.theta0
    print(f"memory {memory_s} s: largest deviation {abs(deviation / model.theta0).max(axis=0)}")
    assert np.sqrt(np.mean((deviation / reported) ** 2)) < 1.2
    assert (deviation != 0).all()
    if memory_s == MEMORY_S:
        assert abs(deviation / model.theta0).max() < 0.2


@pytest.mark.parametrize(("name", "change"), [("fc", 0.3), ("fc", -0.3), ("fv", 0.3), ("fv", -0.3)])
def test_a_change_of_friction_in_the_second_half_is_named(
    name: str, change: float, watched: tuple[AxisModel, Settings], record: Record
) -> None:
    """The same motion would have needed another torque."""
    model, _ = watched
    half, speed = len(record) // 2, np.gradient(record.y, record.t)
    acting = {"fc": np.tanh(speed / SPEED_SCALE), "fv": speed}[name]
    u = record.u.copy()
    u[half:] += change * model.nominal[name] * acting[half:]
    episodes = run(watched, record, u)[0]
    assert {(e.parameter, e.direction) for e in episodes} == {(name, "up" if change > 0 else "down")}
    assert record.t[half] < episodes[0].raised_us * 1e-6 < record.t[half] + 15
    assert episodes[-1].size / model.nominal[name] == pytest.approx(change, abs=0.1)
