"""The report for people: whole at any width, matrices and equations that say what A, B and C are."""

import io
import random
import re
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Entries, StateSpace
from monitor_core.modeling.symbolic import shapes
from service.reports.model_facts import facts_of
from service.reports.model_text import elimination_words, equations, matrix, matrix_lines, print_text
from tests.service.reports.drives import merged, space


def shown(drive: StateSpace, width: int = 100, encoding: str = "utf-8") -> str:
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding)
    print_text(facts_of(drive), Console(file=stream, width=width, highlight=False))
    stream.flush()
    return raw.getvalue().decode(encoding)


def words_of(text: str) -> str:
    """Without what folding adds."""
    return re.sub(r"\s+", "", text)


@pytest.mark.parametrize("width", [40, 80, 120])
def test_nothing_is_cut_at_any_width(width: int) -> None:
    drive = space("angle")
    text = shown(drive, width)
    assert "…" not in text
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= width
    assert not any(line != line.rstrip() for line in text.splitlines())
    told = {p.name for p in drive.parameters} | {s.name for s in drive.states} | set(drive.notes)
    for what in told | set(facts_of(drive).identifiability):
        assert words_of(what) in words_of(text)


def test_the_three_mass_drive() -> None:
    """Up to what can be identified."""
    text, golden = shown(space()), Path(__file__).parent / "golden" / "three_mass.txt"
    assert text.split("\nIdentifiability")[0] == golden.read_text(encoding="utf-8")


def test_without_damping_there_is_no_minus_zero() -> None:
    drawn = tuple(replace(p, value=0.0) if p.name in ("dg", "da", "fm") else p for p in space().drawn)
    text = shown(replace(space(), drawn=drawn, parameters=drawn))
    assert not re.search(r"-0\b(?!\.)", text)


def test_what_the_elimination_did() -> None:
    assert (
        elimination_words(space(name="mine")) == "flat equations 71, states 11 -> minimal 5, equations left 6"
    )
    assert elimination_words(space("angle", "three-mass")) == (
        "flat equations 71, states 11 -> minimal 6, equations left 6; the paper counts for its tool and library "
        "55, 9, 6 and 5 with the speed as the output, 6 with the angle"
    )


def test_missing_values_are_named() -> None:
    drive = space()
    drawn = tuple(replace(p, value=None) if p.name in ("kg", "da") else p for p in drive.drawn)
    text = shown(replace(drive, drawn=drawn, parameters=drawn))
    assert "not known: no nominal value for kg, da" in text
    assert "Resonances" not in text


def test_merged_parameters_are_told() -> None:
    assert "  Jm = J1 + J2*n^2\n" in shown(merged(space()))
    for drive in (space(), merged(space(), "J1 + J2*n^2")):
        assert "Merged" not in shown(drive)
    assert "  J1 + J2*n^2 " in shown(merged(space(), "J1 + J2*n^2"))


def test_markup_in_names_is_text() -> None:
    odd = FlatParameter("[red]x[/]", "N m", "[bold]no markup[/bold]", 1.0)
    drive = space(name="[b]name[/b]")
    text = shown(replace(drive, parameters=(*drive.parameters, odd), drawn=(*drive.drawn, odd)), 120)
    assert text.startswith("[b]name[/b]\n")
    assert "[red]x[/]" in text
    assert "[bold]no markup[/bold]" in text


def test_a_terminal_without_unicode() -> None:
    text = shown(space(), 120, "ascii")
    assert "-4.262 +- 57.4i" in text
    assert "A = [ -kg*r/Jm" in text


def test_colour_on_a_terminal() -> None:
    stream = io.StringIO()
    print_text(
        facts_of(space()), Console(file=stream, force_terminal=True, width=80, color_system="standard")
    )
    assert "\x1b[1mthree-mass" in stream.getvalue()


# --- A, B, C ------------------------------------------------------------------------------------------


def test_a_matrix() -> None:
    entries = [["k", "0"], ["0", "-1/Jm"], ["0", "0"]]
    assert matrix("A", entries) == ["    ⎡ k     0   ⎤", "A = ⎢ 0   -1/Jm ⎥", "    ⎣ 0     0   ⎦"]
    assert matrix("C", [["0", "1"]]) == ["C = [ 0   1 ]"]
    assert matrix("B", [["0"], ["0"]], ascii_only=True) == ["B = [ 0 ]", "    [ 0 ]"]


def test_equations_where_the_matrices_do_not_fit() -> None:
    lines = matrix_lines(space(), 60)
    assert lines == [
        "x1' = r*x3 - x4",
        "x2' = x4 - x5",
        f"x3' = -kg*r/Jm*x1 - {-space().A[2, 2]}*x3 + dg*r/Jm*x4",
        "      + kT/Jm*u1 - fc/Jm*u2 + tau0/Jm*u3",
        "x4' = kg/Jg*x1 - ka/Jg*x2 + dg*r/Jg*x3 - (da + dg)/Jg*x4",
        "      + da/Jg*x5",
        "x5' = ka/Ja*x2 + da/Ja*x4 - da/Ja*x5",
        "y1 = x3",
    ]
    assert matrix_lines(space(), 100)[2].startswith("A = ⎢ -kg*r/Jm")


def test_sums_stand_in_brackets() -> None:
    drive = space()
    total = Laurent.symbol("a") - Laurent.symbol("b")
    found = list(equations(replace(drive, A={(0, 0): total, (1, 0): -total}, B={})))
    assert found[0] == ["x1' =", "(a - b)*x1"]
    assert found[1] == ["x2' =", "(b - a)*x1"]
    assert found[2] == ["x3' =", "0"]


def test_equations_are_the_matrices(seed: int) -> None:
    source = random.Random(seed)
    drive = space("angle")
    values: dict[str, float] = {p.name: source.uniform(0.5, 2) for p in drive.parameters}
    signals = {f"x{i}": source.uniform(-1, 1) for i in range(1, 7)} | {
        f"u{i}": source.uniform(-1, 1) for i in range(1, 4)
    }
    (n, _), _, _ = shapes(drive)

    def row(entries: Entries, number: int, letter: str) -> float:
        return sum(
            float(v.value(values)) * signals[f"{letter}{c + 1}"]
            for (r, c), v in entries.items()
            if r == number
        )

    for number, equation in enumerate(equations(drive)):
        text = " ".join(equation[1:]).replace("^", "**")
        expected = (
            row(drive.A, number, "x") + row(drive.B, number, "u")
            if number < n
            else row(drive.C, number - n, "x")
        )
        assert eval(text, {"__builtins__": {}}, values | signals) == pytest.approx(expected, rel=1e-12)
