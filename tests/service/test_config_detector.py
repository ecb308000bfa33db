"""Which detector alarms: as said, else the bank where it has thresholds of its own; refused by line where it cannot."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from service.commands.check import check
from service.config import load
from service.config.axis_settings import AxisError, axis_model, axis_settings
from service.config.detector_choice import Detectors, detectors_of
from tests.service.calibration.test_thresholds_file import named
from tests.service.calibration.thresholds_texts import thresholds_text
from tests.service.identification.conftest import robot_text, write_robot

app = typer.Typer()
app.command()(check)

OWN = [
    {"cause": "kT", "size": 0.2, "h": 9.0, "allowance": 0.01, "alike": ["torque scale"]},
    {"cause": "torque sign", "h": 8.0},
]


def hypotheses(entries: list[dict[str, object]]) -> str:
    rows = [f"{key} = {json.dumps(value)}" for one in entries for key, value in (("", ""), *one.items())]
    return "\n" + "\n".join("[[hypothesis]]" if row == ' = ""' else row for row in rows) + "\n"


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return write_robot(tmp_path)


def detector(path: Path, *rows: str) -> Path:
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("[robot.axis.detector]\n", "\n".join(["[robot.axis.detector]", *rows, ""])),
        encoding="utf-8",
    )
    return path


def calibrated(path: Path, entries: list[dict[str, object]]) -> Path:
    axis = load(path, {}).axes[0].config
    (path.parent / "thresholds.toml").write_text(
        thresholds_text(axis) + hypotheses(entries), encoding="utf-8"
    )
    path.write_text(named(robot_text()), encoding="utf-8")
    return path


def found(path: Path) -> Detectors:
    (axis,) = load(path, {}).axes
    model = axis_model(axis.config)
    return detectors_of(axis, model, axis_settings(axis, model))


def checked(path: Path) -> str:
    result = CliRunner().invoke(app, ["--config", str(path)], env={"COLUMNS": "300"})
    assert result.exit_code == 0, result.stderr
    return re.sub(r"\s+", " ", result.stdout)


def test_unless_said_the_paper_alarms_and_the_bank_looks_on(robot: Path) -> None:
    one = found(robot)
    assert one.alarm_source == "cusum"
    assert one.multimodel is not None
    assert "alarms: cusum (multimodel in shadow mode)" in checked(robot)


def test_alone(robot: Path) -> None:
    assert found(detector(robot, "shadow = false")) == Detectors("cusum", None, "")
    assert "multimodel" not in checked(robot)


def test_the_bank_without_a_record_is_said_to_go_by_the_guarantee(robot: Path) -> None:
    one = found(detector(robot, 'alarm_source = "multimodel"', "budget_s = 3600.0"))
    assert one.alarm_source == "multimodel"
    said = checked(robot)
    assert "at most one false alarm in an hour if the model is exact" in said
    assert "axiswatch calibrate" in said


def test_with_thresholds_of_its_own_the_bank_alarms(robot: Path) -> None:
    one = found(calibrated(robot, OWN))
    assert one.alarm_source == "multimodel"
    assert one.multimodel is not None
    assert one.multimodel.bank.causes == ("kT", "torque sign")
    assert one.multimodel.bank.hypotheses[0].alike == ("torque scale",)
    said = checked(robot)
    assert "alarms: multimodel (h from its records)" in said
    assert "guarantee" not in said
    assert found(detector(robot, 'alarm_source = "cusum"')).alarm_source == "cusum"


def test_a_file_of_thresholds_without_the_bank(robot: Path) -> None:
    assert found(calibrated(robot, [])).alarm_source == "cusum"


def test_a_file_for_other_causes(robot: Path) -> None:
    calibrated(robot, [{"cause": "fc", "size": 0.2, "h": 9.0}])
    with pytest.raises(AxisError, match="limits of fc, which the axis does not have"):
        found(robot)


VARYING: Callable[[str], str] = lambda text: (  # noqa: E731
    text
    + '[[robot.axis.signal]]\nname = "temperature"\ncolumn = "temp"\n'
    + '[[robot.axis.model.schedule]]\nparameter = "fm"\nsignal = "temperature"\nslope = -0.001\nreference = 40.0\n'
)


def read_from_files(change: Callable[[str], str], robot: Path) -> None:
    """The same robot without a bus."""
    own = robot.read_text(encoding="utf-8")
    text = re.sub(r"^(bus|message|signal|counter_\w+) = .*\n", "", own, flags=re.MULTILINE)
    text = re.sub(r"^\[\[bus\]\].*?(?=^\[\[robot\]\])", "", text, flags=re.MULTILINE | re.DOTALL)
    robot.write_text(change(text), encoding="utf-8")


def test_where_nominal_values_vary_the_bank_looks_on_unless_it_is_asked_for(robot: Path) -> None:
    """Also with thresholds of its own."""
    calibrated(robot, [{"cause": "fm", "size": 0.2, "h": 9.0}])
    read_from_files(VARYING, robot)
    one = found(robot)
    assert one.alarm_source == "cusum"
    assert one.multimodel is not None
    assert found(detector(robot, 'alarm_source = "multimodel"')).alarm_source == "multimodel"
