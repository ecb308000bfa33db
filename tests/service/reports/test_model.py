"""The reports of a drive: JSON, the idgrey file read back, and the text for people, whole at any width."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from monitor_core.drive.structure import Quantity
from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from monitor_core.modeling.statespace import StateSpace
from service.reports.model_report import as_json, elimination_words, facts_of, matrix, print_text
from tests.service.reports.made import merged, space


def document(**changes: Any) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(as_json(facts_of(replace(space(), **changes))))
    return found


def test_the_three_mass_drive_as_json() -> None:
    found = document()
    assert found["states"][0] == {"name": "r*motor.phi - gearbox.phi", "unit": "rad"}
    assert [u["kind"] for u in found["inputs"]] == ["torque", "direction", "one"]
    assert found["outputs"] == [{"name": "encoder", "quantity": "speed", "unit": "rad/s"}]
    assert found["parameters"][0] == {
        "name": "Jm",
        "unit": "kg m^2",
        "meaning": "inertia of the motor",
        "nominal": 5.896e-3,
    }
    assert found["A"] == [
        ["0", "0", "r", "-1", "0"],
        ["0", "0", "0", "1", "-1"],
        ["-kg*r/Jm", "0", str(space().A[2, 2]), "dg*r/Jm", "0"],
        ["kg/Jg", "-ka/Jg", "dg*r/Jg", "-(da + dg)/Jg", "da/Jg"],
        ["0", "ka/Ja", "0", "da/Ja", "-da/Ja"],
    ]
    assert found["B"][2] == ["kT/Jm", "-fc/Jm", "tau0/Jm"]
    assert found["C"] == [["0", "0", "1", "0", "0"]]
    assert (found["flat_equations"], found["flat_states"], found["remaining_equations"]) == (71, 11, 6)
    assert (found["merged"], found["missing_nominal"]) == ([], [])
    assert found["notes"] == list(space().notes)
    assert found["identifiability"]
    assert len(found["poles"]) == 5
    trace = sum(float(space().A[i, i].value(REFERENCE_VALUES)) for i in (2, 3, 4))
    assert sum(p["re"] for p in found["poles"]) == pytest.approx(trace)
    assert sum(p["im"] for p in found["poles"]) == pytest.approx(0, abs=1e-9)
    assert found["resonances_hz"] == pytest.approx([9.161, 11.31], rel=1e-3)
    assert found["antiresonances_hz"] == pytest.approx([4.228, 10.39], rel=1e-3)


def test_values_that_are_missing_merged_or_given() -> None:
    drawn = tuple(replace(p, value=None) for p in space().drawn)
    found = document(drawn=drawn, parameters=drawn)
    assert {found[key] for key in ("poles", "resonances_hz", "antiresonances_hz")} == {None}
    assert found["missing_nominal"] == [p.name for p in drawn]
    assert found["parameters"][0]["nominal"] is None
    found = json.loads(as_json(facts_of(merged(space()))))
    assert found["merged"] == [{"name": "Jm", "definition": "J1 + J2*n^2"}]
    assert found["parameters"][0]["nominal"] == pytest.approx(0.005 + 0.25 * 0.001)
    found = json.loads(as_json(facts_of(space(), {"Jm": 1.0})))
    assert found["parameters"][0]["nominal"] == 1.0
    assert found["poles"] != document()["poles"]


def test_what_would_take_minutes_is_left_out() -> None:
    found = document(states=(*space().states, *(Quantity(f"x{i}", "rad") for i in range(96))))
    assert found["identifiability"] == ["Not examined: the drive has more than 100 states."]


# --- text ---------------------------------------------------------------------------------------------------


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
    expected = {p.name for p in drive.parameters} | {s.name for s in drive.states} | set(drive.notes)
    for what in expected | set(facts_of(drive).identifiability):
        assert words_of(what) in words_of(text)


def test_the_three_mass_drive() -> None:
    """Up to what can be identified."""
    text, golden = shown(space()), Path(__file__).parent / "golden" / "three_mass.txt"
    assert text.split("\nIdentifiability")[0] == golden.read_text(encoding="utf-8")


def test_without_damping_there_is_no_minus_zero() -> None:
    drawn = tuple(replace(p, value=0.0) if p.name in ("dg", "da", "fm") else p for p in space().drawn)
    text = shown(replace(space(), drawn=drawn, parameters=drawn))
    assert not re.search(r"-0\b(?!\.)", text)


def test_the_counts_of_the_paper_stand_beside_its_drive_only() -> None:
    own = "flat equations 71, states 11 -> minimal 5, equations left 6"
    assert elimination_words(space(name="mine")) == own
    assert elimination_words(space()).startswith(f"{own}; the paper counts ")


def test_missing_values_are_named() -> None:
    drive = space()
    drawn = tuple(replace(p, value=None) if p.name in ("kg", "da") else p for p in drive.drawn)
    text = shown(replace(drive, drawn=drawn, parameters=drawn))
    assert "not known: no nominal value for kg, da" in text
    assert "Resonances" not in text


def test_merged_parameters_are_listed() -> None:
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


def test_terminals_with_colours_or_without_unicode() -> None:
    text = shown(space(), 120, "ascii")
    assert "-4.262 +- 57.4i" in text
    assert "A = [ -kg*r/Jm" in text
    stream = io.StringIO()
    print_text(facts_of(space()), Console(file=stream, force_terminal=True, width=80, color_system="standard"))
    assert "\x1b[1mthree-mass" in stream.getvalue()


# --- A, B, C ------------------------------------------------------------------------------------------


def test_a_matrix() -> None:
    entries = [["k", "0"], ["0", "-1/Jm"], ["0", "0"]]
    assert matrix("A", entries) == ["    ⎡ k     0   ⎤", "A = ⎢ 0   -1/Jm ⎥", "    ⎣ 0     0   ⎦"]
    assert matrix("C", [["0", "1"]]) == ["C = [ 0   1 ]"]
    assert matrix("B", [["0"], ["0"]], ascii_only=True) == ["B = [ 0 ]", "    [ 0 ]"]


def test_entries_where_the_matrices_do_not_fit() -> None:
    text = shown(space(), 60)
    entries = text[text.index("  A[1,3] =") :].split("\n\n")[0].splitlines()
    assert entries[:4] == ["  A[1,3] = r", "  A[1,4] = -1", "  A[2,4] = 1", "  A[2,5] = -1"]
    assert f"  A[3,3] = {space().A[2, 2]}" in entries
    assert entries[-2:] == ["  B[3,3] = tau0/Jm", "  C[1,3] = 1"]
    ss = space()
    assert len(entries) == len(ss.A) + len(ss.B) + len(ss.C)
