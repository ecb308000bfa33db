"""A file of thresholds is used by the monitor that it was made for, and by no other."""

import re
from pathlib import Path

import pytest

from monitor_core.settings import Threshold
from service.config import Config, load
from service.config.axis_settings import AxisError, axis_model, axis_settings
from tests.service.calibration.thresholds_texts import thresholds_text
from tests.service.identification.conftest import robot_text, write_robot

NAMED = '[robot.axis.model]\nthresholds_file = "thresholds.toml"\n'


def named(text: str) -> str:
    """The configuration with a file of thresholds in place of its own."""
    text = re.sub(r"^alpha_[12] = .*\n", "", text, flags=re.MULTILINE)
    return text.replace("[robot.axis.model]\n", NAMED)


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = write_robot(tmp_path)
    (tmp_path / "thresholds.toml").write_text(
        thresholds_text(load(path, {}).axes[0].config, 1.5, 7.0, 0.02), encoding="utf-8"
    )
    path.write_text(named(robot_text()), encoding="utf-8")
    return path


def settings(config: Config) -> tuple[Threshold, ...]:
    axis = config.axes[0]
    return axis_settings(axis, axis_model(axis.config)).thresholds


def test_it_is_used(robot: Path) -> None:
    assert settings(load(robot, {})) == (Threshold(1.5, 7.0, 0.02),) * 3


def test_to_calibrate_it_is_passed_over(robot: Path) -> None:
    (robot.parent / "thresholds.toml").write_text("no thresholds", encoding="utf-8")
    assert settings(load(robot, {}, thresholds=False)) == ()


@pytest.mark.parametrize(
    ("pattern", "replacement", "reason"),
    [
        (r"^fm = .*", "fm = 0.05", "fm = 0.06, now it is 0.05"),
        (r"^torque_noise = .*", "torque_noise = 0.2", "innovation_variance = "),
        (
            r"^\[robot.axis.estimator\]",
            "[robot.axis.estimator]\nmin_excitation = 0.1",
            "min_excitation = 0.05",
        ),
    ],
)
def test_of_another_monitor_it_is_refused(robot: Path, pattern: str, replacement: str, reason: str) -> None:
    text = re.sub(pattern, replacement, robot.read_text(encoding="utf-8"), flags=re.MULTILINE)
    robot.write_text(text, encoding="utf-8")
    with pytest.raises(AxisError, match=rf"thresholds\.toml was made with {reason}.*calibrate"):
        settings(load(robot, {}))


def test_what_is_said_twice_may_be_the_same(robot: Path) -> None:
    text = robot.read_text(encoding="utf-8")
    said = text.replace("[robot.axis.detector]\n", "[robot.axis.detector]\nalpha_1 = 1.5\n")
    robot.write_text(said, encoding="utf-8")
    assert settings(load(robot, {}))
