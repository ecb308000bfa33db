"""The drive of an axis by name, as a Modelica file, or drawn in the configuration: what loads, and what is said."""

import re
from pathlib import Path

import pytest

from service.config import Config, ConfigErrors
from service.config.axis_settings import axis_model
from tests.service.config_texts import DRAWN, FILE, HEAD, RIGID, furnish, loaded

MERGED = "Jm + Jl*r^2"

WEIGHT = 'weight = { type = "gravity", at = "shaft", gc = 0.1, gs = 0.2 }\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return furnish(tmp_path)


def read(folder: Path, model: str, head: str = HEAD) -> Config:
    return loaded(folder, head + model)


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


def test_every_axis_is_checked_at_once(folder: Path) -> None:
    axis = HEAD[HEAD.index("[[robot.axis]]") :].replace('"a"', '"b"').replace("Axis1", "Axis2")
    found = told(folder, FILE.replace('"f"', '"F"') + axis + DRAWN.replace('["f"]', '["g"]'))
    assert len(found) == 2
