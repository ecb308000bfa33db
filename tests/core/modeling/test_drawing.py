"""Drawings become square, regular systems with the drive's own response, and a table of parameters."""

from __future__ import annotations

import textwrap

import pytest
from hypothesis import given, settings

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling import drawing as drawing_module
from monitor_core.modeling.drawing import Drawing, part
from monitor_core.modeling.flat import ModelError
from tests.core.modeling.expressions import parse
from tests.core.modeling.modelica.transfer import PRIME, responses
from tests.core.modeling.random_drives import RandomDrive, drives
from tests.core.modeling.spaces import drawn


def two_mass() -> Drawing:
    return Drawing(
        "two-mass",
        [
            part("torque", "torque", "shaft", kT="kT"),
            part("inertia", "motor", "shaft", J="Jm"),
            part("viscous-friction", "bearing", "shaft", d="fm"),
            part("spring-damper", "belt", "shaft", "load", c="k", d="d"),
            part("inertia", "arm", "load", J="Ja"),
            part("speed-sensor", "encoder", "shaft"),
        ],
    )


# --- the equations ---------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(drives())
def test_the_equations_hold_all_that_is_declared_and_nothing_else(drive: RandomDrive) -> None:
    """That they say the right thing is seen in what the elimination makes of them."""
    flat = drawn(drive.parts).flat()
    known = {v.name for v in flat.variables} | {i.name for i in flat.inputs}
    assert len(flat.variables) == len(flat.equations)
    assert {name for e in flat.equations for name, _ in e.terms} == known
    assert {s.angle for s in flat.sensors} <= known
    occurring = {n for e in flat.equations for c in e.terms.values() for n in c.names}
    assert occurring == {p.name for p in flat.parameters} == set(drive.exact)


def test_a_mass_at_one_node_or_between_two_or_twice_at_one_is_the_same() -> None:
    values = {"J": 5, "k": 7, "d": 11, "torque.kT": 1}
    placed = [
        part("inertia", "mass", "a", J="J"),
        part("inertia", "mass", "a", "b", J="J"),
        part("inertia", "mass", "a", "a", J="J"),
    ]
    for mass in placed:
        last = mass.nodes[-1]
        spring = part("spring-damper", "spring", last, "ground", c="k", d="d")
        parts = [mass, spring, part("fixed", "wall", "ground"), part("angle-sensor", "s", last)]
        with pytest.raises(ModelError, match="but J is in"):
            Drawing("one", [part("torque", "torque", "a", kT="J"), *parts]).flat()
        flat = Drawing("one", [part("torque", "torque", "a"), *parts]).flat()
        expected = pow(5 * 9 + 11 * 3 + 7, -1, PRIME)
        assert responses(flat, values.__getitem__, 3) == {("angle", 0): {TORQUE: expected}}


# --- parameters ------------------------------------------------------------------------------------------


def table(drawing: Drawing) -> dict[str, tuple[str, str, bool]]:
    return {p.name: (p.unit, p.meaning, p.positive) for p in drawing.flat().parameters}


def test_what_is_left_out_is_called_after_the_component() -> None:
    parts = [part("inertia", "big_arm", "arm"), part("spring", "wall", "arm", "ground")]
    assert table(Drawing("arm", parts)) == {
        "big_arm.J": ("kg m^2", "inertia of the big arm", True),
        "wall.c": ("N m/rad", "stiffness of the wall", True),
    }


def test_expressions_tell_units_and_signs() -> None:
    parts = [
        part("inertia", "arm", "arm", J=parse("m*l^2")),
        part("inertia", "load", "arm", J=parse("ml*l^2 + J0")),
        part("ideal-gear", "gear", "motor", "arm", ratio=parse("1/r")),
        part("gravity", "weight", "arm", gc=parse("m*g*l"), gs=parse("c*s")),
    ]
    assert table(Drawing("arm", parts)) == {
        "l": ("", "in the inertia of the arm: l^2*m", True),
        "m": ("", "in the inertia of the arm: l^2*m", True),
        "J0": ("kg m^2", "in the inertia of the load: J0 + l^2*ml", False),
        "ml": ("", "in the inertia of the load: J0 + l^2*ml", False),
        "r": ("1", "in the ratio of the gear: 1/r", True),
        "g": ("", "in the gravity torque by the cosine of the weight: g*l*m", False),
        "c": ("", "in the gravity torque by the sine of the weight: c*s", False),
        "s": ("", "in the gravity torque by the sine of the weight: c*s", False),
    }


def test_signs_of_parameters() -> None:
    """Of an inertia -a the parameter a is negative."""
    parts = [part("inertia", "arm", "arm", J=parse("-a")), part("spring", "wall", "arm", "ground", c="k")]
    assert {name: row[2] for name, row in table(Drawing("arm", parts)).items()} == {"a": False, "k": True}


def test_a_spring_constant_given_to_an_inertia_names_both() -> None:
    parts = [part("inertia", "motor", "shaft", J="k"), part("spring", "belt", "shaft", "load", c="k")]
    with pytest.raises(ModelError, match=r"^belt: its c \(stiffness\) is in N m/rad, but k is in kg m\^2 \(k is"):
        Drawing("drive", parts).flat()


def test_meanings_set_the_order_and_the_words() -> None:
    ordered = Drawing("two-mass", two_mass().components, meanings={"k": "stiffness of the toothed belt", "Ja": ""})
    parameters = ordered.flat().parameters
    assert [p.name for p in parameters] == ["k", "Ja", "kT", "Jm", "fm", "d"]
    assert [p.meaning for p in parameters][:2] == ["stiffness of the toothed belt", "inertia of the arm"]


def test_the_example_at_the_top_of_the_file_is_right() -> None:
    text = drawing_module.__doc__ or ""
    code = text.split("\n\n")[1]
    assert eval(textwrap.dedent(code), {**vars(drawing_module)}) == two_mass().flat()
