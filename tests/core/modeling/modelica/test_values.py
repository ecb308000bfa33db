"""Values of parameters: which stay parameters, which are replaced, and by what exactly."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from monitor_core.modeling.flat import FlatModel
from monitor_core.modeling.laurent import Laurent
from tests.core.modeling.modelica.texts import drive, flat, values

P = Laurent.symbol
PI = Laurent.number("3.141592653589793")


def inertia(model: FlatModel, name: str = "motor") -> Laurent:
    """J of a component, as it stands in the equations."""
    (found,) = (e.terms[f"{name}.a", 0] for e in model.equations if len(e.terms) == 3 and (f"{name}.a", 0) in e.terms)
    return found


@pytest.mark.parametrize(
    ("declarations", "J", "expected"),
    [
        ("parameter Real m = 2; parameter Real l = 3;", "m*l^2", P("m") * P("l", 2)),
        ("parameter Real r = 2;", "3/r", Laurent.number(3) * P("r", -1)),
        ("parameter Real r = 2;", "r^(-2)", P("r", -2)),
        ("parameter Real r = 2; parameter Real a = 1;", "+(a + r) - -2*a", P("a") * Laurent.number(3) + P("r")),
        ("parameter Real r = 2;", "0.1*r", P("r") * Laurent.number(Fraction(1, 10))),
        ("parameter Real r = 2;", "1e-3*r", P("r") * Laurent.number(Fraction(1, 1000))),
        ("parameter Real r = 2;", "-(-r)^3", P("r", 3)),
        ("parameter Real r = 2; parameter Real s = r/2; parameter Real t = s*s;", "t", P("r", 2) / Laurent.number(4)),
        ("parameter Integer n = 3; parameter Real r = 2;", "n*r^n", Laurent.number(3) * P("r", 3)),
        ("parameter Integer n = 2*1 + 1; parameter Real r = 2;", "r^n", P("r", 3)),
        ("final parameter Real f = 7; parameter Real r = 2;", "f*r", Laurent.number(7) * P("r")),
        ("constant Real f = 7; parameter Real r = 2;", "f*r", Laurent.number(7) * P("r")),
        ("final parameter Real f = 7*r; parameter Real r = 2;", "f*r", Laurent.number(7) * P("r", 2)),
        ("parameter Real r;", "r", P("r")),
        ("parameter Real r = 2;", "r*(r + 1)/(r + 1)", P("r")),
        ("parameter Real r = 2;", "sqrt(16)*r", Laurent.number(4) * P("r")),
        ("parameter Real r = 2;", "max(1, 3)*abs(-1)*r", Laurent.number(3) * P("r")),
        ("parameter Real r = 2;", "3 .* r", P("r") * Laurent.number(3)),
        ("parameter Real r = 2;", "4^0.5*r", Laurent.number(2) * P("r")),
        ("parameter Real r = 2;", "r*Modelica.Constants.pi", P("r") * PI),
        ("parameter Real 'a b' = 2;", "'a b'", P("'a b'")),
        ("import Modelica.Constants.pi; parameter Real r = 2;", "r*pi", P("r") * PI),
        ("import p = Modelica.Constants.pi; parameter Real r = 2;", "r*p", P("r") * PI),
        ("import Modelica.Constants.*; parameter Real r = 2;", "r*pi", P("r") * PI),
        ("import C = Modelica.Constants; parameter Real r = 2;", "r*C.pi", P("r") * PI),
        ("record R parameter Real J = 3; end R; R r(J = 4);", "2*r.J", P("r.J") * Laurent.number(2)),
    ],
)  # fmt: skip
def test_bindings_are_substituted_exactly(declarations: str, J: str, expected: Laurent) -> None:
    assert inertia(flat(drive(declarations, motor=f"J = {J}"))) == expected


def test_numbers_stay_parameters_with_that_value() -> None:
    model = flat(drive("parameter Real r = 1/118; parameter Real angle = Modelica.Constants.pi/180;"
                       "parameter Real unused = 3; parameter Real none(start = 4);",
                       motor="J = r*angle*none"))  # fmt: skip
    assert values(model) == {"r": 1 / 118, "angle": pytest.approx(math.pi / 180, rel=1e-15), "none": None}


def test_a_number_in_a_component_is_a_parameter_by_its_path() -> None:
    model = flat(drive(motor="J = 2*(1 + 0.5)"))
    assert values(model) == {"motor.J": 3.0}
    assert inertia(model) == P("motor.J")
    (only,) = model.parameters
    assert (only.unit, only.meaning, only.positive) == ("kg m^2", "inertia of the motor", True)
    assert (only.origin.component, only.origin.file, only.origin.line) == ("motor.J", "d.mo", 3)


def test_a_component_without_a_value_has_a_parameter_without_one() -> None:
    assert values(flat(drive(motor=""))) == {"motor.J": None}


def test_a_parameter_bound_to_a_constant_stays_one() -> None:
    model = flat(drive("constant Real c = 3;", motor="J = c"))
    assert inertia(model) == P("motor.J")
    assert values(model) == {"motor.J": 3.0}


@pytest.mark.parametrize(
    ("declaration", "unit"),
    [
        ("Real Jm", "kg m^2"),  # from its use
        ('Real Jm(unit = "kg.m2")', "kg m^2"),
        ('Real Jm(final unit = "N.m.s2", displayUnit = "g.cm2")', "kg m^2"),
        ("Modelica.Units.SI.Inertia Jm", "kg m^2"),
        ("Modelica.SIunits.MomentOfInertia Jm(displayUnit = \"kg.cm2\")", "kg m^2"),
    ],
)  # fmt: skip
def test_units(declaration: str, unit: str) -> None:
    (only,) = flat(drive(f"parameter {declaration} = 2;", motor="J = Jm")).parameters
    assert (only.name, only.unit, only.value) == ("Jm", unit, 2.0)


def test_units_of_factors_are_found_from_the_product() -> None:
    model = flat(drive("parameter Modelica.Units.SI.Mass m = 2; parameter Real l = 3;", motor="J = m*l^2"))
    assert {p.name: p.unit for p in model.parameters} == {"m": "kg", "l": "m"}


def test_the_comment_is_the_meaning() -> None:
    (only,) = flat(drive('parameter Real Jm = 2 "of the " + "rotor";', motor="J = Jm")).parameters
    assert only.meaning == "of the rotor"


def test_the_meaning_is_where_the_parameter_stands_alone() -> None:
    arm = "Modelica.Mechanics.Rotational.Components.Inertia arm(J = Jx)"
    model = flat(drive(f"parameter Real Jx = 2; parameter Real r = 1; {arm};", motor="J = Jx/r^2"))
    assert {p.name: p.meaning for p in model.parameters} == {
        "Jx": "inertia of the arm",
        "r": "in the inertia of the motor: Jx/r^2",
    }


def test_parameters_in_the_order_of_declaration() -> None:
    model = flat(drive("parameter Real b = 1; parameter Real a = 2;", motor="J = a*b"))
    assert [p.name for p in model.parameters] == ["b", "a"]
