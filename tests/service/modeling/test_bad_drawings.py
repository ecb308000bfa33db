"""Drawings that are wrong, through the command itself: one line with file, line and component, exit code 2.

What the reader alone refuses is in tests/core/modeling/modelica/test_errors.py.
"""

import json
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.service.command_line import axiswatch
from tests.service.modeling.long_drives import ROTATIONAL, chain_text, geared_text

COMPONENTS = f"{ROTATIONAL}.Components"
TORQUE = f"  {ROTATIONAL}.Sources.Torque torque;\n"
ENCODER = f"  {ROTATIONAL}.Sensors.SpeedSensor encoder;\n"
TO_TORQUE = "  connect(torque.flange, motor.flange_a);\n"
TO_ENCODER = "  connect(encoder.flange, motor.flange_a);\n"
TO_BELT = "  connect(belt.flange_a, motor.flange_b);\n"


def press(declared: str = "", joined: str = "") -> str:
    """Motor and arm; lines ``declared`` at 7, then ``joined`` at 13, if each is one."""
    declared, joined = (f"  {text}\n" if text else "" for text in (declared, joined))
    return (
        f"model Press\n{TORQUE}  {COMPONENTS}.Inertia motor(J = 0.1);\n"
        f"  {COMPONENTS}.SpringDamper belt(c = 400, d = 0.5);\n  {COMPONENTS}.Inertia arm(J = 2);\n{ENCODER}{declared}"
        f"equation\n{TO_TORQUE}{TO_ENCODER}{TO_BELT}  connect(belt.flange_b, arm.flange_a);\n{joined}end Press;\n"
    )


PRESS = press()
GEAR = f"{COMPONENTS}.IdealGear"
TWO_GEARS = press(
    f"{GEAR} g1(ratio = 3); {GEAR} g2(ratio = 4);",
    "connect(g1.flange_a, motor.flange_b); connect(g2.flange_a, motor.flange_b); connect(g1.flange_b, g2.flange_b);",
)
LOCKED = press(
    f"{GEAR} gear(ratio = 3); {COMPONENTS}.Fixed wall;",
    "connect(gear.flange_a, motor.flange_b); connect(gear.flange_b, wall.flange);",
)
SPRUNG = PRESS.replace(f"  {COMPONENTS}.Inertia motor(J = 0.1);\n", f"  {COMPONENTS}.Spring motor(c = 7);\n")


class Bad(NamedTuple):
    """A text, and what the message must begin with behind the file's name, and hold."""

    text: str | bytes
    place: str
    words: tuple[str, ...]


BAD = {
    "no semicolon": Bad(PRESS.replace("0.1);", "0.1)"), ":3: ", ('";" is missing',)),
    "unknown class": Bad(PRESS.replace("Inertia motor", "Inertai motor"), ":3: motor: ", ("did you mean Inertia?",)),
    "ratio of zero": Bad(press(f"{GEAR} gear(ratio = 0);"), ":7: gear: ", ("ratio", "must not be zero")),
    "torque not connected": Bad(
        PRESS.replace(TO_TORQUE, ""), ":2: torque: ", ("nothing is connected to torque.flange",)
    ),
    "no torque": Bad(PRESS.replace(TO_TORQUE, "").replace(TORQUE, ""), ":1: Press: ", ("draw a torque source",)),
    "no sensor": Bad(PRESS.replace(TO_ENCODER, "").replace(ENCODER, ""), ":1: Press: ", ("draw a speed sensor",)),
    "sensor not connected": Bad(PRESS.replace(TO_ENCODER, ""), ":6: encoder: ", ("not connected",)),
    "sensor on another drive": Bad(
        PRESS.replace(TO_BELT, "").replace(TO_ENCODER, TO_ENCODER.replace("motor.flange_a", "arm.flange_b")),
        ":6: encoder: ",
        ("no path leads from the motor torque",),
    ),
    "part not connected": Bad(
        PRESS.replace(TO_BELT, "").replace("  connect(belt.flange_b, arm.flange_a);\n", ""),
        ":4: belt: ",
        ("not connected",),
    ),
    "locked gear": Bad(LOCKED, ":6: encoder: ", ("stands still",)),
    "two gears in parallel": Bad(TWO_GEARS, ":13: ", ("locked", "different ratio in parallel")),
    "torque on springs alone": Bad(SPRUNG, ":", ("only springs", "inertia or a damper is missing")),
    "two sensors": Bad(
        press(f"{ROTATIONAL}.Sensors.AngleSensor s2;", "connect(s2.flange, arm.flange_b);"), ":7: s2: ", ("one sensor",)
    ),
    "another language": Bad("<html></html>\n", ":1: ", ('model Name',)),
    "bytes": Bad("\x00\x01", ":1: ", ("is not Modelica",)),
    "Latin-1": Bad(PRESS.replace("arm(J = 2)", 'arm(J = 2) "Träger"').encode("latin-1"), ":5: ", ("UTF-8",)),
    "UTF-16": Bad(PRESS.encode("utf-16"), ":1: ", ("UTF-8",)),
}  # fmt: skip


def written(bad: Bad, folder: Path) -> Path:
    file = folder / "press.mo"
    file.write_bytes(bad.text if isinstance(bad.text, bytes) else bad.text.encode())
    return file


@pytest.mark.parametrize("name", BAD)
def test_a_bad_drawing_is_refused_in_words(name: str, tmp_path: Path) -> None:
    bad, file = BAD[name], written(BAD[name], tmp_path)
    result = axiswatch("model", file)
    assert (result.exit_code, result.stdout) == (2, ""), result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stderr.removesuffix("\n").isprintable()
    assert result.stderr.startswith(f"axiswatch: {file}{bad.place}"), result.stderr
    assert [word for word in bad.words if word not in result.stderr] == []


def shown(text: str, folder: Path, *arguments: str) -> str:
    """What the command says of a drawing that it takes; nothing on standard error."""
    result = axiswatch("model", written(Bad(text, "", ()), folder), *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    return result.stdout


def test_without_a_value_there_are_matrices_but_no_poles(tmp_path: Path) -> None:
    text = shown(PRESS.replace("motor(J = 0.1)", "motor"), tmp_path)
    assert "motor.J" in text
    assert "Poles at nominal" in text
    found = json.loads(shown(PRESS.replace("motor(J = 0.1)", "motor"), tmp_path, "--json", "-"))
    assert found["poles"] is None
    assert len(found["A"]) == len(found["states"]) == 3


EXTREME = {
    "unstable": PRESS.replace("d = 0.5", "d = -50"),
    "far too stiff": PRESS.replace("c = 400", "c = 1e300"),
    "gravity and a speed": press("AxisWatch.Gravity weight(gc = 3, gs = 1);", "connect(weight.flange, arm.flange_b);"),
}


@pytest.mark.parametrize("text", EXTREME.values(), ids=EXTREME)
def test_drives_that_cannot_be_monitored_are_shown_all_the_same(text: str, tmp_path: Path) -> None:
    assert "Poles at nominal" in " ".join(shown(text, tmp_path).split())


@pytest.mark.soak
def test_a_hundred_masses_are_answered(tmp_path: Path) -> None:
    report = tmp_path / "model.json"
    assert "mass99" in shown(chain_text(100), tmp_path, "--json", str(report))
    assert len(json.loads(report.read_text(encoding="utf-8"))["states"]) == 199


def test_a_hundred_masses_joined_by_gears_are_answered(tmp_path: Path) -> None:
    out = json.loads(shown(geared_text(64), tmp_path, "--json", "-"))
    assert len(out["states"]) == 1
    assert "more than 60 parameters are merged" in " ".join(out["identifiability"])
