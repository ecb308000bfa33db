"""A configuration without any bus: for tables that are to be identified; nothing can be watched with it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from service.commands.main import app
from service.config import ConfigErrors, load
from tests.service.identification.conftest import TABLE_AXIS, robot_text

TEXT = (
    TABLE_AXIS
    + """\
model = { drive = "three-mass", monitor = ["1/Ja"], nominal = { kT = 1, r = 0.0085 } }
"""
)
VALUES = "Jm=0.006, Jg=280, Ja=96, kg=3e5, ka=3e5, dg=870, da=140, fm=0.06, fc=0.01, tau0=0.01"
NOISES = "estimator = { torque_noise = 0.05, output_noise = 1e-4 }\n"
SHIPPED = Path(__file__).resolve().parents[2] / "config"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "axis.toml").write_text(TEXT, encoding="utf-8")
    return tmp_path


def problems(text: str, folder: Path) -> list[str]:
    (folder / "axis.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigErrors) as caught:
        load(folder / "axis.toml", {})
    return [f"{p.line} {p.key}: {p.message}" for p in caught.value.problems]


def call(*words: str) -> Result:
    result = CliRunner().invoke(app, [words[0], "--config", "axis.toml", *words[1:]])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


def test_columns_are_enough(here: Path) -> None:
    (axis,) = load(here / "axis.toml", {}).axes
    assert (axis.config.records_only, axis.config.torque.column) == (True, "torque")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            '{ column = "torque" }',
            "{}",
            "6 robot[1].axis[1].torque.column: missing (column (.csv, .parquet) or variable (.mat) in records):"
            " without a [[bus]] it is read from there",
        ),
        (
            'column = "angle"',
            'column = "angle", message = "A"',
            "7 robot[1].axis[1].angle.message: is on a bus, but there is no [[bus]] in this file",
        ),
        (
            'column = "angle"',
            'column = "angle", signal = "A"',
            "7 robot[1].axis[1].angle.signal: is on a bus, but there is no [[bus]] in this file",
        ),
        ("kT = 1,", "kt = 1,", "8 robot[1].axis[1].model.nominal.kt: the drive has no such parameter: did you mean"),
        ("kT = 1,", "kT = 1, Jm = -1,", "8 robot[1].axis[1].model.nominal.Jm: "),
        ('"1/Ja"', '"1/Jo"', "8 robot[1].axis[1].model.monitor[1]: "),
    ],
)  # fmt: skip
def test_mistakes(here: Path, old: str, new: str, expected: str) -> None:
    assert old in TEXT
    found = problems(TEXT.replace(old, new), here)
    assert found[0].startswith(expected)
    assert len(found) == 1


def test_an_axis_on_a_bus_that_is_not_there(here: Path) -> None:
    found = problems(TEXT.replace('name = "axis1"', 'name = "axis1"\nbus = "can0"'), here)
    words = "robot[1].axis[1].bus: no such bus: there is no [[bus]] in this file: add it, or remove this"
    assert [line for line in found if words in line]


def test_with_a_bus_all_is_needed_that_was(here: Path) -> None:
    shutil.copy(SHIPPED / "demo.dbc", here)
    bus = '[[bus]]\nname = "can0"\ninterface = "virtual"\nchannel = "x"\ndbc = "demo.dbc"\n'
    named = TEXT.replace('name = "axis1"', 'name = "axis1"\nbus = "can0"')
    found = problems(bus + named, here)
    assert {line.split()[1].removeprefix("robot[1].axis[1].") for line in found} == {
        *("torque.message:", "torque.signal:", "angle.message:", "angle.signal:"),
        *(
            f"model.nominal.{name}:"
            for name in ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0")
        ),
        *("estimator.torque_noise:", "estimator.output_noise:"),
    }
    assert any("axis[1].bus: missing (name of a [[bus]])" in line for line in problems(bus + TEXT, here))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", ["run", "check", "listen", "simulate", "play r.csv", "replay r.csv"])
def test_what_needs_a_bus_says_so(command: str) -> None:
    result = call(*command.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("axiswatch: axis.toml: no bus: ")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.usefixtures("here")
def test_the_model_needs_no_bus() -> None:
    result = call("model")
    assert (result.exit_code, result.stderr) == (0, "")
    assert "Hold kT and r known" in " ".join(result.stdout.split())


def test_a_motion_is_planned_without_a_bus_where_the_drive_is_known(here: Path) -> None:
    words = ("excite", "--torque-limit", "2", "-o", "m.csv", "--seconds", "2")
    result = call(*words)
    assert result.exit_code == 2
    assert (
        "the configuration has no Jm, Jg, Ja, kg, ka, dg, da, fm, fc, tau0, torque_noise, output_noise: give"
        in (result.stderr)
    )
    known = TEXT.replace("kT = 1,", f"kT = 1, {VALUES},").replace("model =", f"{NOISES}model =")
    (here / "axis.toml").write_text(known.replace("torque_noise = 0.05, ", ""), encoding="utf-8")
    assert "has no torque_noise: give" in call(*words).stderr
    (here / "axis.toml").write_text(known, encoding="utf-8")
    assert call(*words).exit_code == 0
    assert (here / "m.csv").read_text(encoding="utf-8").startswith("t_s,torque_Nm")


def test_an_identification_needs_values_of_what_it_does_not_find(here: Path) -> None:
    (here / "r.csv").write_text("torque,angle\n0,0\n1,1\n", encoding="utf-8")
    for words, expected in (
        (
            ("--free", "Jm"),
            "no value of Jg, Ja, kg, ka, dg, da, fm, fc, tau0, to be held: give it in [robot.axis",
        ),
        (("--fix", "fc"), "no value of fc, to be held"),
        (("--start", "values"), "--start values needs a value of Jm, Jg"),
        (("--start", "search"), "--start search needs a value of Jm, Jg"),
        ((), "refused: r.csv: only 2 measured samples"),
    ):
        result = call("identify", "r.csv", *words)
        assert (result.exit_code, expected in result.stderr) == (2, True), result.stderr
        assert len(result.stderr.splitlines()) == 1


def test_a_can_log_cannot_be_read_without_a_bus(here: Path) -> None:
    (here / "r.log").write_text("(0.0) can0 123#00\n", encoding="utf-8")
    result = call("identify", "r.log")
    assert (result.exit_code, "no [[bus]]" in result.stderr) == (2, True), result.stderr


def test_the_text_of_the_demo_without_its_bus_tells_all_at_once(here: Path) -> None:
    text = robot_text()
    start, end = text.index("[[bus]]"), text.index("[[robot]]")
    found = problems(text[:start] + text[end:], here)
    assert [line.split(":")[0].split()[-1].split(".")[-1] for line in found] == [
        *("bus", "message", "signal", "message", "signal"),
    ]
