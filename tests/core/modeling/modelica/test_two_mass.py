"""A drawing as OpenModelica's editor writes it, from text to flat equations."""

from __future__ import annotations

from monitor_core.kernel.tables import COULOMB, TORQUE
from monitor_core.modeling.flat import Origin
from monitor_core.modeling.modelica import Source, read

TWO_MASS = """within ;
model TwoMass "motor and arm"
  extends Modelica.Icons.Example;
  import SI = Modelica.Units.SI;
  parameter SI.Inertia Jm = 5e-3 "inertia of the motor" annotation(Dialog(group = "motor"));
  parameter Real fm(unit = "N.m.s/rad") = 0.002;
  parameter Real fc = 0.3;
  Modelica.Mechanics.Rotational.Sources.Torque torque annotation(
    Placement(visible = true, transformation(origin = {-50, 0}, extent = {{-10, -10}, {10, 10}}, rotation = 0)));
  Modelica.Mechanics.Rotational.Components.Inertia motor(J = Jm, phi(fixed = true, start = 0), w.start = 0) annotation(
    Placement(visible = true, transformation(origin = {-10, 0}, extent = {{-10, -10}, {10, 10}}, rotation = 0)));
  Modelica.Mechanics.Rotational.Components.BearingFriction bearing(tau_pos = [0, fc; 1, fc + fm], useSupport = false);
  Modelica.Mechanics.Rotational.Components.SpringDamper belt(c(displayUnit = "N.m/deg") = 100, d = 0.1) "toothed belt";
  Modelica.Mechanics.Rotational.Components.Inertia arm(J = 1/2, stateSelect = StateSelect.prefer);
  Modelica.Mechanics.Rotational.Sensors.SpeedSensor encoder;
  Modelica.Blocks.Interfaces.RealInput u annotation(Placement(iconTransformation(extent = {{-1, -1}, {1, 1}})));
  Modelica.Blocks.Interfaces.RealOutput y;
equation
  connect(u, torque.tau) annotation(
    Line(points = {{-90, 0}, {-62, 0}}, color = {0, 0, 127}));
  connect(torque.flange, motor.flange_a);
  connect(motor.flange_b, bearing.flange_a);
  connect(bearing.flange_b, belt.flange_a) annotation(Line(points = {{10, 0}, {20, 0}}));
  connect(belt.flange_b, arm.flange_a);
  connect(encoder.flange, motor.flange_a);
  connect(encoder.w, y);
  annotation(
    uses(Modelica(version = "4.0.0")),
    experiment(StartTime = 0, StopTime = 1, Tolerance = 1e-6, Interval = 0.002),
    Documentation(info = "<html>A <b>belt</b> drive; \\"two\\" masses</html>"),
    __OpenModelica_commandLineOptions = "--matchingAlgorithm=PFPlusExt");
end TwoMass;
"""


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
