"""`axiswatch check` as a user sees it."""

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from service.commands.check import check
from service.config import load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model

CONFIG = Path(__file__).resolve().parents[2] / "config"

app = typer.Typer()
app.command()(check)


@pytest.mark.parametrize(
    ("name", "signals"),
    [
        ("axiswatch.toml", ("robot.dbc", "Axis1Torque.Torque", "Axis1Angle.Angle")),
        ("demo.toml", ("demo.dbc", "Axis1State.Torque", "Axis1State.Angle")),
    ],
)
def test_a_right_configuration_is_summed_up(name: str, signals: tuple[str, ...]) -> None:
    result = CliRunner().invoke(app, ["--config", str(CONFIG / name)])
    assert result.exit_code == 0
    assert f"{CONFIG / name}: no problems\n" in result.stdout
    for words in ("can0", "axis1", "axis2", "three-mass", "1/Ja", *signals):
        assert words in result.stdout
    assert result.stderr == ""


def test_all_problems_go_to_the_error_stream_one_a_line(tmp_path: Path) -> None:
    file = tmp_path / "[bold]wrong.toml"
    text = (CONFIG / "demo.toml").read_text(encoding="utf-8")
    text = text.replace('interface = "virtual"', 'interfase = "[red]"').replace("state_dir", "state_dri")
    file.write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["--config", str(file)])
    assert result.exit_code == 2
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert [line.split(": ")[:2] for line in lines[:-1]] == [
        [f"{file}:5", 'service.state_dri = "demo-state"'],
        [f"{file}:9", 'bus[1].interfase = "[red]"'],
    ]
    assert lines[-1] == "2 problems in the configuration"


def test_a_missing_file_is_no_traceback(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["--config", str(tmp_path / "none.toml")])
    assert result.exit_code == 2
    assert "cannot read the configuration: No such file or directory" in result.stderr
    assert "1 problem in the configuration" in result.stderr


def test_the_environment_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AXISWATCH_WEB__PORT", "http")
    result = CliRunner().invoke(app, ["--config", str(CONFIG / "demo.toml")])
    assert result.exit_code == 2
    assert result.stderr.startswith("environment: AXISWATCH_WEB__PORT = http: must be a whole number")


def with_memory(tmp_path: Path, memory_s: float) -> Path:
    """The demo's configuration, of which the first axis has this memory; beside it its DBC."""
    text = (CONFIG / "demo.toml").read_text(encoding="utf-8")
    (tmp_path / "demo.dbc").write_bytes((CONFIG / "demo.dbc").read_bytes())
    file = tmp_path / "demo.toml"
    file.write_text(text.replace("memory_s = 1.0", f"memory_s = {memory_s}", 1), encoding="utf-8")
    return file


def test_a_memory_too_short_for_the_predictor_is_a_mistake_in_one_line(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["--config", str(with_memory(tmp_path, 0.2))])
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("axiswatch: demo.axis1: a memory of 0.2 s is less than 0.45 s, too short for")


@pytest.mark.parametrize(("memory_s", "noted"), [(1.0, True), (3.0, False)])
def test_a_memory_that_is_short_is_noted(memory_s: float, noted: bool, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["--config", str(with_memory(tmp_path, memory_s))])
    assert result.exit_code == 0
    assert ("Note: demo.axis1: a memory of 1 s is short compared with 0.9 s" in result.stdout) == noted


def test_where_it_is_short_the_state_moves_with_the_estimates_unless_told_otherwise(tmp_path: Path) -> None:
    def joint(memory_s: float, said: str = "") -> bool:
        file = with_memory(tmp_path, memory_s)
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("[robot.axis.estimator]", f"[robot.axis.estimator]\n{said}", 1))
        axis = load(file).axes[0]
        return axis_settings(axis, axis_model(axis.config)).joint_state

    assert (joint(1.0), joint(3.0)) == (True, False)
    assert (joint(1.0, "joint_state = false"), joint(3.0, "joint_state = true")) == (False, True)
    assert joint(0.2, "joint_state = true")  # refused where nothing is said
