"""A drive of any number of masses as a Modelica text."""

ROTATIONAL = "Modelica.Mechanics.Rotational"


def chain_text(masses: int) -> str:
    """A motor and, behind a gear, a row of masses on springs and dampers: model Chain, every parameter with a value."""
    behind = range(1, masses)
    first = [
        "  parameter Real J0 = 0.01;",
        "  parameter Real f = 0.05;",
        "  parameter Real r = 0.01;",
        f"  {ROTATIONAL}.Sources.Torque torque;",
        f"  {ROTATIONAL}.Components.Inertia mass0(J = J0);",
        f"  {ROTATIONAL}.Components.Damper bearing(d = f);",
        f"  {ROTATIONAL}.Components.Fixed ground;",
        f"  {ROTATIONAL}.Components.IdealGear gear(ratio = 1/r);",
        f"  {ROTATIONAL}.Sensors.SpeedSensor encoder;",
    ]
    joints = [
        "  connect(torque.flange, mass0.flange_a);",
        "  connect(encoder.flange, mass0.flange_a);",
        "  connect(bearing.flange_a, mass0.flange_a);",
        "  connect(bearing.flange_b, ground.flange);",
        "  connect(mass0.flange_b, gear.flange_a);",
    ]
    declared = [line for i in behind for line in _link(i)]
    joined = [line for i in behind for line in _joints(i)]
    return "\n".join(["model Chain", *first, *declared, "equation", *joints, *joined, "end Chain;", ""])


def geared_text(masses: int) -> str:
    """A motor and masses that gears join rigidly, each with its own ratio: model Chain."""
    text = chain_text(masses)
    for i in range(1, masses):
        gear = f"{ROTATIONAL}.Components.IdealGear spring{i}(ratio = n{i});"
        text = text.replace(f"{ROTATIONAL}.Components.SpringDamper spring{i}(c = k{i}, d = d{i});", gear)
        text = text.replace(f"parameter Real k{i} = ", f"parameter Real n{i} = 0.00001*")
    return text


def _link(i: int) -> list[str]:
    return [
        f"  parameter Real J{i} = {20 + i};",
        f"  parameter Real k{i} = {1000 * (200 + i)};",
        f"  parameter Real d{i} = {500 + i};",
        f"  {ROTATIONAL}.Components.SpringDamper spring{i}(c = k{i}, d = d{i});",
        f"  {ROTATIONAL}.Components.Inertia mass{i}(J = J{i});",
    ]


def _joints(i: int) -> list[str]:
    before = "gear" if i == 1 else f"mass{i - 1}"
    return [
        f"  connect({before}.flange_b, spring{i}.flange_a);",
        f"  connect(spring{i}.flange_b, mass{i}.flange_a);",
    ]
