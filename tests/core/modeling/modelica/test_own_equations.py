"""Equations that the user wrote himself."""

from __future__ import annotations

import pytest

from monitor_core.kernel.tables import ONE, TORQUE
from monitor_core.modeling.elimination import eliminate
from tests.core.modeling.modelica.texts import INTERFACES, drive, flat
from tests.core.modeling.modelica.transfer import PRIME, responses

VALUES = {"motor.J": 5, "load.J": 3, "load.c": 11, "load.d": 2, "g": 4, "tau0": 6}
S = 7


def inverse(number: int) -> int:
    return pow(number, -1, PRIME)


@pytest.mark.parametrize(
    ("inside", "impedance"),
    [
        ("Real w; equation w = der(flange.phi); J*der(w) = flange.tau;", 3 * S * S),
        ("equation J*der(der(flange.phi)) = flange.tau;", 3 * S * S),
        ("equation J*der(der(flange.phi - 4) + 5) = flange.tau;", 3 * S * S),
        ("Modelica.Units.SI.AngularVelocity w = der(flange.phi); equation flange.tau = J*der(w);", 3 * S * S),
        ("equation flange.tau = c*flange.phi + d*der(flange.phi);", 11 + 2 * S),
        ("equation flange.tau - d*der(flange.phi) = flange.phi*c;", 11 + 2 * S),
        ("equation flange.tau/c = flange.phi + der(d*flange.phi)/c;", 11 + 2 * S),
        ("Real x = 2*(flange.phi - 1); equation flange.tau = c*x/2 + c;", 11),
        ("protected Real x; equation 0 = x - c^2*flange.phi; flange.tau = x/c;", 11),
        ("Real x(start = 1, fixed = true); initial equation x = 0; equation x = c*flange.phi; flange.tau = x;", 11),
    ],
)  # fmt: skip
def test_a_load_of_ones_own(inside: str, impedance: int) -> None:
    parameters = "parameter Real J = 1; parameter Real c = 1; parameter Real d = 1;"
    load = f"model Load {parameters} {INTERFACES}.Flange_a flange; {inside} end Load; "
    model = flat(drive("Load load;", "connect(load.flange, motor.flange_b);", load), "D")
    expected = S * inverse(5 * S * S + impedance) % PRIME
    assert responses(model, VALUES.__getitem__, S) == {("speed", 0): {TORQUE: expected}}


def test_a_compliance_from_the_librarys_base_class() -> None:
    own = f"""model Rubber extends {INTERFACES}.PartialCompliantWithRelativeStates;
      parameter Real c = 1; parameter Real d = 1; equation tau = c*phi_rel + d*w_rel; end Rubber; """
    library = "Modelica.Mechanics.Rotational.Components.SpringDamper load(c = 1, d = 1);"
    arm = "Modelica.Mechanics.Rotational.Components.Inertia arm(J = 1);"
    joints = "connect(motor.flange_b, load.flange_a); connect(load.flange_b, arm.flange_a);"
    values = {**VALUES, "arm.J": 13}
    found = [
        responses(flat(drive(spring + arm, joints, before), "D"), values.__getitem__, S)
        for spring, before in (("Rubber load;", own), (library, ""))
    ]
    assert found[0] == found[1] != {}


def test_variables_of_library_components_can_be_used() -> None:
    """A spring to ground written on the motor's angle, and a constant torque."""
    equations = "motor.flange_a.tau + motor.flange_b.tau = motor.J*motor.a + 0*motor.w;"
    text = drive("parameter Real g = 1; Real twice; Real speed;",
                 "twice = g*motor.phi + torque.tau; speed = 2*motor.w + encoder.w;")  # fmt: skip
    names = {v.name for v in flat(text).variables}
    assert {"twice", "speed"} <= names
    with pytest.raises(Exception, match="too many"):
        flat(drive("", equations))


@pytest.mark.parametrize(
    ("declaration", "units"),
    [
        ("Real x = der(motor.phi);", {"x": "rad/s"}),
        ("Real x = der(y)/2; Real y = der(motor.phi);", {"x": "rad/s^2", "y": "rad/s"}),
        ("Real x = c*y; Real y = motor.phi - 1; parameter Modelica.Units.SI.RotationalSpringConstant c = 1;",
         {"x": "N m", "y": "rad"}),
        ('Real x(unit = "1/s") = der(motor.phi);', {"x": "rad/s"}),
        ('Real x(unit = "1") = motor.w;', {"x": ""}),  # said wrongly, and not minded
        ('Real x(unit = "m") = r*motor.phi; parameter Real r = 1;', {"x": ""}),
        ("Real x = torque.tau + 2*motor.phi;", {"x": ""}),  # 2 may have a unit
    ],
)  # fmt: skip
def test_units_of_variables_are_found(declaration: str, units: dict[str, str]) -> None:
    found = {v.name: v.unit for v in flat(drive(declaration)).variables}
    assert {name: found[name] for name in units} == units


def test_units_of_parameters_are_found() -> None:
    text = drive(
        'Real x = c*motor.phi + d*motor.w; Real y(unit = "N.m") = x; parameter Real c = 1; parameter Real d = 2;'
    )
    assert {p.name: p.unit for p in flat(text).parameters if p.name in "cd"} == {
        "c": "N m/rad",
        "d": "N m s/rad",
    }


def test_constant_terms() -> None:
    load = f"""model Load parameter Real tau0 = 1; {INTERFACES}.Flange_a flange;
      equation flange.tau = 2 - tau0; end Load; """
    model = flat(drive("Load load;", "connect(load.flange, motor.flange_b);", load), "D")
    assert [(i.name, i.kind) for i in model.inputs] == [("torque.tau", TORQUE), ("1", ONE)]
    got = responses(model, {"motor.J": 5, "load.tau0": 6}.__getitem__, S)
    assert got == {("speed", 0): {TORQUE: inverse(5 * S), ONE: (6 - 2) * inverse(5 * S) % PRIME}}


def test_the_elimination_takes_them() -> None:
    """An inertia written by hand has a state as the library's has."""
    load = f"""model Load parameter Real J = 1; parameter Real c = 1; parameter Real d = 1;
      {INTERFACES}.Flange_a flange; Real phi; Real w;
      equation w = der(phi); J*der(w) = flange.tau; flange.tau = c*(flange.phi - phi) + d*(der(flange.phi) - w);
      end Load; """
    model = flat(drive("Load load;", "connect(load.flange, motor.flange_b);", load), "D")
    assert len(eliminate(model).states) == 3
