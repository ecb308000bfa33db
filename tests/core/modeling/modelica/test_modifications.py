"""Modifications: nested, of base classes, and which of several counts."""

from __future__ import annotations

import pytest

from tests.core.modeling.modelica.texts import COMPONENTS, INTERFACES, drive, flat, values

ARM = f"""
model Arm
  extends {INTERFACES}.PartialTwoFlanges;
  parameter Real J = 5;
  {COMPONENTS}.Inertia mass(J = J);
  {COMPONENTS}.SpringDamper spring(c = 10, d = 0.5);
equation
  connect(flange_a, spring.flange_a);
  connect(spring.flange_b, mass.flange_a);
  connect(mass.flange_b, flange_b);
end Arm;
model Robot
  parameter Real k = 100;
  Arm first;
  Arm second(J = 6, spring(c = k));
equation
  connect(first.flange_b, second.flange_a);
end Robot;
"""


def loaded(component: str, more: str = "") -> dict[str, float | None]:
    """The values with a component called load; motor.J left out."""
    found = values(flat(f"{ARM}{more}\n" + drive(f"{component};"), "D"))
    return {name: value for name, value in found.items() if name != "motor.J"}


def arm(J: float = 5, c: float = 10, d: float = 0.5) -> dict[str, float | None]:
    return {"load.J": J, "load.spring.c": c, "load.spring.d": d}


@pytest.mark.parametrize(
    ("component", "more", "expected"),
    [
        ("Arm load", "", arm()),
        ("Arm load(J = 7)", "", arm(J=7)),
        ("Arm load(spring(c = 20, d = 1))", "", arm(c=20, d=1)),
        ("Arm load(spring.c = 20, spring(d = 1))", "", arm(c=20, d=1)),
        ("Arm load(spring(c(min = 0, displayUnit = \"N.m/deg\") = 20))", "", arm(c=20)),
        ("Stiff load", "model Stiff = Arm(spring(c = 30)) \"short class\";", arm(c=30)),
        ("Stiff load(spring(c = 40))", "model Stiff = Arm(spring(c = 30, d = 2));", arm(c=40, d=2)),
        ("Stiff load", "model Stiff extends Arm(spring(c = 30), J = 8); end Stiff;", arm(J=8, c=30)),
        ("Stiff load(J = 9)", "model Stiff extends Arm(spring(c = 30), J = 8); end Stiff;", arm(J=9, c=30)),
        ("Stiffer load", "model Stiff extends Arm(spring(c = 30, d = 3)); end Stiff;"
                         "model Stiffer extends Stiff(spring(c = 50)); end Stiffer;", arm(c=50, d=3)),
        ("Own load", "model Own parameter Real k = 60; extends Arm(spring(c = k)); end Own;",
         {"load.k": 60, "load.J": 5, "load.spring.d": 0.5}),
        ("Robot load(second.spring.c = 3, first.J = 4)", "",
         {"load.first.J": 4, "load.first.spring.c": 10, "load.first.spring.d": 0.5,
          "load.second.J": 6, "load.second.spring.c": 3, "load.second.spring.d": 0.5}),
        ("Robot load(k = 1, second.spring(d = 2), first(J = 3))", "",
         {"load.k": 1, "load.first.J": 3, "load.first.spring.c": 10, "load.first.spring.d": 0.5,
          "load.second.J": 6, "load.second.spring.d": 2}),
        ("Arm load(mass(J = 11))", "", {"load.mass.J": 11, "load.spring.c": 10, "load.spring.d": 0.5}),
    ],
)  # fmt: skip
def test_the_outer_one_counts(component: str, more: str, expected: dict[str, float | None]) -> None:
    assert loaded(component, more) == expected


def test_values_are_looked_up_where_they_are_written() -> None:
    """J = J: the inner one is the component's, the outer one the model's."""
    text = ARM + drive("parameter Real J = 12; Arm load(J = J);")
    assert values(flat(text, "D")) == {"motor.J": 1, "J": 12, "load.spring.c": 10, "load.spring.d": 0.5}


@pytest.mark.parametrize(
    "motor",
    [
        "J = 1, phi(fixed = true, start = 0), w(start = 0, fixed = true)",
        "J = 1, a.start = 0, stateSelect = StateSelect.always",
        "J(start = 2, min = 0, max = 3, nominal = 1, quantity = \"Inertia\") = 1",
        "J = 1, phi(displayUnit = \"deg\", stateSelect = StateSelect.avoid)",
        "final J = 1, each phi(each start = 0)",
        "J = 1, flange_a(phi(start = 0, nominal = 1))",
    ],
)  # fmt: skip
def test_attributes_do_not_matter(motor: str) -> None:
    with_attributes, without = flat(drive(motor=motor)), flat(drive(motor="J = 1"))
    assert [e.terms.keys() for e in with_attributes.equations] == [e.terms.keys() for e in without.equations]


@pytest.mark.parametrize(
    "component",
    [
        "Spring s(c = 1, phi_rel0 = 0.1)",
        "SpringDamper s(c = 1, d = 1, phi_rel0 = 0.1, phi_nominal = 1e-4, useHeatPort = false)",
        "Damper s(d = 1, stateSelect = StateSelect.prefer)",
        "IdealGear s(ratio = 2, useSupport = false)",
        "BearingFriction s(tau_pos = [0, 1; 1, 2], peak = 1, useHeatPort = false)",
    ],
)
def test_settings_without_effect_are_accepted(component: str) -> None:
    flat(drive(f"{COMPONENTS}.{component};"))
