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
