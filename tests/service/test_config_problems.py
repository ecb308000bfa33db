"""Each mistake is named with its line, its key, its value, and what would be right."""

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

from service.config import ConfigErrors, Problem, load

CONFIG = Path(__file__).resolve().parents[2] / "config"

BASE = (Path(__file__).parent / "config_base.toml").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(CONFIG / "robot.dbc", tmp_path)
    return tmp_path


def problems(folder: Path, text: str) -> list[Problem]:
    file = folder / "a.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigErrors) as caught:
        load(file, {})
    assert {problem.file for problem in caught.value.problems} == {file}
    return caught.value.problems


def test_the_base_is_right(folder: Path) -> None:
    (folder / "a.toml").write_text(BASE, encoding="utf-8")
    config = load(folder / "a.toml", {})
    first, second = (axis.config for axis in config.axes)
    assert (first.output, first.motion.signal, second.output, second.motion.signal) == (
        *("angle", "Angle"),
        *("speed", "Speed"),
    )
    assert (first.pairing_tolerance_s, first.max_gap_s) == pytest.approx((0.002, 0.06))
    assert (second.pairing_tolerance_s, second.max_gap_s) == pytest.approx((0.0016, 0.04))
    assert config.service.state_dir == folder / "kept"
    assert config.bus[0].dbc == folder / "robot.dbc"
    assert config.bus[0].options == {"receive_own_messages": True}


class Mistake(NamedTuple):
    old: str
    new: str
    key: str
    value: str | None
    words: str
    line: int


FIRST, SECOND = "robot[1].axis[1]", "robot[1].axis[2]"
MOTION = '[robot.axis.angle]\nmessage = "Axis1Angle"\nsignal = "Angle"\n'
SPEED = 'speed = { message = "Axis2Speed", signal = "Speed" }\n'
NOISES = "torque_noise = 0.05\noutput_noise = 1e-4"
OUTPUT_ERROR = 'estimator = { predictor = "output-error", output_noise = 0.01 }'

MISTAKES = [
    # single values
    Mistake("port = 8080", "prot = 8080", "web.prot", "8080", 'unknown key: did you mean "port"', 4),
    Mistake("port = 8080", 'port = "8080"', "web.port", '"8080"', "must be a whole number (TCP port", 4),
    Mistake("port = 8080", "port = 80.5", "web.port", "80.5", "must be a whole number", 4),
    Mistake("port = 8080", "port = true", "web.port", "true", "must be a whole number", 4),
    Mistake("port = 8080", "port = 70000", "web.port", "70000", "must be at most 65535", 4),
    Mistake("port = 8080", "port = -1", "web.port", "-1", "must be at least 0", 4),
    Mistake('"kept"', '""', "service.state_dir", '""', "must be a path in quotes", 2),
    Mistake('"kept"', "3", "service.state_dir", "3", "must be a path in quotes", 2),
    Mistake('"test"', "0", "bus[1].channel", "0", "must be a text in quotes", 8),
    Mistake('"test"', '""', "bus[1].channel", '""', "must not be empty", 8),
    Mistake('"demo"', '"de.mo"', "robot[1].name", '"de.mo"', "letters, digits, - and _", 13),
    Mistake("_s = 0.005", "_s = nan", f"{FIRST}.sample_interval_s", "nan", "must be a finite number", 17),
    Mistake("_s = 0.005", "_s = 0", f"{FIRST}.sample_interval_s", "0", "must be at least 1e-05", 17),
    Mistake("_s = 0.005", "_s = 5", f"{FIRST}.sample_interval_s", "5", "must be at most 1", 17),
    Mistake(
        "\n" + NOISES,
        "\nforgetting = 0.5\n" + NOISES,
        f"{FIRST}.estimator.forgetting",
        "0.5",
        "greater than 0.5",
        33,
    ),
    Mistake(
        "\n" + NOISES,
        "\nforgetting = 1\n" + NOISES,
        f"{FIRST}.estimator.forgetting",
        "1",
        "less than 1",
        33,
    ),
    Mistake(
        '"output-error"',
        '"magic"',
        f"{SECOND}.estimator.predictor",
        '"magic"',
        "'innovations' or 'output-error'",
        41,
    ),
    Mistake('["1/Ja"]', "[]", f"{SECOND}.model.monitor", "[]", "must have at least 1", 43),
    Mistake('["1/Ja"]', '"1/Ja"', f"{SECOND}.model.monitor", '"1/Ja"', "must be a list", 43),
    Mistake('["1/Ja"]', "[3]", f"{SECOND}.model.monitor[1]", "3", "must be a text in quotes", 43),
    Mistake("[0.5, 2.0]", "[0.5]", f"{FIRST}.model.bounds.kT[2]", None, "missing (name = [lower, upper]", 31),
    Mistake(
        "[0.5, 2.0]", "[0.5, 1, 2]", f"{FIRST}.model.bounds.kT", "[0.5, 1, 2]", "must have at most 2", 31
    ),
    Mistake("Jm = 0.02", "Jm = '0.02'", f"{SECOND}.model.nominal.Jm", '"0.02"', "must be a number", 45),
    Mistake(OUTPUT_ERROR, "estimator = 3", f"{SECOND}.estimator", "3", "must be a table", 41),
    # what must be there
    Mistake('channel = "test"\n', "", "bus[1].channel", None, "missing (channel of that interface", 5),
    Mistake('name = "second"\n', "", f"{SECOND}.name", None, "missing (name of the axis", 35),
    Mistake('\nsignal = "Torque"', "", f"{FIRST}.torque.signal", None, "missing (name of the signal", 19),
    Mistake(MOTION, "", f"{FIRST}.angle", None, "needs a table angle (motor angle) or speed", 14),
    Mistake("kT = 1.0\n", "", f"{SECOND}.model.nominal.kT", None, "missing (torque constant", 44),
    Mistake('counter_signal = "Counter"\n', "", f"{FIRST}.time.counter_signal", None, "go together", 25),
    Mistake('counter_message = "Axis1Angle"\n', "", f"{FIRST}.time.counter_message", None, "go together", 25),
    # names that must differ or exist
    Mistake(
        '"second"',
        '"first"',
        f"{SECOND}.name",
        '"first"',
        f"differ from the name of {FIRST} in line 14",
        36,
    ),
    Mistake(
        'can0"\nsample_interval_s = 0.004',
        'can1"\nsample_interval_s = 0.004',
        f"{SECOND}.bus",
        '"can1"',
        'mean "can0"',
        37,
    ),
    Mistake('"virtual"', '"virtaul"', "bus[1].interface", '"virtaul"', 'did you mean "virtual"', 7),
    Mistake(
        "receive_own_messages = true",
        'channel = "x"',
        "bus[1].options.channel",
        '"x"',
        "belongs into [[bus]]",
        11,
    ),
    Mistake(
        '["1/Ja"]',
        '["1/Ja"]\ndrive = "three_mass"',
        f"{SECOND}.model.drive",
        '"three_mass"',
        'mean "three-mass"',
        44,
    ),
    Mistake('"fm"]', '"Fm"]', f"{FIRST}.model.monitor[2]", '"Fm"', 'did you mean "fm"', 29),
    Mistake('["1/Ja"]', '["1/ja"]', f"{SECOND}.model.monitor[1]", '"1/ja"', 'did you mean "1/Ja"', 43),
    Mistake('["1/Ja"]', '["1/Ja", "Ja"]', f"{SECOND}.model.monitor[2]", '"Ja"', "Ja is monitored twice", 43),
    Mistake("r = 0.02", "r = 0.02\nkt = 1", f"{SECOND}.model.nominal.kt", "1", 'did you mean "kT"', 57),
    Mistake(
        "{ kT = [0.5, 2.0] }",
        "{ Kt = [0.5, 2.0] }",
        f"{FIRST}.model.bounds.Kt",
        "[0.5, 2.0]",
        'mean "kT"',
        31,
    ),
    # values that must fit together
    Mistake(
        MOTION,
        MOTION + '[robot.axis.speed]\nmessage = "Axis1Angle"\nsignal = "Speed"\n',
        f"{FIRST}.speed",
        '{message = "Axis1Angle", signal = "Speed"}',
        "give angle or speed, not both: the angle gives better estimates",
        25,
    ),
    Mistake(
        "Ja = 96",
        "Ja = -96",
        f"{SECOND}.model.nominal.Ja",
        "-96",
        "inertia of the arm must be finite and greater",
        47,
    ),
    Mistake("fm=0.06", "fm=0", f"{FIRST}.model.monitor[2]", '"fm"', "give its scale", 29),
    Mistake('"fm"]', '"1/fc"]', f"{FIRST}.model.monitor[2]", '"1/fc"', "its nominal value is 0", 29),
    Mistake(
        "[0.5, 2.0]",
        "[1.5, 2.0]",
        f"{FIRST}.model.bounds.kT",
        "[1.5, 2.0]",
        "0 < lower < nominal < upper",
        31,
    ),
    Mistake(
        "[0.5, 2.0]", "[0, 2.0]", f"{FIRST}.model.bounds.kT", "[0, 2.0]", "0 < lower < nominal < upper", 31
    ),
    Mistake(
        "max_gap_s = 0.06",
        "max_gap_s = 0.001",
        f"{FIRST}.max_gap_s",
        "0.001",
        "at least sample_interval_s",
        18,
    ),
    Mistake(
        "max_gap_s = 0.06",
        "torque_delay_s = 0.006",
        f"{FIRST}.torque_delay_s",
        "0.006",
        "at most sample_interval_s",
        18,
    ),
    Mistake(
        "max_gap_s = 0.06",
        "pairing_tolerance_s = 0.0025",
        f"{FIRST}.pairing_tolerance_s",
        "0.0025",
        "must be below half of sample_interval_s = 0.005",
        18,
    ),
    # the estimator
    Mistake(
        NOISES,
        'predictor = "output-error"\n' + NOISES,
        f"{FIRST}.estimator.predictor",
        '"output-error"',
        "needs speed",
        33,
    ),
    Mistake(
        NOISES, "output_noise = 1e-4", f"{FIRST}.estimator.torque_noise", None, "the filter gain needs", 32
    ),
    Mistake(
        NOISES,
        "innovation_variance = 1e-6\ngain = [0, 0, 0, 0, 0, 0]",
        f"{FIRST}.estimator.gain",
        "[0, 0, 0, 0, 0, 0]",
        "not be zero",
        34,
    ),
    Mistake(
        NOISES,
        "innovation_variance = 1e-6\ngain = [1, 2]",
        f"{FIRST}.estimator.gain",
        "[1, 2]",
        "has 2 numbers, must have 6",
        34,
    ),
    Mistake(
        NOISES,
        "gain = [1, 2, 3, 4, 5, 6]",
        f"{FIRST}.estimator.innovation_variance",
        None,
        "beside a gain",
        32,
    ),
    Mistake(
        NOISES,
        "initial_p = { kT = 1 }\n" + NOISES,
        f"{FIRST}.estimator.initial_p.fm",
        None,
        "all monitored parameters",
        33,
    ),
    Mistake(
        NOISES,
        "initial_p = { kT = 1, fm = 1, fn = 1 }\n" + NOISES,
        f"{FIRST}.estimator.initial_p.fn",
        "1",
        "not monitored",
        33,
    ),
    Mistake(
        ", output_noise = 0.01",
        "",
        f"{SECOND}.estimator.output_noise",
        None,
        "output_noise or innovation_variance",
        41,
    ),
    Mistake(
        ", output_noise = 0.01",
        ", innovation_variance = 1, gain = [1, 1, 1, 1, 1]",
        f"{SECOND}.estimator.gain",
        "[1, 1, 1, 1, 1]",
        "remove it",
        41,
    ),
    # the DBC
    Mistake('"robot.dbc"', '"none.dbc"', "bus[1].dbc", '"none.dbc"', "No such file", 9),
    Mistake(
        '"robot.dbc"', '"a.toml"', "bus[1].dbc", '"a.toml"', "is no valid DBC: Invalid syntax at line 2", 9
    ),
    Mistake(
        '"Axis1Torque"',
        '"Axis1Torqe"',
        f"{FIRST}.torque.message",
        '"Axis1Torqe"',
        'did you mean "Axis1Torque"',
        20,
    ),
    Mistake(
        'signal = "Angle"',
        'signal = "angel"',
        f"{FIRST}.angle.signal",
        '"angel"',
        'did you mean "Angle"',
        24,
    ),
    Mistake('"Counter"', '"Count"', f"{FIRST}.time.counter_signal", '"Count"', 'did you mean "Counter"', 27),
    Mistake(
        '"Counter"', '"Angle"', f"{FIRST}.time.counter_signal", '"Angle"', "an integer with factor 1e-05", 27
    ),
    Mistake(
        'counter_message = "Axis1Angle"',
        'counter_message = "Axis2Angle"',
        f"{FIRST}.time.counter_message",
        '"Axis2Angle"',
        'with the torque or the motion: "Axis1Torque" or "Axis1Angle"',
        26,
    ),
    Mistake(
        'counter_message = "Axis1Angle"',
        'counter_message = "Axis1Angel"',
        f"{FIRST}.time.counter_message",
        '"Axis1Angel"',
        'did you mean "Axis1Angle"',
        26,
    ),
    Mistake(
        'message = "Axis1Torque"',
        'message = "Axis1Troque"',
        f"{FIRST}.torque.message",
        '"Axis1Troque"',
        'did you mean "Axis1Torque"',
        20,
    ),
    Mistake(
        '"Axis2Torque"',
        '"Axis1Torque"',
        f"{SECOND}.torque.signal",
        '"Torque"',
        f"Axis1Torque.Torque is already used by {FIRST}.torque.signal in line 21",
        39,
    ),
]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: f"{mistake.key} {mistake.words}")
def test_mistake(mistake: Mistake, folder: Path) -> None:
    assert BASE.count(mistake.old) == 1
    found = problems(folder, BASE.replace(mistake.old, mistake.new))
    assert [(p.key, p.value, p.line) for p in found] == [(mistake.key, mistake.value, mistake.line)]
    assert mistake.words in found[0].message
