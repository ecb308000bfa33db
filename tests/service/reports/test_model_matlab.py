"""The idgrey file, read back: its matrices are those of the drive."""

import random
import re
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive.structure import Output
from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from monitor_core.modeling.statespace import Entries
from monitor_core.modeling.symbolic import shapes
from service.reports.model_matlab import KEYWORDS, as_matlab, matlab_name, matlab_names
from tests.service.reports.drives import merged, renamed, space


def called(text: str, *given: float) -> dict[str, np.ndarray]:
    """What MATLAB would return: the function's six matrices at these arguments."""
    lines = text.splitlines()
    head = re.fullmatch(r"function \[A,B,C,D,K,x0\] = (\w+)\((.*)\)", lines[0])
    assert head
    assert lines[-1] == "end"
    values = dict(zip(head[2].split(", "), given, strict=True))
    found: dict[str, np.ndarray] = {}
    for line in lines[1:-1]:
        if line.startswith("%"):
            continue
        if zeros := re.fullmatch(r"(\w+) = zeros\((\d+),(\d+)\);", line):
            found[zeros[1]] = np.zeros((int(zeros[2]), int(zeros[3])))
            continue
        entry = re.fullmatch(r"(\w)\((\d+),(\d+)\) = ([\w\s*^/().+-]+);", line)
        assert entry, line
        formula = entry[4].replace("^", "**")
        found[entry[1]][int(entry[2]) - 1, int(entry[3]) - 1] = eval(
            formula, {"__builtins__": {}}, dict(values)
        )
    return found


def numeric(entries: Entries, shape: tuple[int, int], values: Mapping[str, float]) -> np.ndarray:
    out = np.zeros(shape)
    for place, value in entries.items():
        out[place] = value.value(values)
    return out


AWKWARD = {
    "Jm": "motor.J",
    "Jg": "motor_J",
    "kg": "end",
    "ka": "1x",
    "dg": "Ts",
    "da": "A",
    "fm": "f m's",
    "r": "drive",
}


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("names", [{}, AWKWARD], ids=["plain", "awkward"])
def test_matrices_are_those_of_the_drive(output: Output, names: dict[str, str], seed: int) -> None:
    drive, source = renamed(space(output), names), random.Random(seed)
    values = {p.name: source.uniform(0.1, 10) for p in drive.parameters}
    found = called(as_matlab(drive, {}), *values.values(), 0.0)
    for letter, entries, shape in zip("ABC", (drive.A, drive.B, drive.C), shapes(drive), strict=True):
        np.testing.assert_allclose(found[letter], numeric(entries, shape, values), rtol=1e-12)
    n = len(drive.states)
    shown = {name: found[name].shape for name in ("D", "K", "x0")}
    assert shown == {"D": (1, 3), "K": (n, 1), "x0": (n, 1)}
    assert not any(found[name].any() for name in ("D", "K", "x0"))


def test_the_call_of_idgrey_stands_in_a_comment() -> None:
    text = as_matlab(space(), {**REFERENCE_VALUES}, "axis1")
    assert text.startswith(
        "function [A,B,C,D,K,x0] = axis1(Jm, Jg, Ja, kg, ka, dg, da, fm, fc, tau0, kT, r, Ts)\n"
    )
    assert "%   model = idgrey('axis1', parameters, 'c');" in text
    pairs = re.findall(r"^%     '(\w+)', ([^;]+);", text, re.M)
    assert {name: float(value) for name, value in pairs} == pytest.approx(dict(REFERENCE_VALUES), rel=1e-11)


def test_what_has_no_value_is_nan() -> None:
    assert "%     'kg', NaN; ..." in as_matlab(space(), {"Jm": 1.0})


@pytest.mark.parametrize("name", ["my-drive", "3mass", "end", "", "_x", "ä"])
def test_a_function_needs_a_name(name: str) -> None:
    with pytest.raises(ValueError, match="no name for a MATLAB function"):
        as_matlab(space(), {}, name)


@given(st.lists(st.text(min_size=1, max_size=70), unique=True, max_size=6))
def test_every_name_is_one_for_matlab(names: list[str]) -> None:
    found = matlab_names(
        [*names, "motor.J", "motor_J"] if not {"motor.J", "motor_J"} & set(names) else names, {"drive"}
    )
    assert len(set(found.values())) == len(found)
    for name in found.values():
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", name)
        assert name not in KEYWORDS | {"drive", "Ts", "A", "x0"}
        assert matlab_name(name) == name


def test_a_comment_stays_a_comment() -> None:
    drive = space(name="two\nlines")
    assert all(
        line.startswith(("%", "function", "A", "B", "C", "D", "K", "x0", "end"))
        for line in as_matlab(drive, {}).splitlines()
    )


def test_merged_parameters_have_names_and_are_explained() -> None:
    text = as_matlab(merged(space(), "J1 + J2*n^2"), {})
    assert text.startswith("function [A,B,C,D,K,x0] = drive(J1_J2_n_2, Jg,")
    assert "%   J1_J2_n_2 stands for J1 + J2*n^2\n" in text
    assert "A(3,1) = -kg*r/J1_J2_n_2;" in text
