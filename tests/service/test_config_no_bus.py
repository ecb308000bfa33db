"""A configuration without any bus: for tables that are to be identified; nothing can be watched with it."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from service.commands.main import app
from service.config import ConfigErrors, load
from tests.service.config_texts import TABLES
from tests.service.identification.conftest import robot_text

VALUES = "Jm=0.006, Jg=280, Ja=96, kg=3e5, ka=3e5, dg=870, da=140, fm=0.06, fc=0.01, tau0=0.01"
NOISES = "estimator = { torque_noise = 0.05, output_noise = 1e-4 }\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "axis.toml").write_text(TABLES, encoding="utf-8")
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
    known = TABLES.replace("kT = 1,", f"kT = 1, {VALUES},").replace("model =", f"{NOISES}model =")
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
