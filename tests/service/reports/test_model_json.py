"""A drive as JSON."""

import json
from dataclasses import replace
from typing import Any

import pytest

from monitor_core.drive.structure import Quantity
from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from service.reports.model_facts import as_json, facts_of
from tests.service.reports.drives import merged, space


def document(**changes: Any) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(as_json(facts_of(replace(space(), **changes))))
    return found


def test_the_three_mass_drive() -> None:
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


def test_numbers_at_nominal() -> None:
    found = document()
    A = space()
    assert len(found["poles"]) == 5
    trace = sum(float(A.A[i, i].value(REFERENCE_VALUES)) for i in (2, 3, 4))
    assert sum(p["re"] for p in found["poles"]) == pytest.approx(trace)
    assert sum(p["im"] for p in found["poles"]) == pytest.approx(0, abs=1e-9)
    assert found["resonances_hz"] == pytest.approx([9.161, 11.31], rel=1e-3)
    assert found["antiresonances_hz"] == pytest.approx([4.228, 10.39], rel=1e-3)


def test_without_nominal_values() -> None:
    drawn = tuple(replace(p, value=None) for p in space().drawn)
    found = document(drawn=drawn, parameters=drawn)
    assert {found[key] for key in ("poles", "resonances_hz", "antiresonances_hz")} == {None}
    assert found["missing_nominal"] == [p.name for p in drawn]
    assert found["parameters"][0]["nominal"] is None


def test_merged_parameters() -> None:
    found = json.loads(as_json(facts_of(merged(space()))))
    assert found["merged"] == [{"name": "Jm", "definition": "J1 + J2*n^2"}]
    assert found["parameters"][0]["nominal"] == pytest.approx(0.005 + 0.25 * 0.001)


def test_values_go_before_those_of_the_drawing() -> None:
    found = json.loads(as_json(facts_of(space(), {"Jm": 1.0})))
    assert found["parameters"][0]["nominal"] == 1.0
    assert found["poles"] != document()["poles"]


def test_what_would_take_minutes_is_left_out() -> None:
    found = document(states=(*space().states, *(Quantity(f"x{i}", "rad") for i in range(96))))
    assert found["identifiability"] == ["Not examined: the drive has more than 100 states."]
