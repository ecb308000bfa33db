"""A drive drawn in Python: components at named nodes; those at the same node are connected there.

two_mass = Drawing("two-mass", [
    Torque("torque", "shaft", kT="kT"),
    Inertia("motor", "shaft", J="Jm"),
    ViscousFriction("bearing", "shaft", d="fm"),
    SpringDamper("belt", "shaft", "load", c="k", d="d"),
    Inertia("arm", "load", J="Ja"),
    SpeedSensor("encoder", "shaft"),
])
flat = two_mass.flat()
"""

from monitor_core.modeling.drawing.drawn_components import (
    AngleSensor,
    CoulombFriction,
    Damper,
    Fixed,
    Gravity,
    IdealGear,
    Inertia,
    Part,
    SpeedSensor,
    Spring,
    SpringDamper,
    Torque,
    TorqueOffset,
    Value,
    ViscousFriction,
)
from monitor_core.modeling.drawing.netlist import Drawing, from_tables

__all__ = [
    "AngleSensor",
    "CoulombFriction",
    "Damper",
    "Drawing",
    "Fixed",
    "Gravity",
    "IdealGear",
    "Inertia",
    "Part",
    "SpeedSensor",
    "Spring",
    "SpringDamper",
    "Torque",
    "TorqueOffset",
    "Value",
    "ViscousFriction",
    "from_tables",
]
