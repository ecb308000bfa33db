"""Bearing friction: the line through two points of a table is Coulomb friction and a viscous part."""

from __future__ import annotations

import pytest

from monitor_core.kernel.tables import COULOMB
from monitor_core.modeling.laurent import Laurent
from tests.core.modeling.modelica.texts import COMPONENTS, drive, flat, values
from tests.core.modeling.modelica.transfer import PRIME, responses

P, N = Laurent.symbol, Laurent.number
PARAMETERS = "parameter Real fc = 0.3; parameter Real fm = 0.02; parameter Real wn = 50;"


def friction(table: str) -> dict[str, Laurent]:
    text = drive(f"{PARAMETERS} {COMPONENTS}.BearingFriction bearing(tau_pos = {table});",
                 "connect(bearing.flange_a, motor.flange_b);")  # fmt: skip
    roles = {("bearing.coulomb.direction", 0): "fc", ("bearing.w", 0): "d"}
    laws = [e.terms for e in flat(text).equations if any(name.endswith("flange.tau") for name, _ in e.terms)]
    return {role: -law[symbol] for law in laws for symbol, role in roles.items() if symbol in law}


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("[0, fc; 1, fc + fm]", {"fc": P("fc"), "d": P("fm")}),
        ("{{0, fc}, {1, fc + fm}}", {"fc": P("fc"), "d": P("fm")}),
        ("[0, 0; 1, fm]", {"d": P("fm")}),
        ("[0, 0; 50, 50*fm]", {"d": P("fm")}),
        ("[0, fc; wn, fc + fm*wn]", {"fc": P("fc"), "d": P("fm")}),
        ("[1, fc; 2, fc + fm]", {"fc": P("fc") - P("fm"), "d": P("fm")}),
        ("[0, fc]", {"fc": P("fc")}),
        ("{{0, fc}}", {"fc": P("fc")}),
        ("[0, fc; 100, fc]", {"fc": P("fc")}),
        ("[0, 0.3; 10, 0.5]", {"fc": P("bearing.fc"), "d": P("bearing.d")}),
    ],
)
def test_slope_and_intercept(table: str, expected: dict[str, Laurent]) -> None:
    assert friction(table) == expected


def test_numbers_in_the_table_are_parameters() -> None:
    text = drive(f"{COMPONENTS}.BearingFriction bearing(tau_pos = [0, 0.3; 10, 0.5]);",
                 "connect(bearing.flange_a, motor.flange_b);")  # fmt: skip
    model = flat(text)
    assert values(model) == {"motor.J": 1, "bearing.d": pytest.approx(0.02), "bearing.fc": 0.3}
    assert {p.name: (p.unit, p.meaning) for p in model.parameters if p.name != "motor.J"} == {
        "bearing.d": ("N m s/rad", "viscous friction of the bearing"),
        "bearing.fc": ("N m", "Coulomb friction of the bearing"),
    }


@pytest.mark.parametrize(
    ("table", "units"),
    [
        ("[0, fc; 1, fc + fm]", {"fc": "N m", "fm": "N m s/rad"}),
        ("[0, 0; wn, fm*wn]", {"fm": "N m s/rad"}),
        ("[0, fc; 10, tau10]", {"fc": "N m", "tau10": "N m"}),
        ("[0, 0; 1, tau10]", {"tau10": "N m"}),
    ],
)
def test_units_of_what_stands_in_the_table(table: str, units: dict[str, str]) -> None:
    more = "parameter Modelica.Units.SI.Torque tau10 = 1;"
    text = drive(f"{PARAMETERS} {more} {COMPONENTS}.BearingFriction bearing(tau_pos = {table});")
    assert {p.name: p.unit for p in flat(text).parameters if p.name != "motor.J"} == units


def test_it_acts_between_shaft_and_ground_in_line_with_the_shaft() -> None:
    """J w' = u - fc sign(w) - fm w with the bearing between two inertias, J = J1 + J2."""
    bearing = f"{COMPONENTS}.BearingFriction bearing(tau_pos = [0, 5; 1, 8]); {COMPONENTS}.Inertia arm(J = 2);"
    joints = "connect(motor.flange_b, bearing.flange_a); connect(bearing.flange_b, arm.flange_a);"
    model = flat(drive(bearing, joints))
    s = 1234567
    got = responses(model, lambda name: {"motor.J": 1, "arm.J": 2, "bearing.d": 3, "bearing.fc": 5}[name], s)
    denominator = pow(3 * s + 3, -1, PRIME)
    assert got == {("speed", 0): {0: denominator, COULOMB: -5 * denominator % PRIME}}
    assert next(i.angle for i in model.inputs if i.kind == COULOMB) == "bearing.coulomb.flange.phi"
