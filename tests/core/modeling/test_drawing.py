"""Drawings become square, regular systems with the drive's own response, and a table of parameters."""

from __future__ import annotations

import textwrap

import pytest
from hypothesis import given, settings

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling import drawing as drawing_module
from monitor_core.modeling.components import KINDS, Kind
from monitor_core.modeling.drawing import Drawing, from_tables, part
from monitor_core.modeling.flat import ModelError
from tests.core.modeling.drawings import two_mass
from tests.core.modeling.modelica.transfer import PRIME, responses
from tests.core.modeling.random_drives import RandomDrive, drives

# --- the equations ---------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(drives())
def test_the_equations_hold_all_that_is_declared_and_nothing_else(drive: RandomDrive) -> None:
    """That they say the right thing is seen in what the elimination makes of them."""
    flat = from_tables("random", drive.parts).flat()
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
        flat = Drawing(
            "one", [part("torque", "torque", "a", kT="J"), mass, spring, part("angle-sensor", "s", last)]
        )
        with pytest.raises(ModelError, match="but J is in"):
            flat.flat()
        flat = Drawing("one", [part("torque", "torque", "a"), mass, spring, part("angle-sensor", "s", last)])
        expected = pow(5 * 9 + 11 * 3 + 7, -1, PRIME)
        assert responses(flat.flat(), values.__getitem__, 3) == {("angle", 0): {TORQUE: expected}}


def test_ground_is_fixed_once() -> None:
    spring = part("spring", "spring", "arm", "ground")
    for more in ([], [part("fixed", "wall", "ground")], [part("fixed", "ground", "ground")]):
        flat = Drawing("arm", [part("inertia", "arm", "arm"), spring, *more]).flat()
        fixed = [v.name for v in flat.variables if v.name in ("ground.flange.phi", "wall.flange.phi")]
        assert fixed == [f"{more[0].name if more else 'ground'}.flange.phi"]


# --- parameters ------------------------------------------------------------------------------------------


def table(drawing: Drawing) -> dict[str, tuple[str, str, float | None, bool]]:
    return {p.name: (p.unit, p.meaning, p.value, p.positive) for p in drawing.flat().parameters}


def test_parameters_have_units_meanings_and_values() -> None:
    assert table(two_mass(Jm=0.005, fm=-0.1)) == {
        "kT": ("1", "torque constant of the torque", None, True),
        "Jm": ("kg m^2", "inertia of the motor", 0.005, True),
        "fm": ("N m s/rad", "viscous friction of the bearing", -0.1, False),
        "k": ("N m/rad", "stiffness of the belt", None, True),
        "d": ("N m s/rad", "damping of the belt", None, False),
        "Ja": ("kg m^2", "inertia of the arm", None, True),
    }


def test_numbers_and_what_is_left_out_are_called_after_the_component() -> None:
    parts = [
        part("inertia", "big_arm", "arm", J=2),
        part("inertia", "tip", "arm", J=" 0.5 "),
        part("spring", "wall", "arm", "ground"),
        part("torque", "torque", "arm"),
        part("ideal-gear", "gear", "arm", "back", ratio=-118.0),
        part("inertia", "rotor", "back", J="2*big_arm.J"),
    ]
    assert table(Drawing("arm", parts, {"wall.c": 100.0, "tip.J": 0.25})) == {
        "big_arm.J": ("kg m^2", "inertia of the big arm", 2.0, True),
        "tip.J": ("kg m^2", "inertia of the tip", 0.25, True),
        "wall.c": ("N m/rad", "stiffness of the wall", 100.0, True),
        "torque.kT": ("1", "torque constant of the torque", 1.0, True),
        "gear.ratio": ("1", "ratio of the gear", -118.0, False),
    }


def test_expressions_tell_units_and_signs() -> None:
    parts = [
        part("inertia", "arm", "arm", J="m*l^2"),
        part("inertia", "load", "arm", J="ml*l^2 + J0"),
        part("ideal-gear", "gear", "motor", "arm", ratio="1/r"),
        part("gravity", "weight", "arm", gc="m*g*l", gs="c*s"),
    ]
    assert table(Drawing("arm", parts, {"l": -0.5})) == {
        "l": ("", "in the inertia of the arm: l^2*m", -0.5, False),
        "m": ("", "in the inertia of the arm: l^2*m", None, True),
        "J0": ("kg m^2", "in the inertia of the load: J0 + l^2*ml", None, False),
        "ml": ("", "in the inertia of the load: J0 + l^2*ml", None, False),
        "r": ("1", "in the ratio of the gear: 1/r", None, True),
        "g": ("", "in the gravity torque by the cosine of the weight: g*l*m", None, False),
        "c": ("", "in the gravity torque by the sine of the weight: c*s", None, False),
        "s": ("", "in the gravity torque by the sine of the weight: c*s", None, False),
    }


def test_signs_of_parameters() -> None:
    """Of an inertia -a the parameter a is negative; a gear's r may be, if its value says so; both are not zero."""
    parts = [part("inertia", "arm", "arm", J="-a"), part("ideal-gear", "gear", "motor", "arm", ratio="-r")]
    for nominal in ({}, {"a": -1.0, "r": -118.0}):
        assert {name: row[3] for name, row in table(Drawing("arm", parts, nominal)).items()} == {
            "a": False,
            "r": not nominal,
        }
    for nominal, problem in ({"r": 0.0}, r"^gear: nominal value of r .* is 0"), ({"a": 1.0}, "= -a is -1 at"):
        with pytest.raises(ModelError, match=problem):
            Drawing("arm", parts, nominal).flat()


def test_meanings_set_the_order_and_the_words() -> None:
    ordered = Drawing(
        "two-mass", two_mass().components, meanings={"k": "stiffness of the toothed belt", "Ja": ""}
    )
    parameters = ordered.flat().parameters
    assert [p.name for p in parameters] == ["k", "Ja", "kT", "Jm", "fm", "d"]
    assert [p.meaning for p in parameters][:2] == ["stiffness of the toothed belt", "inertia of the arm"]


# --- from a configuration file ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS.values() if kind.flanges], ids=lambda kind: kind.name
)
def test_what_python_draws_a_table_draws(kind: Kind) -> None:
    given = {role.name: f"p_{role.name}" for role in kind.roles}
    nodes = [f"n{i}" for i in range(len(kind.flanges))]
    table = {"type": kind.name, "name": "x", "at": nodes, **given}
    assert from_tables("x", [table]).components == (part(kind.name, "x", *nodes, **given),)


def test_the_example_at_the_top_of_the_file_is_right() -> None:
    text = drawing_module.__doc__ or ""
    code = text.split("\n\n", 1)[1]
    names = {**vars(drawing_module)}
    exec(textwrap.dedent(code), names)
    assert names["flat"] == two_mass().flat()
