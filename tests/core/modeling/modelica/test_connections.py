"""Connections: inside and outside, passed through, switched off, with connectors of the user's own."""

from __future__ import annotations

import pytest

from tests.core.modeling.modelica.texts import COMPONENTS, INTERFACES, drive, flat
from tests.core.modeling.modelica.transfer import PRIME, responses

A, B = f"{INTERFACES}.Flange_a", f"{INTERFACES}.Flange_b"
ARM = f"{COMPONENTS}.Inertia arm(J = 3)"


def stiffness_of(declarations: str, equations: str, before: str = "", expected: int = 8) -> bool:
    """Whether the motor (J = 5) and what is joined to it turn as one inertia of ``expected``."""
    model = flat(drive(declarations, equations, before), "D")
    got = responses(model, lambda name: 5 if name == "motor.J" else 3, s=7)
    return got == {("speed", 0): {0: pow(expected * 7, -1, PRIME)}}


@pytest.mark.parametrize(
    ("inside", "joint"),
    [
        ("", "connect(motor.flange_b, arm.flange_a);"),
        ("", "connect(arm.flange_b, motor.flange_b);"),
        ("", "connect(arm.flange_b, motor.flange_b); connect(motor.flange_b, arm.flange_b);"),
        ("", "connect(arm.flange_b, torque.flange);"),
        # both flanges of the sub-model are one shaft
        ("connect(flange_a, flange_b);",
         "connect(s.flange_a, motor.flange_b); connect(s.flange_b, arm.flange_a);"),
        # equations instead of connections
        ("flange_a.phi = flange_b.phi; flange_a.tau + flange_b.tau = 0;",
         "connect(s.flange_a, motor.flange_b); connect(s.flange_b, arm.flange_a);"),
    ],
)  # fmt: skip
def test_joined(inside: str, joint: str) -> None:
    shaft = f"model Shaft {A} flange_a; {B} flange_b; equation {inside} end Shaft; "
    used = "Shaft s;" if inside else ""
    assert stiffness_of(f"{ARM}; {used}", joint, shaft if inside else "")


def test_what_is_not_connected_turns_by_itself() -> None:
    assert stiffness_of(f"{ARM};", "", expected=5)


@pytest.mark.parametrize(
    "connector",
    [
        "connector Shaft = Modelica.Mechanics.Rotational.Interfaces.Flange_a;",
        "connector Shaft extends Modelica.Mechanics.Rotational.Interfaces.Flange_a; end Shaft;",
        "connector Shaft Modelica.Units.SI.Angle phi; flow Modelica.Units.SI.Torque tau; end Shaft;",
        "connector Shaft Real phi; flow Real tau; end Shaft;",
    ],
)
def test_connectors_of_ones_own(connector: str) -> None:
    wheel = f"{connector} model Wheel Shaft s; {ARM}; equation connect(s, arm.flange_a); end Wheel; "
    assert stiffness_of("Wheel w;", "connect(w.s, motor.flange_b);", wheel)


def test_the_models_own_flange_is_free() -> None:
    assert stiffness_of(
        f"{ARM}; {A} out;", "connect(out, arm.flange_b); connect(arm.flange_a, motor.flange_b);"
    )


@pytest.mark.parametrize(
    ("declarations", "expected"),
    [
        (f"parameter Boolean loaded = true; {ARM} if loaded;", 8),
        (f"parameter Boolean loaded = false; {ARM} if loaded;", 5),
        (f"{ARM} if not loaded; parameter Boolean loaded = false;", 8),
        (f"parameter Integer n = 2; {ARM} if n > 1;", 8),
        (f"parameter Integer n = 2; {ARM} if n <= 1 or n == 3;", 5),
        (f"parameter Integer n = 2; {ARM} if n <> 1 and n >= 2 and n < 3;", 8),
        (f"constant Boolean a = b; constant Boolean b = not false; {ARM} if a;", 8),
    ],
)
def test_components_under_a_condition(declarations: str, expected: int) -> None:
    assert stiffness_of(declarations, "connect(motor.flange_b, arm.flange_a);", expected=expected)


def test_a_condition_may_come_from_outside() -> None:
    wheel = f"""model Wheel
      extends {INTERFACES}.PartialTwoFlanges; parameter Boolean heavy = false;
      {ARM} if heavy; {COMPONENTS}.Inertia other(J = 3) if not heavy and false;
    equation connect(flange_a, flange_b); connect(flange_a, arm.flange_a); end Wheel; """
    joint = "connect(w.flange_a, motor.flange_b);"
    assert stiffness_of("Wheel w(heavy = true);", joint, wheel)
    assert stiffness_of("Wheel w;", joint, wheel, expected=5)
    assert stiffness_of("parameter Boolean h = true; Wheel w(heavy = h);", joint, wheel)


def test_nodes_for_pictures() -> None:
    model = flat(
        drive(f"{COMPONENTS}.Damper d(d = 1); {COMPONENTS}.Fixed g;",
              "connect(d.flange_a, motor.flange_b); connect(g.flange, d.flange_b);")
    )  # fmt: skip
    nodes = {c.name: c.nodes for c in model.components}
    assert nodes["d"] == (nodes["motor"][1], "ground")
    assert nodes["torque"] == (nodes["motor"][0],)
    assert nodes["motor"][0] != nodes["motor"][1] == nodes["encoder"][0]
    assert nodes["g"] == ("ground",)
