"""Modelica texts for tests: a small drive with room for more, and random drives written out, flat or nested."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from fractions import Fraction
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


def written(random: RandomDrive, groups: Sequence[int] = ()) -> str:
    """The random drive as a model; with ``groups``, the k-th part is inside of the sub-model of that number.

    Every parameter "c3.J" is the model's own c3_J.
    """
    if not groups:
        return _model("Whole", random, range(len(random.parts)), _parameters(random) + _values(random), "")
    chosen = {g: [k for k, other in enumerate(groups) if other == g] for g in sorted(set(groups))}
    models = [_model(f"G{g}", random, ks, _parameters(random, ks), "n") for g, ks in chosen.items()]
    subs = [f"G{g} g{g}({', '.join(f'{n} = {n}' for n in _names(random, ks))});" for g, ks in chosen.items()]
    return "\n".join([*models, _whole(random, chosen, subs)])


def _whole(random: RandomDrive, chosen: dict[int, list[int]], subs: Iterable[str]) -> str:
    lines = [f"parameter Real {name} = {float(v)};" for name, v in _exact(random).items()]
    at: dict[str, list[str]] = {}
    for g, ks in chosen.items():
        for node in _nodes(random, ks):
            at.setdefault(node, []).append(f"g{g}.f_{node}")
    joints = [f"connect({a}, {b});" for ends in at.values() for a, b in itertools.pairwise(ends)]
    return "\n".join(["model Whole", *lines, *subs, "equation", *joints, "end Whole;"])


def _exact(random: RandomDrive) -> dict[str, Fraction]:
    return {name.replace(".", "_"): value for name, value in random.exact.items()}


def _names(random: RandomDrive, ks: Iterable[int]) -> list[str]:
    names = {str(random.parts[k]["name"]) for k in ks}
    return [name.replace(".", "_") for name in random.exact if name.split(".")[0] in names]


def _parameters(random: RandomDrive, ks: Iterable[int] = ()) -> list[str]:
    return [f"parameter Real {name};" for name in _names(random, ks)]


def _values(random: RandomDrive) -> list[str]:
    return [f"parameter Real {name} = {float(v)};" for name, v in _exact(random).items()]


def _nodes(random: RandomDrive, ks: Iterable[int]) -> list[str]:
    nodes = [n for k in ks for n in random.parts[k]["at"]]  # type: ignore[attr-defined]
    return [n for n in dict.fromkeys(nodes) if n != "ground"]


def _model(name: str, random: RandomDrive, ks: Iterable[int], head: list[str], own: str) -> str:
    """``own``: flanges of the model itself, one for each node; else components are connected to each other."""
    ks = list(ks)
    declared, joints = list(head), list[str]()
    declared += [f"{INTERFACES}.Flange_a f_{node};" for node in _nodes(random, ks) if own]
    at: dict[str, list[str]] = {node: [f"f_{node}"] for node in _nodes(random, ks) if own}
    for k in ks:
        lines, ends, more = _part(random.parts[k])
        declared += lines
        joints += more
        for node, end in ends:
            at.setdefault(node, []).append(end)
    if "ground" in at:
        declared.append(f"{COMPONENTS}.Fixed ground;")
        at["ground"].insert(0, "ground.flange")
    joints += [f"connect({a}, {b});" for ends in at.values() for a, b in itertools.pairwise(ends)]
    return "\n".join([f"model {name}", *declared, "equation", *joints, f"end {name};"])


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
