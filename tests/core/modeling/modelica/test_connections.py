"""Connections: inside and outside, passed through, with connectors of the user's own."""

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
    assert stiffness_of(f"{ARM}; {A} out;", "connect(out, arm.flange_b); connect(arm.flange_a, motor.flange_b);")
