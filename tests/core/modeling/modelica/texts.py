"""Modelica texts for tests: a small drive with room for more, and random drives written out."""

from __future__ import annotations

import itertools
from functools import cache

from monitor_core.modeling.flat import FlatModel
from monitor_core.modeling.modelica import Source, read
from tests.core.modeling.random_drives import RandomDrive

ROTATIONAL = "Modelica.Mechanics.Rotational"
COMPONENTS, INTERFACES = f"{ROTATIONAL}.Components", f"{ROTATIONAL}.Interfaces"


def drive(declarations: str = "", equations: str = "", before: str = "", motor: str = "J = 1") -> str:
    """A motor with torque and encoder: model D.  Lines: ``declarations`` at 5, ``equations`` at 9, if each is one.

    ``before`` stands on line 1, in front of the model.
    """
    return f"""{before}model D
  {ROTATIONAL}.Sources.Torque torque;
  {COMPONENTS}.Inertia motor({motor});
  {ROTATIONAL}.Sensors.SpeedSensor encoder;
  {declarations}
equation
  connect(torque.flange, motor.flange_a);
  connect(encoder.flange, motor.flange_b);
  {equations}
end D;
"""


@cache
def flat(text: str, model: str | None = None) -> FlatModel:
    return read([Source("d.mo", text)], model)


def values(model: FlatModel) -> dict[str, float | None]:
    return {p.name: p.value for p in model.parameters}


# --- random drives ---------------------------------------------------------------------------------------

_CLASS = {
    "inertia": "Inertia",
    "spring": "Spring",
    "damper": "Damper",
    "spring-damper": "SpringDamper",
    "ideal-gear": "IdealGear",
    "viscous-friction": "BearingFriction",
}
_SENSOR = {"speed-sensor": "SpeedSensor", "angle-sensor": "AngleSensor"}


def written(random: RandomDrive) -> str:
    """The random drive as a model; every parameter "c3.J" is the model's own c3_J."""
    declared = [f"parameter Real {name.replace('.', '_')} = {float(v)};" for name, v in random.exact.items()]
    joints, at = list[str](), dict[str, list[str]]()
    for part in random.parts:
        lines, ends, more = _part(part)
        declared += lines
        joints += more
        for node, end in ends:
            at.setdefault(node, []).append(end)
    if "ground" in at:
        declared.append(f"{COMPONENTS}.Fixed ground;")
        at["ground"].insert(0, "ground.flange")
    joints += [f"connect({a}, {b});" for ends in at.values() for a, b in itertools.pairwise(ends)]
    return "\n".join(["model Whole", *declared, "equation", *joints, "end Whole;"])


def _part(part: dict[str, object]) -> tuple[list[str], list[tuple[str, str]], list[str]]:
    """Declarations, (node, flange) and equations."""
    kind, name = str(part["type"]), str(part["name"])
    nodes: list[str] = list(part["at"])  # type: ignore[call-overload]
    roles = [role for role in part if role not in ("type", "name", "at")]
    if kind == "torque":
        gain = f"Modelica.Blocks.Math.Gain {name}_gain(k = {name}_kT);"
        source = f"Modelica.Blocks.Sources.Step {name}_step(height = 2, startTime = 0.1);"
        torque = f"{ROTATIONAL}.Sources.Torque {name};"
        joints = [f"connect({name}_step.y, {name}_gain.u);", f"connect({name}_gain.y, {name}.tau);"]
        return [gain, source, torque], [(nodes[0], f"{name}.flange")], joints
    if kind in _SENSOR:
        return [f"{ROTATIONAL}.Sensors.{_SENSOR[kind]} {name};"], [(nodes[0], f"{name}.flange")], []
    inside = ", ".join(f"{role} = {name}_{role}" for role in roles)
    if kind == "viscous-friction":
        inside = f"tau_pos = [0, 0; 2, 2*{name}_d]"
    ends = [(node, f"{name}.flange_{which}") for node, which in zip(nodes, "ab", strict=False)]
    return [f"{COMPONENTS}.{_CLASS[kind]} {name}({inside});"], ends, []


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


NESTED = """
package Lib
  constant Real two = 2;
  type Mass = Real(unit = "kg.m2");
  partial model Shaft extends Modelica.Mechanics.Rotational.Interfaces.PartialTwoFlanges; end Shaft;
  model Arm
    extends Shaft; import R = Modelica.Mechanics.Rotational.Components;
    parameter Mass J = two/4; parameter Real k = 10; parameter Boolean loaded = true;
    R.Inertia mass(J = J); R.SpringDamper spring(c = 2*k^2/k, d = 0.1); R.Inertia load(J = J);
  equation
    connect(flange_a, spring.flange_a); connect(spring.flange_b, mass.flange_a);
    connect(mass.flange_b, flange_b); connect(mass.flange_b, load.flange_a);
  end Arm;
  model Drive
    Arm first(J = 3, spring(c = 5)); Arm second(k = stiffness, loaded = false); parameter Real stiffness = 7;
    Modelica.Mechanics.Rotational.Sources.Torque torque; Modelica.Mechanics.Rotational.Sensors.AngleSensor s;
    Modelica.Blocks.Math.Gain gain(k = two); input Real u; Real twice = 2*der(s.phi);
  equation
    connect(torque.flange, first.flange_a); connect(first.flange_b, second.flange_a); gain.u = u;
    connect(gain.y, torque.tau); connect(s.flange, first.flange_a);
  end Drive;
end Lib;
"""
