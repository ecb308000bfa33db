"""Drawings as OpenModelica's editor writes them, from text to the flat model: parameters, signals, components."""

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
    assert [(s.name, s.angle, s.quantity) for s in flat.sensors] == [("encoder", "encoder.flange.phi", "speed")]
    assert {v.name for v in flat.variables if v.prefer} == {"motor.phi", "arm.phi"}


TEXT = """
model Gearbox
  Modelica.Mechanics.Rotational.Interfaces.Flange_a left;
  Modelica.Mechanics.Rotational.Interfaces.Flange_b right;
  Modelica.Mechanics.Rotational.Components.IdealGear gear(ratio = 1 / r);
  Modelica.Mechanics.Rotational.Components.Spring spring(c = k);
  parameter Real r(unit = "1");
  parameter Modelica.Units.SI.RotationalSpringConstant k;
equation
  connect(left, gear.flange_a);
  connect(spring.flange_b, right);
  connect(gear.flange_b, spring.flange_a);
end Gearbox;
model Axis
  parameter Modelica.Units.SI.Inertia Jm;
  parameter Modelica.Units.SI.Inertia Ja;
  parameter Real r(unit = "1");
  parameter Modelica.Units.SI.RotationalSpringConstant k;
  Modelica.Blocks.Interfaces.RealInput tau(unit = "N.m");
  Modelica.Mechanics.Rotational.Sources.Torque drive;
  Modelica.Mechanics.Rotational.Components.Inertia rotor(J = Jm);
  Modelica.Mechanics.Rotational.Components.Inertia arm(J = Ja + Jm);
  Modelica.Mechanics.Rotational.Sensors.AngleSensor encoder;
  Gearbox box(r = r, k = k);
equation
  connect(tau, drive.tau);
  connect(drive.flange, rotor.flange_a);
  connect(box.left, encoder.flange);
  connect(rotor.flange_b, encoder.flange);
  connect(box.right, arm.flange_a);
end Axis;
"""


def test_flanges_that_are_connected_in_any_way_are_one_node_also_into_a_model_that_holds_components() -> None:
    found = {c.name: c for c in read([Source("axis.mo", TEXT)], "Axis").components}
    motor, gear, arm = found["rotor"].nodes[1], found["box.gear"].nodes, found["arm"].nodes[0]
    assert found["drive"].nodes == (found["rotor"].nodes[0],)
    assert found["encoder"].nodes == (motor,)
    assert found["box.spring"].nodes == (gear[1], arm)
    assert gear[0] == motor
    assert len({motor, found["rotor"].nodes[0], gear[1], arm, found["arm"].nodes[1]}) == 5
    assert {name: c.kind for name, c in found.items()} == {
        "drive": "torque",
        "rotor": "inertia",
        "arm": "inertia",
        "encoder": "angle-sensor",
        "box.gear": "ideal-gear",
        "box.spring": "spring",
    }
    assert {role: value.names for role, value in found["arm"].parameters.items()} == {"J": {"Ja", "Jm"}}
