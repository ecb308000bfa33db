"""From records of an axis that follows a temperature and another axis to its nominal values, and to its alarms."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.can.log_files import FrameRecorder
from service.commands.main import app
from service.config import load
from service.config.found_file import read_found
from service.config.nominal_file import NominalFile
from service.simulation.robot import Fault
from tests.service.pipeline.robots import replayed
from tests.service.pipeline.test_operating_conditions import VARYING, frames_of, robot

pytestmark = pytest.mark.soak
FAULT_S = 30.0


def test_what_was_identified_is_followed(tmp_path: Path, seed: int) -> None:
    """Slopes within one per cent; quiet on a second record; a fault of the friction is named."""
    config = load(robot(tmp_path), {})
    broken = [Fault("demo.axis1", {"fm": 1.4}, FAULT_S)]
    for number, (name, faults) in enumerate((("healthy", []), ("second", []), ("faulty", broken))):
        with FrameRecorder(tmp_path / f"{name}.log") as recorder:
            recorder.write("can0", frames_of(config, seed + number, faults, 60.0))
    text = (tmp_path / "robot.toml").read_text(encoding="utf-8").replace(VARYING, "")
    (tmp_path / "plain.toml").write_text(text, encoding="utf-8")
    where = (
        "--config",
        str(tmp_path / "plain.toml"),
        "--axis",
        "axis1",
        "-o",
        str(tmp_path / "nominal.toml"),
    )
    schedule = ("--schedule", "fm: temperature", "--schedule", "Ja: cos(angle2)")
    result = CliRunner().invoke(app, ["identify", str(tmp_path / "healthy.log"), *where, *schedule])
    assert result.exit_code == 0, result.output
    found = read_found(NominalFile, tmp_path / "nominal.toml")
    slopes = {v.parameter: v.slope for v in found.schedule}
    print(f"slopes {slopes}, colour {found.predictor.colour:.3g}")
    assert slopes["fm"] == pytest.approx(-0.0012, rel=0.01)
    assert slopes["Ja"] == pytest.approx(15.0, rel=0.05)
    assert replayed(watching(tmp_path, text), tmp_path / "second.log")["alarms"] == []
    (alarm,) = replayed(tmp_path / "watch.toml", tmp_path / "faulty.log")["alarms"]
    assert (alarm["parameter"], alarm["direction"]) == ("fm", "up")


def watching(folder: Path, text: str) -> Path:
    """The first axis with the nominal values that were found, and without any of its own."""
    first, second = text.split('[[robot.axis]]\nname = "axis2"')
    before, after = first.split("[robot.axis.model.nominal]")
    estimator = after[after.index("[robot.axis.estimator]") :]
    estimator = re.sub(r"(initial_p|torque_noise|output_noise) = .*\n", "", estimator)
    said = 'nominal_file = "nominal.toml"\nconditions = "followed"\nmonitor ='
    first = before.replace("monitor =", said, 1) + estimator
    (folder / "watch.toml").write_text(f'{first}[[robot.axis]]\nname = "axis2"{second}', encoding="utf-8")
    return folder / "watch.toml"
