"""LaTeX: what TeX would refuse is found here; there is no TeX."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive.structure import Quantity
from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from monitor_core.modeling.statespace import Definition
from monitor_core.modeling.symbolic import GREEK
from service.reports.model_latex import as_latex, formula
from tests.service.reports.drives import merged, space

COMMANDS = {
    *(
        "tau",
        "varphi",
        "omega",
        "dot",
        "ddot",
        "bar",
        "mathrm",
        "text",
        "frac",
        "tanh",
        "cdot",
        "qquad",
        "displaystyle",
    ),
    *("begin", "end", "section", "hline", "resizebox", "linewidth", "setcounter"),
    *("textbackslash", "textasciitilde", "textasciicircum", *GREEK.values()),
    *"[],\\_&%#${}",
}


def faults(text: str) -> list[str]:
    """What TeX would stop at: commands nobody defined, brackets, environments, cells, letters out of place."""
    body = re.sub(r"(?<!\\)%.*", "", text).replace(r"\\[0.6ex]", r"\\")
    commands = re.findall(r"\\([A-Za-z]+|.)", body, re.S)
    found = [f"command {c}" for c in commands if c not in COMMANDS]
    bare = re.sub(r"\\[^A-Za-z]", "", body)
    pairs = body.replace(r"\\", " ")
    depth = 0
    for letter in bare:
        depth += (letter == "{") - (letter == "}")
        if depth < 0:
            return [*found, "a brace too many"]
    found += ["a brace is open"] if depth else []
    found += _environments(body) + _cells(body)
    found += ["formula open"] if bare.count("$") % 2 or pairs.count(r"\[") != pairs.count(r"\]") else []
    outside = re.sub(
        r"\\\[.*?\\\]|\$.*?\$|\\begin\{align\*\}.*?\\end\{align\*\}", "", body.replace(r"\$", ""), flags=re.S
    )
    outside = re.sub(r"\\[^A-Za-z]", "", outside)
    return found + [f"{letter} outside of formulas" for letter in "_^#" if letter in outside]


def _environments(body: str) -> list[str]:
    stack: list[str] = []
    for what, name in re.findall(r"\\(begin|end)\{([a-z*]+)\}", body):
        if what == "begin":
            stack.append(name)
        elif not stack or stack.pop() != name:
            return [f"end of {name}"]
    return [f"{name} is open" for name in stack]


def _cells(body: str) -> list[str]:
    found = []
    for content in re.findall(r"\\begin\{bmatrix\}(.*?)\\end\{bmatrix\}", body, re.S):
        widths = {len(re.findall(r"(?<!\\)&", row)) for row in re.split(r"\\\\", content)}
        found += ["rows of a matrix differ"] if len(widths) > 1 else []
    for content in re.findall(
        r"\\begin\{tabular\}\{lp\{0\.5\\linewidth\}rl\}(.*?)\\end\{tabular\}", body, re.S
    ):
        rows = [row for row in re.split(r"\\\\", content) if row.strip()]
        found += [f"cells: {row}" for row in rows if len(re.findall(r"(?<!\\)&", row)) != 3]
    return found


@pytest.mark.parametrize(
    "text",
    [
        r"\foo",
        "{",
        "}",
        "$x",
        r"\[ x",
        r"\begin{bmatrix} 1",
        r"a_b",
        r"\begin{bmatrix} 1 & 2 \\ 3 \end{bmatrix}",
    ],
)
def test_the_checker_sees(text: str) -> None:
    assert faults(text)


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_the_three_mass_drive(output: str) -> None:
    text = as_latex(space("speed" if output == "speed" else "angle"), REFERENCE_VALUES)
    assert faults(text) == []
    assert text.count(r"\begin{bmatrix}") == 6
    assert r"- \frac{k_{g} r}{J_{m}}" in text
    assert r"$J_{m}$ & inertia of the motor & $0.005896$ & $\mathrm{kg\,m^{2}}$ \\" in text
    assert r"\resizebox" not in text


def test_merged_parameters_are_defined() -> None:
    text = as_latex(merged(space()), {})
    assert r"\[ J_{m} = J_{1} + J_{2} n^{2} \]" in text
    assert "$J_{m}$ & inertia of the motor & -- &" in text
    assert faults(text) == []


def test_merged_parameters_without_a_name_get_a_letter() -> None:
    text = as_latex(merged(space(), "J1 + J2*n^2"), {})
    assert r"\[ \bar{J}_{1} = J_{1} + J_{2} n^{2} \]" in text
    assert r"- \frac{k_{g} r}{\bar{J}_{1}}" in text
    assert faults(text) == []


def test_definitions_may_use_earlier_ones() -> None:
    drive = merged(space(), "J1 + J2*n^2")
    inner = Definition("J2 + 1", Laurent.symbol("J2") + Laurent.number(1))
    text = as_latex(replace(drive, definitions=(inner, *drive.definitions)), {})
    assert r"\[ \bar{p}_{1} = J_{2} + 1 \]" in text
    assert r"\[ \bar{J}_{2} = J_{1} + J_{2} n^{2} \]" in text


def test_a_large_matrix_fits_the_page() -> None:
    drive = space()
    text = as_latex(replace(drive, states=drive.states + (Quantity("x", "rad"),) * 6), {})
    assert r"\setcounter{MaxMatrixCols}{11}" in text
    assert r"\resizebox{\linewidth}{!}{$\displaystyle A = " in text
    assert faults(text) == []


def test_large_and_small_numbers() -> None:
    text = as_latex(space(), {"kg": 2.5e10, "dg": 1e-7})
    assert r"$2.5 \cdot 10^{10}$" in text.replace("cdot", "cdot")
    assert r"$1 \cdot 10^{-7}$" in text


@pytest.mark.parametrize(
    ("state", "printed"),
    [
        ("r phi_m - phi_g", r"r \varphi_{m} - \varphi_{g}"),
        ("phi_a'", r"\dot{\varphi}_{a}"),
        ("r*motor.phi - gear.phi", r"r \varphi_{\mathrm{motor}} - \varphi_{\mathrm{gear}}"),
        ("2*a.w", r"2 \omega_{a}"),
        ("(1/r)*x", "( 1 / r ) x"),
    ],
)
def test_states_as_formulas(state: str, printed: str) -> None:
    assert formula(state) == printed


@given(
    name=st.text(min_size=1, max_size=12).filter(str.isprintable),
    words=st.text(max_size=20).filter(str.isprintable),
)
def test_whatever_the_drawing_calls_it(name: str, words: str) -> None:
    drive = space(name=words)
    odd = FlatParameter(name, "kg m^2", words)
    drive = replace(drive, parameters=(*drive.parameters, odd), states=(*drive.states, Quantity("x", "rad")))
    assert faults(as_latex(drive, {})) == []
