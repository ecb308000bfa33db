"""Operating conditions in the configuration: what is right, and each mistake with its key and what would be right."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from monitor_core.drive.operating_conditions import Conditions, Follow, Gate, Term
from service.commands.main import app
from service.config import Config, ConfigErrors, conditions_of, load, needed

CONFIG = Path(__file__).resolve().parents[2] / "config"
BASE = (Path(__file__).parent / "config_base.toml").read_text(encoding="utf-8")

MODEL = "[robot.axis.model]\nmonitor"
NOMINAL = "[robot.axis.estimator]\ntorque_noise"
TEMPERATURE = """[[robot.axis.signal]]
name = "temperature"
message = "RobotState"
signal = "Temperature1"
"""
MODE = """[[robot.axis.signal]]
name = "mode"
message = "RobotState"
signal = "Mode"
max_age_s = 2.0
"""
OTHER = """[[robot.axis.signal]]
name = "speed2"
axis = "second"
factor = 0.01
"""
GATES = """[[robot.axis.gate]]
signal = "mode"
equals = [3, 4.0]
[[robot.axis.gate]]
signal = "temperature"
above = 5
"""
VARYING = """[[robot.axis.model.schedule]]
parameter = "fm"
signal = "temperature"
slope = -0.0004
reference = 40.0
range = [20.0, 60.0]
[[robot.axis.model.schedule]]
parameter = "kT"
signal = "cos(speed2)"
slope = 0.1
reference = 1.0
"""
MIDDLE = "bounds = { kT = [0.5, 2.0] }\n"


def text(
    signals: str = TEMPERATURE + MODE + OTHER, gates: str = GATES, varying: str = VARYING, model: str = ""
) -> str:
    """The base, whose first axis has these."""
    found = BASE.replace(MODEL, f"{signals}{gates}[robot.axis.model]\n{model}monitor", 1)
    return found.replace(MIDDLE, f"{MIDDLE}{varying}", 1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(CONFIG / "robot.dbc", tmp_path)
    return tmp_path


def loaded(folder: Path, content: str) -> Config:
    (folder / "a.toml").write_text(content, encoding="utf-8")
    return load(folder / "a.toml", {})


def test_all_that_may_be_said(folder: Path) -> None:
    config = loaded(
        folder,
        text(model='conditions = "followed"\n').replace("_s = 0.005", "_s = 0.005\nmin_speed = 0.2", 1),
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


def first(tables: str) -> str:
    """Of several tables of one kind the first."""
    return "[[" + tables.split("[[")[1]


MISTAKES = {
    "unknown axis": (
        text(OTHER.replace('"second"', '"secnd"'), "", ""),
        "signal[1].axis",
        'did you mean "second"?',
    ),
    "itself": (
        text(OTHER.replace('"second"', '"first"'), "", ""),
        "signal[1].axis",
        "no other axis of that name",
    ),
    "axis and message": (
        text(OTHER + 'message = "RobotState"\n', "", ""),
        "signal[1].message",
        "it is the motion of another axis: remove this, or robot[1].axis[1].signal[1].axis in line",
    ),
    "nowhere": (
        text('[[robot.axis.signal]]\nname = "x"\n', "", ""),
        "signal[1].column",
        "it is either in a column",
    ),
    "unknown message": (
        text(TEMPERATURE.replace("RobotState", "RobotStat"), "", ""),
        "signal[1].message",
        'did you mean "RobotState"?',
    ),
    "no age": (
        text(TEMPERATURE + "max_age_s = 0\n", "", ""),
        "signal[1].max_age_s",
        "must be greater than 0",
    ),
    "gate of nothing": (
        text("", GATES, ""),
        "gate[1].signal",
        "no signal mode: the configuration names none",
    ),
    "gate of an unknown signal": (
        text(MODE + TEMPERATURE, GATES.replace('"mode"', '"mod"'), ""),
        "gate[1].signal",
        'no signal mod: did you mean "mode"?',
    ),
    "gate of a function": (
        text(MODE, GATES.replace('"mode"', '"cos(mode)"').replace("temperature", "mode"), ""),
        "gate[1].signal",
        "must be a signal itself",
    ),
    "gate without a value": (
        text(MODE, '[[robot.axis.gate]]\nsignal = "mode"\n', ""),
        "gate[1].equals",
        "a gate has one of equals, above and below",
    ),
    "gate with two": (
        text(MODE, '[[robot.axis.gate]]\nsignal = "mode"\nequals = [1]\nbelow = 3\n', ""),
        "gate[1].below",
        "a gate has one of equals, above and below",
    ),
    "gate of no value": (
        text(MODE, '[[robot.axis.gate]]\nsignal = "mode"\nequals = []\n', ""),
        "gate[1].equals",
        "must have at least 1",
    ),
    "signal not on the bus": (
        text(
            '[[robot.axis.signal]]\nname = "temperature"\ncolumn = "t"\n',
            "",
            first(VARYING),
        ),
        "signal[1].message",
        "missing: fm follows it, so it must be on the bus of the axis",
    ),
    "gate not on the bus": (
        text('[[robot.axis.signal]]\nname = "mode"\ncolumn = "m"\n', first(GATES), ""),
        "signal[1].message",
        "missing: it is a gate, so",
    ),
    "unknown function": (
        text(varying=VARYING.replace("cos(speed2)", "tan(speed2)")),
        "model.schedule[2].signal",
        "kT follows tan(speed2): no function tan of signals: there is cos, sin, square",
    ),
    "unknown signal": (
        text(varying=VARYING.replace('"temperature"', '"temp"')),
        "model.schedule[1].signal",
        "fm follows temp: no signal temp: there is temperature, mode, speed2; signals are",
    ),
    "no term": (
        text(varying=VARYING.replace('"temperature"', '"2 * temperature"')),
        "model.schedule[1].signal",
        "is neither a signal nor one of cos(...)",
    ),
    "not monitored": (
        text(varying=VARYING.replace('"fm"', '"fc"')),
        "model.schedule[1].parameter",
        "fc follows temperature, but only a monitored parameter can follow: add it to monitor, or",
    ),
    "slopes of both": (
        text(varying=VARYING.replace('"kT"', '"1/fm"')),
        "model.schedule[2].parameter",
        "slopes of both 1/fm and fm: give one of them",
    ),
    "twice": (
        text(varying=VARYING.replace('"kT"', '"fm"').replace("cos(speed2)", " temperature ")),
        "model.schedule[2].signal",
        "fm follows temperature already by robot[1].axis[1].model.schedule[1] in line",
    ),
    "range turned round": (
        text(varying=VARYING.replace("[20.0, 60.0]", "[60.0, 20.0]")),
        "model.schedule[1].range",
        "must be [lowest, highest] with lowest < highest",
    ),
    "impossible at one end": (
        text(varying=VARYING.replace("-0.0004", "-0.04")),
        "model.schedule[1].slope",
        "fm would leave its bounds at temperature = ",
    ),
    "nothing is followed": (
        text(varying="", model='conditions = "followed"\n'),
        "model.conditions",
        "nothing follows anything: add [[robot.axis.model.schedule]], or a nominal_file",
    ),
    "nothing is gated": (
        text(gates="", model='conditions = "gated"\n'),
        "model.conditions",
        "there is no gate: add [[robot.axis.gate]]",
    ),
    "the others move": (
        text(model='conditions = "others stand still"\n'),
        "model.conditions",
        "but kT follows the motion of second, by robot[1].axis[1].model.schedule[2] in line",
    ),
    "no such choice": (
        text(model='conditions = "yes"\n'),
        "model.conditions",
        "must be 'followed', 'gated' or 'others stand still'",
    ),
    "no speed": (
        BASE.replace("_s = 0.005", "_s = 0.005\nmin_speed = 0", 1),
        "min_speed",
        "must be greater than 0",
    ),
}


def test_the_example_in_the_documents_is_right(folder: Path) -> None:
    document = (CONFIG.parent / "docs" / "operation.md").read_text(encoding="utf-8")
    section = document[document.index("## Operating conditions") :]
    example = section.split("```toml\n", 1)[1].split("```", 1)[0]
    axis, _ = loaded(folder, text(example, "", "").replace('name = "second"', 'name = "axis2"')).axes
    assert [source.name for source in axis.sources] == ["temperature", "angle2", "mode"]
    assert conditions_of(axis).gates == (Gate("mode", (2.0, 3.0)),)


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named(name: str, folder: Path) -> None:
    content, key, words = MISTAKES[name]
    with pytest.raises(ConfigErrors) as caught:
        loaded(folder, content)
    found = [(problem.key, problem.message) for problem in caught.value.problems]
    assert any(at == f"robot[1].axis[1].{key}" and words in message for at, message in found), found
    assert {at.rsplit("[", 1)[0] for at, _ in found} == {f"robot[1].axis[1].{key}".rsplit("[", 1)[0]}


def test_another_axis_is_on_the_same_bus(folder: Path) -> None:
    bus = (
        BASE[BASE.index("[[bus]]") : BASE.index("[[robot]]")]
        .replace('"can0"', '"can1"')
        .replace('"test"', '"test1"')
    )
    content = text(OTHER, "", "").replace("[[robot]]", f"{bus}[[robot]]", 1)
    assert loaded(folder, content)
    with pytest.raises(ConfigErrors) as caught:
        loaded(folder, content.replace('name = "second"\nbus = "can0"', 'name = "second"\nbus = "can1"'))
    (problem,) = caught.value.problems
    assert problem.key == "robot[1].axis[1].signal[1].axis"
    assert "it is on the bus can1, this axis on can0" in problem.message


def test_an_angle_that_starts_again_is_no_signal_of_another_axis(folder: Path) -> None:
    wraps = 'signal = "Angle"\nwrap_period = 6.283185307179586\n'
    signal = 'signal = [{ name = "angle1", axis = "first" }]\n'
    content = BASE.replace('signal = "Angle"\n', wraps, 1).replace(
        "estimator = {", f"{signal}estimator = {{", 1
    )
    with pytest.raises(ConfigErrors) as caught:
        loaded(folder, content)
    (problem,) = caught.value.problems
    assert problem.key == "robot[1].axis[2].signal[1].axis"
    assert "the angle of first starts again after each turn" in problem.message
    assert loaded(folder, content.replace(wraps, 'signal = "Angle"\n'))


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
    said = check(folder, text())
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
        (text(varying=""), "second"),
        (text(gates=""), "second"),
    ],
)
def test_who_says_nothing_is_noted(folder: Path, content: str, names: str) -> None:
    assert f"Note: demo: {names}: monitored as if" in check(folder, content)


def test_a_robot_of_one_axis_is_not_noted(folder: Path) -> None:
    alone = BASE[: BASE.index('[[robot.axis]]\nname = "second"')]
    assert "monitored as if" not in check(folder, alone)
