"""Signals that are the motion of another axis, in a configuration that commissioning writes: made, and kept."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from service.config import load
from service.config.written.commissioned import Found, commissioned, corrected
from service.config.written.corrections import Correction

ROBOT = """\
[[robot]]
name = "cell"
[robot.defaults]
sample_interval_s = 0.01
time = { column = "t" }
model = { drive = "one-mass", monitor = ["kT"], nominal = { kT = 1 } }
SHARED
[[robot.axis]]
name = "q1"
torque = { column = "u1" }
angle = { column = "y1", factor = -0.5, offset = 0.25 }
OWN
[[robot.axis]]
name = "q2"
torque = { column = "u2" }
angle = { column = "y2" }
"""
FOUND = Found("nominal.toml", None, ["kT"])
ONLY_Q2, BOTH = {"cell.q2": FOUND}, {"cell.q1": FOUND, "cell.q2": FOUND}
FOLLOW = Correction(("signal", "q1", "axis"), "q1", "a weight")
WAYS = {
    "none": ("", ""),
    "inline": ("", 'signal = [{ name = "warm", column = "T" }]'),
    "tables": ("", '[[robot.axis.signal]]\nname = "warm"\ncolumn = "T"'),
    "defaults": ('signal = [{ name = "warm", column = "T" }]', ""),
}


def signals(text: str, axis: str) -> dict[str, dict[str, Any]]:
    (robot,) = tomllib.loads(text)["robot"]
    found = next(a for a in robot["axis"] if a["name"] == axis)
    shared = robot.get("defaults", {}).get("signal", [])
    return {s["name"]: {k: v for k, v in s.items() if k != "name"} for s in found.get("signal", shared)}


@pytest.mark.parametrize("way", WAYS)
def test_a_signal_is_added_to_those_that_there_are(way: str, tmp_path: Path) -> None:
    shared, own = WAYS[way]
    text = corrected(ROBOT.replace("SHARED", shared).replace("OWN", own), "cell.q1", [FOLLOW])
    before = {} if way == "none" else {"warm": {"column": "T"}}
    assert signals(text, "q1") == before | {"q1": {"axis": "q1"}}
    assert signals(text, "q2") == (before if way == "defaults" else {})
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    assert [s.name for s in load(tmp_path / "robot.toml", {}).axes[0].config.signal] == [*before, "q1"]


def test_a_signal_that_is_there_gets_the_key() -> None:
    own = 'signal = [{ name = "q1", axis = "q2" }]'
    text = corrected(ROBOT.replace("SHARED", "").replace("OWN", own), "cell.q1", [FOLLOW])
    assert signals(text, "q1") == {"q1": {"axis": "q1"}}


def test_the_motion_of_an_axis_that_is_left_out_is_read_where_it_is(tmp_path: Path) -> None:
    """value = factor (factor of the axis * column + offset of the axis) + offset."""
    text = ROBOT.replace("SHARED", "").replace("OWN", "")
    own = [
        FOLLOW,
        Correction(("signal", "q1", "factor"), 0.01, ""),
        Correction(("signal", "q1", "offset"), 1.0, ""),
    ]
    text = corrected(text, "cell.q2", own)
    written = commissioned(text, ONLY_Q2)
    assert signals(written, "q2") == {"q1": {"column": "y1", "factor": -0.005, "offset": 1.0025}}
    assert signals(commissioned(text, BOTH), "q2") == {"q1": {"axis": "q1", "factor": 0.01, "offset": 1.0}}


@pytest.mark.parametrize("with_signal", [False, True])
def test_coupling_with_an_axis_that_is_left_out_becomes_that_with_a_signal(with_signal: bool, tmp_path: Path) -> None:
    """Which adds the same motion; a signal that has the name of the axis may be something else."""
    text = ROBOT.replace("SHARED", "").replace("OWN", "").replace('"q2"', '"q2"\ncoupling = { q1 = -0.25 }', 1)
    if with_signal:
        text = corrected(text, "cell.q2", [FOLLOW, Correction(("signal", "q1", "factor"), 0.01, "")])
    assert "coupling = { q1 = -0.25 }" in commissioned(text, BOTH)
    found = []
    for written in (text, commissioned(text, ONLY_Q2)):
        given = written.replace('nominal_file = "nominal.toml"', "nominal = { kT = 1 }")
        (tmp_path / "robot.toml").write_text(given, encoding="utf-8")
        found.append(load(tmp_path / "robot.toml", {}).axes[-1])
    before, after = found
    name = "q1-motion" if with_signal else "q1"
    assert (before.config.coupling, after.config.coupling) == ({"q1": -0.25}, {name: -0.25})
    (added,) = after.coupled
    assert before.coupled[0].model_copy(update={"name": name, "axis": None}) == added
