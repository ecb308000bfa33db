"""The drive that is drawn in several ways: in Python, and as tables of a configuration file."""

from __future__ import annotations

from typing import Any

from monitor_core.modeling.drawing import Drawing, Inertia, SpeedSensor, SpringDamper, Torque, ViscousFriction

TABLES: list[dict[str, Any]] = [
    {"type": "torque", "name": "torque", "at": "shaft", "kT": "kT"},
    {"type": "inertia", "name": "motor", "at": ["shaft"], "J": "Jm"},
    {"type": "viscous-friction", "name": "bearing", "at": "shaft", "d": "fm"},
    {"type": "spring-damper", "name": "belt", "at": ["shaft", "load"], "c": "k", "d": "d"},
    {"type": "inertia", "name": "arm", "at": "load", "J": "Ja"},
    {"type": "speed-sensor", "name": "encoder", "at": "shaft"},
]


def two_mass(**nominal: float) -> Drawing:
    return Drawing(
        "two-mass",
        [
            Torque("torque", "shaft", kT="kT"),
            Inertia("motor", "shaft", J="Jm"),
            ViscousFriction("bearing", "shaft", d="fm"),
            SpringDamper("belt", "shaft", "load", c="k", d="d"),
            Inertia("arm", "load", J="Ja"),
            SpeedSensor("encoder", "shaft"),
        ],
        nominal,
    )
