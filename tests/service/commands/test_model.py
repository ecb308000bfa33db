"""``axiswatch model``: files, the library and configured axes, in all forms; every mistake with what would be right."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests import golden
from tests.end_to_end.processes import demo_config, edit
from tests.service.command_line import as_json as json_of
from tests.service.command_line import refused, session
from tests.service.command_line import shown as printed

DRAWING = """\
model Press "Motor and ram"
  parameter Modelica.Units.SI.Inertia Jm = 0.004 "inertia of the motor";
  Modelica.Mechanics.Rotational.Sources.Torque torque;
  Modelica.Mechanics.Rotational.Components.Inertia motor(J = Jm);
  Modelica.Mechanics.Rotational.Components.SpringDamper belt(c = 300, d = 0.2);
  Modelica.Mechanics.Rotational.Components.Inertia ram(J = 0.02);
  Modelica.Mechanics.Rotational.Sensors.AngleSensor encoder;
equation
  connect(torque.flange, motor.flange_a);
  connect(encoder.flange, motor.flange_a);
  connect(motor.flange_b, belt.flange_a);
  connect(belt.flange_b, ram.flange_a);
end Press;
"""


@pytest.fixture
def drawing(tmp_path: Path) -> Path:
    file = tmp_path / "press.mo"
    file.write_text(DRAWING, encoding="utf-8")
    return file


def shown(*arguments: object) -> str:
    return printed("model", *arguments)


def as_json(*arguments: object) -> Any:
    return json_of("model", *arguments, "--json", "-")


def test_a_file_as_text(drawing: Path) -> None:
    text = shown(drawing)
    assert text.startswith("Press\nflat equations ")
    assert "inertia of the motor" in text
    assert "the paper" not in text
    assert "the paper counts for its tool and library" in shown("three-mass").replace("\n", " ")


def test_json_into_a_file(drawing: Path, tmp_path: Path) -> None:
    text = shown(drawing, "--json", tmp_path / "press.json")
    assert text.startswith("Press\n")
    assert json.loads((tmp_path / "press.json").read_text(encoding="utf-8")) == as_json(drawing)
    shown("--json", tmp_path / "again.txt", "two-mass")
    assert (tmp_path / "again.txt").is_file()


def test_the_output_may_be_another(drawing: Path) -> None:
    drawn, other = as_json(drawing), as_json(drawing, "--output", "speed")
    assert [d["outputs"][0]["quantity"] for d in (drawn, other)] == ["angle", "speed"]
    assert [len(d["states"]) for d in (drawn, other)] == [4, 3]


def test_one_of_several_models(tmp_path: Path) -> None:
    file = tmp_path / "two.mo"
    file.write_text(DRAWING + DRAWING.replace("Press", "Stamp"), encoding="utf-8")
    assert as_json(file, "--model", "Stamp")["name"] == "Stamp"
    message = refused("model", file)
    assert "Press" in message
    assert "Stamp" in message


def test_the_drive_of_an_axis(tmp_path: Path) -> None:
    config = edit(demo_config(tmp_path, axes=2), ("fm = 0.06", "fm = 0.05"))
    for name in ("axis1", "demo.axis1"):
        found = as_json("--config", config, "--axis", name)
        assert {p["name"]: p["nominal"] for p in found["parameters"]}["fm"] == 0.05
    assert as_json("--config", config, "--axis", "axis2")["outputs"][0]["quantity"] == "angle"


def test_mistakes(drawing: Path, folder: Path) -> None:
    demo_config(folder, axes=2)
    text = session(
        "model",
        "thre-mass",
        "none.mo",
        "README.md",
        "",
        "three-mass --config robot.toml",
        "--config robot.toml",
        "--config robot.toml --axis axis9",
        "--config none.toml",
        "three-mass --axis axis1",
        "three-mass --model A",
        "press.mo --model Pres",
        "three-mass --output torque",
        "three-mass --json=press.mo",
        "three-mass --json=nowhere/a.json",
        "three-mass five-mass",
    )
    golden.check(text, Path(__file__).parent / "golden" / "model_mistakes.txt")
    assert drawing.read_text(encoding="utf-8") == DRAWING
