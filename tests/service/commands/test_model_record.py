"""``axiswatch model --record``: what a measured torque tells of the parameters."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from service.commands.main import app
from service.config.resources import shipped

RUNNER = CliRunner()


def axis_with_columns(folder: Path) -> Path:
    text = shipped("irb.toml").read_text(encoding="utf-8")
    (folder / "irb.dbc").write_bytes(shipped("irb.dbc").read_bytes())
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def record(folder: Path, seed: int, rows: int = 3000) -> Path:
    rng = np.random.default_rng(seed)
    path = folder / "moved.csv"
    lines = ["torque,speed", *(f"{u:.6f},{w:.6f}" for u, w in rng.standard_normal((rows, 2)))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_the_record_and_the_configured_noise_are_what_is_asked_about(tmp_path: Path, seed: int) -> None:
    config, moved = axis_with_columns(tmp_path), record(tmp_path, seed)
    result = RUNNER.invoke(app, ["model", "--config", str(config), "--record", str(moved), "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)["local"]
    assert told["experiment"] == "the torque of moved.csv, 1.5 s at 2000 samples a second"
    assert told["noise"] == 2.2
    assert told["held_known"] == ["kT", "r"]
    usual = json.loads(RUNNER.invoke(app, ["model", "--config", str(config), "--json"]).stdout)["local"]
    assert usual["relative_standard_deviations"] != told["relative_standard_deviations"]


def test_text_names_every_parameter(tmp_path: Path, seed: int) -> None:
    config, moved = axis_with_columns(tmp_path), record(tmp_path, seed)
    result = RUNNER.invoke(app, ["model", "--config", str(config), "--record", str(moved)])
    section = result.output.split("What a record tells")[1]
    for name in ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0"):
        assert f"{name} " in section


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["three-mass", "--record", "x.csv"], "goes with --config"),
        (["--config", "robot.toml", "--record", "nowhere.csv"], "nowhere.csv: No such file"),
        (["--config", "robot.toml", "--record", "empty.csv"], "empty.csv"),
    ],
)
def test_mistakes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str) -> None:
    axis_with_columns(tmp_path)
    (tmp_path / "empty.csv").write_text("torque,speed\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = RUNNER.invoke(app, ["model", *arguments])
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
    assert "Traceback" not in result.output
