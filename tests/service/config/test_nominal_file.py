"""nominal_file: what the daemon takes from it; what it refuses is in config_mistakes/found.golden."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.operating_conditions import NominalSchedule
from monitor_core.drive.signal_terms import Term
from service.config import AxisConfig, Config, ConfigErrors, ConfigProblem, conditions_of, load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.config.remarks import remarks
from service.config.schema import SpeedConfig
from tests.demo_text import demo_text
from tests.end_to_end.processes import edit
from tests.service.command_line import shown
from tests.service.found_files import nominal_text

SHIPPED = Path(__file__).resolve().parents[3] / "config"
DEMO = demo_text()
NOMINAL = DEMO.split("[robot.axis.model.nominal]")[1].split("[robot.axis.estimator]")[0]
NOISES = "torque_noise = 0.05\noutput_noise = 0.0001\n"
ESTIMATOR = "[robot.axis.estimator]"
KIND = 'predictor = "innovations"\n'
SPEED_SCALE = "friction_speed_scale = 1.0"
AXIS = load(SHIPPED / "demo.toml", {}).axes[0].config


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """One axis of the demo, without nominal values, noises and P(0) of its own."""
    (tmp_path / "demo.dbc").symlink_to(SHIPPED / "demo.dbc")
    text = re.sub(r"initial_p = .*\n", "", DEMO.replace(NOISES, ""))
    before = "[robot.axis.model.nominal]" + NOMINAL
    assert before in text
    text = text.replace(before, "")
    text = text.replace('drive = "three-mass"\n', 'drive = "three-mass"\nnominal_file = "nominal.toml"\n')
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    return tmp_path / "robot.toml"


def file_with(robot: Path, changes: Mapping[str, Mapping[str, Any]] = {}, axis: AxisConfig = AXIS) -> Path:
    path = robot.parent / "nominal.toml"
    path.write_text(nominal_text(axis, changes), encoding="utf-8")
    return path


def problems(robot: Path) -> list[ConfigProblem]:
    with pytest.raises(ConfigErrors) as caught:
        load(robot, {})
    return caught.value.problems


def only(config: Config) -> Any:
    (axis,) = config.axes
    return axis


def test_everything_comes_from_the_file(robot: Path) -> None:
    model = axis_model(AXIS)
    gain = [float(k) for k in filter_gain(model, 0.005, 0.07, 1e-4)[0]]
    changes: dict[str, dict[str, Any]] = {
        "values": {"fm": 0.0723},
        "predictor": {"gain": gain, "innovation_variance": 3e-8, "torque_delay_s": 0.0012, "min_speed": 0.4},
        "drive": {"friction_speed_scale": 0.7},
    }
    file_with(robot, changes)
    edit(robot, (SPEED_SCALE, ""))
    axis = only(load(robot, {}))
    model = axis_model(axis.config)
    settings = axis_settings(axis._replace(config=axis.config.model_copy(update={"settling_time_s": 1})), model)
    assert model.nominal["fm"] == 0.0723
    assert (list(settings.K), settings.lam0) == (gain, 3e-8)
    assert (settings.delay_s, settings.speed_scale) == (0.0012, 0.7)
    assert conditions_of(axis).min_speed == 0.4
    edit(robot, ("sample_interval_s = 0.005", "sample_interval_s = 0.005\nmin_speed = 0.0"))
    assert conditions_of(only(load(robot, {}))).min_speed == 0.0


def test_output_error_has_no_gain(robot: Path) -> None:
    speed = AXIS.model_copy(update={"speed": SpeedConfig(message="Axis1State", signal="Angle"), "angle": None})
    file_with(robot, {"predictor": {"kind": "output-error", "gain": []}}, speed)
    edit(robot, ("[robot.axis.angle]", "[robot.axis.speed]"), (KIND, ""))
    axis = only(load(robot, {}))
    assert axis_settings(axis, axis_model(axis.config)).K == ()


def test_the_state_of_a_disturbance_belongs_to_the_drive(robot: Path) -> None:
    states = [*(f"x{i}" for i in range(6)), "torque disturbance"]
    predictor = {"states": states, "gain": [0.0] * 5 + [0.5, 0.1]}
    file_with(robot, {"drive": {"torque_disturbance": True}, "values": {"Td": 0.2}, "predictor": predictor})
    model = axis_model(only(load(robot, {})).config)
    assert [state.name for state in model.drive.states][-1] == "torque disturbance"
    assert model.nominal["Td"] == 0.2


@pytest.mark.parametrize("lam0", [4e-8, 1.2e-7])
def test_equal_values_in_the_file_and_the_configuration_are_allowed(robot: Path, lam0: float) -> None:
    """Of lambda_0 with its colour or without: the file has both."""
    found = {"innovation_variance": 4e-8, "colour": 3.0}
    file_with(robot, {"noise": {"torque": 0.05, "output": 0.0001}, "predictor": found})
    same = f'predictor = "innovations"\n{NOISES}innovation_variance = {lam0}\n'
    edit(
        robot,
        (KIND, same),
        ("[robot.axis.estimator]", f"[robot.axis.model.nominal]{NOMINAL}[robot.axis.estimator]"),
    )
    axis = only(load(robot, {}))
    settled = axis._replace(config=axis.config.model_copy(update={"settling_time_s": 1}))
    assert axis_settings(settled, axis_model(axis.config)).lam0 == pytest.approx(1.2e-7)


def test_no_error_that_the_records_have_is_an_outlier(robot: Path) -> None:
    """Of a file of an earlier version, which does not know the largest one: six standard deviations."""
    edit(robot, (KIND, ""))
    for found, least in (({"largest_error": 2e-3}, 3e-3), ({"innovation_variance": 4e-8}, 6 * 2e-4)):
        file_with(robot, {"predictor": found})
        axis = only(load(robot, {}))
        assert axis_settings(axis, axis_model(axis.config)).least_outlier == pytest.approx(least)


def test_bytes_that_are_no_text(robot: Path) -> None:
    (robot.parent / "nominal.toml").write_bytes(b"\xff\xfe")
    (problem,) = problems(robot)
    assert "no TOML" in problem.message


def test_check_names_the_file_of_the_values(robot: Path) -> None:
    file_with(robot)
    output = shown("check", "--config", robot)
    assert "nominal.toml" in output
    assert "of 2002-02-02" in output


def test_the_simulated_robot_has_the_values_and_noises_of_the_file(robot: Path) -> None:
    from service.simulation.axis import ControlledAxis

    file_with(robot, {"noise": {"output": 0.01}})
    axis = only(load(robot, {}))
    simulated = ControlledAxis(axis, np.random.default_rng(1))
    angles = np.array([simulated.sample(k).motion for k in range(400)])
    scatter = np.std(np.diff(angles, 3)) / np.sqrt(20)
    assert 0.008 < scatter < 0.015


FOLLOWS = """
[[schedule]]
parameter = "fm"
signal = "temperature"
slope = -0.0012
standard_deviation = 1e-5
reference = 32.5
range = [20.0, 45.0]
"""


TEMPERATURE = '[[robot.axis.signal]]\nname = "temperature"\nmessage = "Axis2State"\nsignal = "Torque"\n'


def test_nominal_values_follow_as_the_file_and_the_configuration_say(robot: Path) -> None:
    path = file_with(robot)
    path.write_text(path.read_text(encoding="utf-8") + FOLLOWS, encoding="utf-8")
    edit(robot, ("[robot.axis.model]\n", f"{TEMPERATURE}[robot.axis.model]\n"))
    (found,) = conditions_of(load(robot, {}).axes[0]).schedules
    assert found == NominalSchedule("fm", Term.read("temperature"), -0.0012, 32.5, 20.0, 45.0)
    table = '[[robot.axis.model.schedule]]\nparameter = "kT"\nsignal = "temperature"\nslope = 0.1\nreference = 30.0\n'
    edit(robot, (ESTIMATOR, f"{table}{ESTIMATOR}"))
    assert [follow.name for follow in conditions_of(load(robot, {}).axes[0]).schedules] == ["fm", "kT"]
    edit(robot, ('parameter = "kT"', 'parameter = "fm"'))
    (problem,) = problems(robot)
    assert "fm follows temperature already by robot[1].axis[1].model.nominal_file in line" in problem.message


def test_the_tests_allow_for_what_friction_is_off_by_beside_a_temperature(robot: Path) -> None:
    path = file_with(robot)
    text = path.read_text(encoding="utf-8") + FOLLOWS
    edit(robot, ("[robot.axis.model]\n", f"{TEMPERATURE}[robot.axis.model]\n"))
    for more, shares in (("model_error = 0.003\n", {"fm": 0.003 / AXIS.model.nominal["fm"]}), ("", {})):
        path.write_text(text + more, encoding="utf-8")
        axis = only(load(robot, {}))
        model = axis_model(axis.config)
        expected = [shares.get(name, 0.0) for name in model.monitored] if shares else []
        settings = axis_settings(axis, model)
        assert settings.model_error == pytest.approx(expected)
        allowances = 2 * np.array(expected or np.zeros(len(model.monitored)))
        assert (settings.tests(len(model.monitored))[2] >= allowances).all()


def _doubtful(sd: float, r: float) -> dict[str, dict[str, Any]]:
    fm, names = AXIS.model.nominal["fm"], ["Ja", "fm", "fc"]
    deviations = {"Ja": 1e-6, "fm": sd * fm, "fc": 0.1}
    matrix = [[1.0, 0.1, 0.2], [0.1, 1.0, r], [0.2, r, 1.0]]
    return {"standard_deviations": deviations, "correlation": {"names": names, "matrix": matrix}}


@pytest.mark.parametrize(
    ("sd", "r", "tested"), [(0.3, -0.98, False), (0.3, 0.98, False), (0.1, -0.98, True), (0.3, -0.9, True)]
)
def test_nominal_values_that_cannot_be_distinguished(robot: Path, sd: float, r: float, tested: bool) -> None:
    """They fit the motion of their record only: with another, they would alarm."""
    file_with(robot, _doubtful(sd, r))
    axis = load(robot, {}).axes[0]
    settings = axis_settings(axis, axis_model(axis.config))
    assert settings.unidentifiable == (() if tested else (("fm", "fc"),))
    notes = [note for note in remarks(load(robot, {})) if "distinguished" in note]
    assert notes == (
        []
        if tested
        else [
            "demo.axis1: fm and fc cannot be distinguished by the record of their nominal values: nothing is tested."
            " Identify the axis with a record of several speeds and accelerations, or with `axiswatch identify --fix"
            " fc`, which holds it at its value in the configuration"
        ]
    )
