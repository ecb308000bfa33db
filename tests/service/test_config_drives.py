"""The drive of an axis by name, as a Modelica file, or drawn in the configuration: what loads, and what is said."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from service.config import Config, ConfigErrors, load
from service.config.axis_settings import axis_model
from tests.service.pipeline.robots import DEMO

HEAD = """\
[[bus]]
name = "can0"
channel = "can0"
dbc = "demo.dbc"
[[robot]]
name = "r"
[[robot.axis]]
name = "a"
bus = "can0"
sample_interval_s = 0.005
torque = { message = "Axis1State", signal = "Torque" }
angle = { message = "Axis1State", signal = "Angle" }
estimator = { torque_noise = 0.05, output_noise = 1e-4 }
[robot.axis.model]
"""

RIGID = """\
model Rigid "A motor and a load on a rigid gear"
  import Modelica.Mechanics.Rotational.*;
  parameter Real Jm(unit = "kg.m2") = 0.001 "inertia of the motor";
  parameter Real Jl(unit = "kg.m2") = 2 "inertia of the load";
  parameter Real f(unit = "N.m.s/rad") = 0.004 "friction";
  parameter Real r(unit = "1") = 0.02 "gear ratio";
  Sources.Torque torque;
  Components.Inertia motor(J = Jm);
  Components.Damper bearing(d = f);
  Components.Fixed housing;
  Components.IdealGear gear(ratio = 1/r);
  Components.Inertia load(J = Jl);
  Sensors.AngleSensor encoder;
equation
  connect(torque.flange, motor.flange_a);
  connect(bearing.flange_a, motor.flange_a);
  connect(bearing.flange_b, housing.flange);
  connect(motor.flange_b, gear.flange_a);
  connect(gear.flange_b, load.flange_a);
  connect(encoder.flange, motor.flange_a);
end Rigid;
"""
MERGED = "Jm + Jl*r^2"

FILE = 'drive = "rigid.mo"\nmonitor = ["f"]\n'
DRAWN = """\
monitor = ["f"]
nominal = { J = 0.01, f = 0.03 }
[robot.axis.model.components]
motor = { type = "torque", at = "shaft", kT = 1 }
rotor = { type = "inertia", at = "shaft", J = "J" }
bearing = { type = "viscous-friction", at = "shaft", d = "f" }
encoder = { type = "angle-sensor", at = "shaft" }
"""
WEIGHT = 'weight = { type = "gravity", at = "shaft", gc = 0.1, gs = 0.2 }\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(DEMO.parent / "demo.dbc", tmp_path)
    (tmp_path / "rigid.mo").write_text(RIGID, encoding="utf-8")
    return tmp_path


def read(folder: Path, model: str, head: str = HEAD) -> Config:
    (folder / "a.toml").write_text(head + model, encoding="utf-8")
    return load(folder / "a.toml", {})


def told(folder: Path, model: str, head: str = HEAD) -> list[str]:
    """Line, key and message of every problem; lines count from [robot.axis.model]."""
    with pytest.raises(ConfigErrors) as caught:
        read(folder, model, head)
    first = head.count("\n")
    return [
        f"{(p.line or 0) - first} {p.key.removeprefix('robot[1].axis[1].')}: {p.message}"
        for p in caught.value.problems
    ]


def test_a_file_beside_the_configuration_brings_its_own_values(folder: Path) -> None:
    model = axis_model(read(folder, FILE).axes[0].config)
    assert model.drive.name == "Rigid"
    assert model.nominal == pytest.approx({MERGED: 0.001 + 0.02**2 * 2, "f": 0.004})


def test_values_of_the_configuration_go_before_those_of_the_file(folder: Path) -> None:
    model = axis_model(read(folder, FILE + "nominal = { Jl = 3, f = 0.005 }").axes[0].config)
    assert model.nominal == pytest.approx({MERGED: 0.001 + 0.02**2 * 3, "f": 0.005})


def test_a_merged_parameter_may_be_given_and_watched_itself(folder: Path) -> None:
    text = f'drive = "rigid.mo"\nmonitor = ["1/({MERGED})"]\n[robot.axis.model.nominal]\n"{MERGED}" = 0.002\n'
    model = axis_model(read(folder, text).axes[0].config)
    assert model.theta0.tolist() == [500]


def test_components_are_a_drive(folder: Path) -> None:
    model = axis_model(read(folder, DRAWN).axes[0].config)
    assert model.nominal == {"J": 0.01, "f": 0.03, "motor.kT": 1.0}
    assert [state.unit for state in model.drive.states] == ["rad/s", "rad"]


def test_which_model_of_a_file(folder: Path) -> None:
    second = RIGID.replace("Rigid", "Stiff").replace("= 2 ", "= 4 ")
    (folder / "rigid.mo").write_text(RIGID + second, encoding="utf-8")
    (problem,) = told(folder, FILE)
    assert all(word in problem for word in ("1 model.drive: ", "Rigid", "Stiff"))
    stiff = axis_model(read(folder, FILE + 'drive_model = "Stiff"').axes[0].config)
    assert stiff.drive.name == "Stiff"
    assert stiff.nominal[MERGED] == pytest.approx(0.001 + 0.02**2 * 4)


MISTAKES = [
    (FILE.replace("rigid", "none"), [r"1 model\.drive: \S*none\.mo: cannot read the drawing: No such file"]),
    ('drive = "two_mass"\nmonitor = ["k"]', [r'1 model\.drive: no such drive: did you mean "two-mass"']),
    ('drive = 3\nmonitor = ["k"]', [r"1 model\.drive: must be a text in quotes"]),
    ('drive = "a\\u0000.mo"\nmonitor = ["k"]', [r"1 model\.drive: must be a path"]),
    (FILE.replace('"f"', '"F"'), [r'2 model\.monitor\[1\]: .*did you mean "f"']),
    (FILE.replace('"f"', '"Jl"'), [rf"2 model\.monitor\[1\]: Jl occurs only in {re.escape(MERGED)}"]),
    (FILE.replace('"f"', '"1/Jl"'), [rf"2 model\.monitor\[1\]: Jl occurs only in {re.escape(MERGED)}"]),
    (FILE + "nominal = { jm = 1 }", [r'3 model\.nominal\.jm: .*did you mean "Jm"']),
    (FILE + "nominal = { Jl = -1 }", [r"3 model\.nominal\.Jl: inertia of the load must be .* greater"]),
    (FILE + "nominal = { f = 0.0 }", [r"2 model\.monitor\[1\]: .*give its scale"]),
    (FILE + "nominal = { f = 0.0, Jx = 1 }", [r"2 model\.monitor", r"3 .*Jx: "]),
    (FILE + 'nominal = { f = 0.0, Jl = "x" }', [r"3 .*Jl: must be a number"]),
    (FILE + "bounds = { f = [0.1, 0.2] }", [r"3 model\.bounds\.f: must be .* = 0\.004"]),
    (FILE + DRAWN[DRAWN.index("[robot") :], [r"1 model\.drive: the drive is drawn already: remove this, or"]),
    (DRAWN.replace("nominal = { J = 0.01, f = 0.03 }\n", ""), [r"-?\d+ model\.nominal\.J: missing", r"f: missing"]),
    (DRAWN.replace('"inertia"', '"inertio"'), [r'5 model\.components\.rotor: .*inertia']),
    (DRAWN.replace('"inertia", at = "shaft"', '"inertia"'), [r"5 model\.components\.rotor: "]),
    (DRAWN.replace(', J = "J"', ""), [r"2 model\.nominal\.J: ", r'"rotor\.J": missing']),
    (re.sub("rotor = .*", "rotor = 3", DRAWN), [r"5 .*rotor: must be a table"]),
    (DRAWN.replace('"angle-sensor"', '"torque"'), [r"\d model\.components"]),
]  # fmt: skip


@pytest.mark.parametrize(("model", "expected"), MISTAKES)
def test_mistakes_are_told_where_they_are(model: str, expected: list[str], folder: Path) -> None:
    found = told(folder, model)
    assert len(found) == len(expected), found
    for pattern in expected:
        assert any(re.search(pattern, problem) for problem in found), (pattern, found)


def test_a_mistake_in_a_file_has_the_line_of_the_file_too(folder: Path) -> None:
    (folder / "rigid.mo").write_text(RIGID.replace("J = Jl", "J = Jx"), encoding="utf-8")
    (problem,) = told(folder, FILE)
    assert re.search(r"^1 model\.drive: \S*rigid\.mo:12: load", problem)


def test_a_value_of_the_file_that_makes_no_sense(folder: Path) -> None:
    (folder / "rigid.mo").write_text(
        RIGID.replace("Jm(unit", "Jm(unit").replace("0.001", "-0.001"), encoding="utf-8"
    )
    (problem,) = told(folder, FILE)
    assert re.search(r"model\.drive: .*rigid\.mo:\d+: .*greater than zero", problem)


def test_weights_need_the_angle(folder: Path) -> None:
    assert axis_model(read(folder, DRAWN + WEIGHT).axes[0].config).drive.output == "angle"
    (problem,) = told(folder, DRAWN + WEIGHT, HEAD.replace("angle = ", "speed = "))
    assert "gravity depends on the angle" in problem


def test_the_gain_is_counted_by_the_states_of_the_drive(folder: Path) -> None:
    head = HEAD.replace("1e-4 }", "1e-4, gain = [0.1, 0.2, 0.3] }")
    (problem,) = told(folder, FILE, head)
    assert "has 3 numbers, must have 2, one for each state: motor.w, motor.phi" in problem


def test_every_axis_is_checked_at_once(folder: Path) -> None:
    axis = HEAD[HEAD.index("[[robot.axis]]") :].replace('"a"', '"b"').replace("Axis1", "Axis2")
    found = told(folder, FILE.replace('"f"', '"F"') + axis + DRAWN.replace('["f"]', '["g"]'))
    assert len(found) == 2
