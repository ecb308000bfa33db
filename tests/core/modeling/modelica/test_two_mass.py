"""A drawing as OpenModelica's editor writes it, from text to flat equations."""

from __future__ import annotations

from monitor_core.kernel.tables import COULOMB, TORQUE
from monitor_core.modeling.flat import Origin
from monitor_core.modeling.modelica import Source, read
from tests.core.modeling.modelica.texts import TWO_MASS


def test_parameters_keep_name_value_unit_meaning_and_place() -> None:
    flat = read([Source("two.mo", TWO_MASS)])
    found = {p.name: (p.value, p.unit, p.meaning, p.positive) for p in flat.parameters}
    assert found == {
        "Jm": (0.005, "kg m^2", "inertia of the motor", True),
        "fm": (0.002, "N m s/rad", "viscous friction of the bearing", False),
        "fc": (0.3, "N m", "Coulomb friction of the bearing", False),
        "belt.c": (100.0, "N m/rad", "stiffness of the belt", True),
        "belt.d": (0.1, "N m s/rad", "damping of the belt", False),
        "arm.J": (0.5, "kg m^2", "inertia of the arm", True),
    }
    assert [p.origin for p in flat.parameters][:2] == [Origin("Jm", "two.mo", 5), Origin("fm", "two.mo", 6)]


def test_inputs_sensors_and_angles() -> None:
    flat = read([Source("two.mo", TWO_MASS)])
    assert flat.name == "TwoMass"
    assert [(i.name, i.kind) for i in flat.inputs] == [("u", TORQUE), ("bearing.coulomb.direction", COULOMB)]
    assert [(s.name, s.angle, s.quantity) for s in flat.sensors] == [
        ("encoder", "encoder.flange.phi", "speed")
    ]
    assert {v.name for v in flat.variables if v.prefer} == {"motor.phi", "arm.phi"}
