"""Operating conditions in the configuration: what they mean, and what `axiswatch check` says of them."""

import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from monitor_core.drive.operating_conditions import Conditions, Follow, Gate, Term
from service.commands.main import app
from service.config import conditions_of, needed
from tests.service.config_texts import BASE, CONFIG, furnish, loaded, with_conditions


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return furnish(tmp_path)


def test_all_that_may_be_said(folder: Path) -> None:
    config = loaded(
        folder,
        with_conditions(model='conditions = "followed"\n').replace(
            "_s = 0.005", "_s = 0.005\nmin_speed = 0.2", 1
        ),
    )
    axis, second = config.axes
    assert conditions_of(axis) == Conditions(
        ("temperature", "mode", "speed2"),
        (
            Follow("fm", Term("", "temperature"), -0.0004, 40.0, 20.0, 60.0),
            Follow("kT", Term("cos", "speed2"), 0.1, 1.0),
        ),
        (Gate("mode", (3.0, 4.0)), Gate("temperature", above=5.0)),
        0.2,
    )
    assert [(s.name, s.message, s.factor, s.max_age_s) for s in needed(axis)] == [
        ("temperature", "RobotState", 1.0, 10.0),
        ("mode", "RobotState", 1.0, 2.0),
        ("speed2", "Axis2Speed", 0.01, 10.0),
    ]
    assert not conditions_of(second)
    assert needed(second) == ()


def test_what_is_absent_changes_nothing(folder: Path) -> None:
    config = loaded(folder, BASE)
    assert not any(conditions_of(axis) for axis in config.axes)


def test_the_example_in_the_documents_is_right(folder: Path) -> None:
    document = (CONFIG.parent / "docs" / "operation.md").read_text(encoding="utf-8")
    section = document[document.index("## Operating conditions") :]
    example = section.split("```toml\n", 1)[1].split("```", 1)[0]
    axis, _ = loaded(
        folder, with_conditions(example, "", "").replace('name = "second"', 'name = "axis2"')
    ).axes
    assert [source.name for source in axis.sources] == ["temperature", "angle2", "mode"]
    assert conditions_of(axis).gates == (Gate("mode", (2.0, 3.0)),)


def test_signals_of_tables_need_no_bus(folder: Path) -> None:
    """With a configuration that has none, only identification reads them."""
    content = """[[robot]]
name = "r"
[[robot.axis]]
name = "a"
sample_interval_s = 0.005
torque = { column = "u" }
angle = { column = "y" }
signal = [{ name = "t", column = "warm" }, { name = "other", axis = "b" }]
model = { drive = "three-mass", monitor = ["fm"], schedule = [
  { parameter = "fm", signal = "t", slope = 0.001, reference = 1.0 },
  { parameter = "fm", signal = "other", slope = 0.001, reference = 1.0 } ] }
[[robot.axis]]
name = "b"
sample_interval_s = 0.005
torque = { column = "v" }
angle = { column = "z", factor = 2.0 }
model = { drive = "three-mass", monitor = ["fm"] }
"""
    one, _ = loaded(folder, content).axes
    assert [(s.column, s.factor, s.message) for s in one.sources] == [("warm", 1.0, None), ("z", 2.0, None)]
    assert conditions_of(one).follows[0].high == math.inf


def check(folder: Path, content: str) -> str:
    slow = content.replace("[robot.axis.estimator]\n", "[robot.axis.estimator]\nmemory_s = 10.0\n", 1)
    slow = slow.replace("{ predictor =", "{ memory_s = 10.0, predictor =", 1)
    (folder / "a.toml").write_text(slow, encoding="utf-8")
    result = CliRunner().invoke(app, ["check", "--config", str(folder / "a.toml")], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    return result.output


def test_check_tells_the_conditions_and_what_is_taken_for_granted(folder: Path) -> None:
    said = check(folder, with_conditions())
    for words in ("fm follows temperature", "kT follows cos(speed2)", "only while mode is 3 or 4", "above 5"):
        assert words in said
    assert "demo: second: monitored as if the other axes stood still" in said


@pytest.mark.parametrize(
    ("content", "names"),
    [
        (BASE, "first, second"),
        (
            BASE.replace(
                'monitor = ["kT", "fm"]', 'monitor = ["kT", "fm"]\nconditions = "others stand still"'
            ),
            "second",
        ),
        (with_conditions(schedules=""), "second"),
        (with_conditions(gates=""), "second"),
    ],
)
def test_who_says_nothing_is_noted(folder: Path, content: str, names: str) -> None:
    assert f"Note: demo: {names}: monitored as if" in check(folder, content)


def test_a_robot_of_one_axis_is_not_noted(folder: Path) -> None:
    alone = BASE[: BASE.index('[[robot.axis]]\nname = "second"')]
    assert "monitored as if" not in check(folder, alone)
