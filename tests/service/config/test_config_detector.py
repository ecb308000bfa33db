"""Thresholds from a file, and which detector alarms; refused by line where they cannot be used."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from monitor_core.drive import HEAT
from monitor_core.settings import Threshold
from service.config import Config, ConfigErrors, load
from service.config.axis_detectors import Detectors, alarm_source_of, detectors_of
from service.config.axis_settings import AxisError, axis_settings
from service.config.drives import axis_model
from tests.end_to_end.processes import edit
from tests.service.command_line import shown
from tests.service.commands.identify.conftest import robot_text, write_robot
from tests.service.found_files import named, thresholds_text

OWN = [
    {"cause": "kT", "size": 0.2, "h": 9.0, "allowance": 0.01, "alike": ["torque scale"]},
    {"cause": "torque sign", "h": 8.0},
]


def hypotheses(entries: list[dict[str, object]]) -> str:
    rows = [f"{key} = {json.dumps(value)}" for entry in entries for key, value in (("", ""), *entry.items())]
    return "\n" + "\n".join("[[hypothesis]]" if row == ' = ""' else row for row in rows) + "\n"


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return write_robot(tmp_path)


def detector(path: Path, *rows: str) -> Path:
    return edit(path, ("[robot.axis.detector]\n", "\n".join(["[robot.axis.detector]", *rows, ""])))


def calibrated(path: Path, entries: list[dict[str, object]], *thresholds: float) -> Path:
    axis = load(path, {}).axes[0].config
    text = thresholds_text(axis, *thresholds) + hypotheses(entries)
    (path.parent / "thresholds.toml").write_text(text, encoding="utf-8")
    path.write_text(named(robot_text()), encoding="utf-8")
    return path


def found(path: Path) -> Detectors:
    (axis,) = load(path, {}).axes
    model = axis_model(axis.config)
    return detectors_of(axis, model, axis_settings(axis, model))


def checked(path: Path) -> str:
    return re.sub(r"\s+", " ", shown("check", "--config", path))


def test_by_default_the_cusum_tests_alarm_and_the_multimodel_detector_runs_in_shadow_mode(
    robot: Path,
) -> None:
    detectors = found(robot)
    assert detectors.alarm_source == "cusum"
    assert detectors.multimodel is not None
    assert "alarms: cusum (multimodel in shadow mode)" in checked(robot)
    assert found(detector(robot, "shadow = false")) == Detectors("cusum", None, "")
    assert "multimodel" not in checked(robot)


def test_a_multimodel_detector_without_a_record_has_the_guaranteed_thresholds(robot: Path) -> None:
    detectors = found(detector(robot, 'alarm_source = "multimodel"', "budget_s = 3600.0"))
    assert detectors.alarm_source == "multimodel"
    output = checked(robot)
    assert "at most one false alarm in an hour if the model is exact" in output
    assert "axiswatch calibrate" in output


def test_with_thresholds_of_its_own_the_multimodel_detector_alarms(robot: Path) -> None:
    detectors = found(calibrated(robot, OWN))
    assert detectors.alarm_source == "multimodel"
    assert detectors.multimodel is not None
    assert detectors.multimodel.bank.causes == ("kT", "torque sign")
    assert detectors.multimodel.bank.hypotheses[0].alike == ("torque scale",)
    output = checked(robot)
    assert "alarms: multimodel (h from its records)" in output
    assert "guarantee" not in output
    assert found(detector(robot, 'alarm_source = "cusum"')).alarm_source == "cusum"


def test_the_file_has_the_share_of_the_evidence_that_counts_for_causes(robot: Path) -> None:
    """In files of earlier versions it is not there, and all of the evidence counts."""
    before = found(calibrated(robot, OWN)).multimodel
    file = robot.parent / "thresholds.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(f"{text}[naming]\nevidence_share = 0.25\n", encoding="utf-8")
    now = found(robot).multimodel
    assert before is not None
    assert now is not None
    assert (before.bank.evidence_share, now.bank.evidence_share) == (1.0, 0.25)
    file.write_text(f"{text}[naming]\nevidence_share = 0.0\n", encoding="utf-8")
    with pytest.raises(ConfigErrors, match=r"thresholds.toml.*evidence_share.*greater than 0"):
        found(robot)


def test_a_file_of_thresholds_without_hypotheses_or_for_other_causes(robot: Path) -> None:
    assert found(calibrated(robot, [])).alarm_source == "cusum"
    calibrated(robot, [{"cause": "fc", "size": 0.2, "h": 9.0}])
    with pytest.raises(AxisError, match="thresholds of fc, which the axis does not have"):
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


def test_with_a_schedule_the_multimodel_detector_runs_in_shadow_mode_unless_configured(robot: Path) -> None:
    """Also with thresholds of its own."""
    calibrated(robot, [{"cause": "fm", "size": 0.2, "h": 9.0}])
    read_from_files(VARYING, robot)
    detectors = found(robot)
    assert detectors.alarm_source == "cusum"
    assert detectors.multimodel is not None
    assert found(detector(robot, 'alarm_source = "multimodel"')).alarm_source == "multimodel"


def test_where_nominal_values_follow_the_heat_alone_the_bank_alarms(robot: Path) -> None:
    """Not where friction is tested with a wider allowance beyond the heat of the records, which it does not have."""
    calibrated(robot, [{"cause": "fm", "size": 0.2, "h": 9.0}])
    read_from_files(VARYING, robot)
    axis = load(robot, {}).axes[0].config
    (warming,) = (v.model_copy(update={"signal": HEAT}) for v in axis.model.schedule)
    axis = axis.model_copy(update={"model": axis.model.model_copy(update={"schedule": [warming]})})
    assert alarm_source_of(axis, from_record=True) == "multimodel"
    assert alarm_source_of(axis, from_record=False) == "cusum"
    wide = axis.model_copy(update={"detector": axis.detector.model_copy(update={"outside_calibration": "widen"})})
    assert alarm_source_of(wide, from_record=True) == "cusum"


# --- a file of thresholds is used by the monitor that it was made for, and by no other ----------------------


@pytest.fixture
def thresholded(robot: Path) -> Path:
    return calibrated(robot, [], 1.5, 7.0, 0.02)


def settings(config: Config) -> tuple[Threshold, ...]:
    axis = config.axes[0]
    return axis_settings(axis, axis_model(axis.config)).thresholds


def test_a_file_of_thresholds_is_used(thresholded: Path) -> None:
    assert settings(load(thresholded, {})) == (Threshold(1.5, 7.0, 0.02),) * 3


def test_to_calibrate_it_is_passed_over(thresholded: Path) -> None:
    (thresholded.parent / "thresholds.toml").write_text("no thresholds", encoding="utf-8")
    assert settings(load(thresholded, {}, thresholds=False)) == ()


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
def test_of_another_monitor_it_is_refused(thresholded: Path, pattern: str, replacement: str, reason: str) -> None:
    text = re.sub(pattern, replacement, thresholded.read_text(encoding="utf-8"), flags=re.MULTILINE)
    thresholded.write_text(text, encoding="utf-8")
    with pytest.raises(AxisError, match=rf"thresholds\.toml was made with {reason}.*calibrate"):
        settings(load(thresholded, {}))


def test_equal_thresholds_in_both_files_are_allowed(thresholded: Path) -> None:
    text = thresholded.read_text(encoding="utf-8")
    repeated = text.replace("[robot.axis.detector]\n", "[robot.axis.detector]\nalpha_1 = 1.5\n")
    thresholded.write_text(repeated, encoding="utf-8")
    assert settings(load(thresholded, {}))
