"""Drives by what a user calls them."""

from dataclasses import replace
from pathlib import Path

import pytest

from monitor_core.drive.structure import Output
from monitor_core.modeling import modelica
from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from service.config.drive_sources import LIBRARY, model_called, model_of_axis, shipped
from tests.service.pipeline.robots import changed, demo

BELT = """\
model Belt
  parameter Real Jm(unit = "kg.m2") = 0.002;
  parameter Real Ja(unit = "kg.m2") = 0.01;
  parameter Real k(unit = "N.m/rad") = 60;
  Modelica.Mechanics.Rotational.Sources.Torque torque;
  Modelica.Mechanics.Rotational.Components.Inertia motor(J = Jm);
  Modelica.Mechanics.Rotational.Components.Spring belt(c = k);
  Modelica.Mechanics.Rotational.Components.Inertia arm(J = Ja);
  Modelica.Mechanics.Rotational.Sensors.SpeedSensor encoder;
equation
  connect(torque.flange, motor.flange_a);
  connect(motor.flange_b, belt.flange_a);
  connect(belt.flange_b, arm.flange_a);
  connect(encoder.flange, motor.flange_a);
end Belt;
"""


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("name", ["three-mass", "three-mass-weight"])
def test_the_examples_in_modelica_are_drives_of_the_library(name: str, output: Output) -> None:
    drawn = model_called(name, None, output)
    file = shipped(f"drives/{name.replace('-', '_')}.mo")
    read = model_called(str(file), None, output)
    for entries in ("A", "B", "C", "rest", "ratio"):
        assert getattr(read.space, entries) == getattr(drawn.space, entries), entries
    assert replace(read.drive, name=name, states=drawn.drive.states) == drawn.drive
    assert read.values == pytest.approx(drawn.values, rel=1e-14)


@pytest.mark.parametrize("name", LIBRARY)
def test_a_drive_of_the_library_has_values_to_show_what_it_does(name: str) -> None:
    model = model_called(name)
    assert model.values.keys() == {p.name for p in model.drive.parameters}
    assert model.values.items() >= ({} if name != "three-mass" else REFERENCE_VALUES).items()


def test_what_is_measured_goes_before_what_was_drawn(tmp_path: Path) -> None:
    (tmp_path / "belt.mo").write_text(BELT, encoding="utf-8")
    drawn, speed, angle = (
        model_called(str(tmp_path / "belt.mo"), None, output).space for output in (None, "speed", "angle")
    )
    assert [s.quantity for s in (*drawn.sensors, *speed.sensors, *angle.sensors)] == [
        *("speed", "speed"),
        "angle",
    ]
    assert [len(ss.states) for ss in (drawn, speed, angle)] == [3, 3, 4]


def test_axes_with_one_drive_read_it_once(tmp_path: Path) -> None:
    (tmp_path / "belt.mo").write_text(BELT, encoding="utf-8")
    axis = changed(demo(tmp_path, 1), model={"drive": str(tmp_path / "belt.mo")}).axes[0].config
    assert model_of_axis(axis) is model_of_axis(axis)
    assert model_of_axis(axis, "speed") is not model_of_axis(axis)
    (tmp_path / "belt.mo").write_text(BELT.replace("Belt", "Changed"), encoding="utf-8")
    assert model_of_axis(axis).space.name == "Changed"


def test_a_mistake_is_found_once_and_reported_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "belt.mo").write_text(BELT.replace("Ja)", "Jx)"), encoding="utf-8")
    for _ in range(2):
        with pytest.raises(ModelError, match=r"belt\.mo:8: arm: Jx is not known in Belt$"):
            model_called(str(tmp_path / "belt.mo"))
        monkeypatch.delattr(modelica, "read", raising=False)  # from now on nothing is read


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "folder.mo").mkdir()
    (tmp_path / "latin.mo").write_bytes(b"model M\n  Real x;\n  // \xe4\nend M;\n")
    cases = {
        "none.mo": r"none\.mo: cannot read the drawing: No such file",
        "folder.mo": "cannot read the drawing: Is a directory",
        "latin.mo": r"latin\.mo:3: the file must be UTF-8 text",
    }
    for name, words in cases.items():
        with pytest.raises(ModelError, match=words):
            model_called(str(tmp_path / name))
