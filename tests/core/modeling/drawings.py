"""The drive that is drawn in several ways: in Python, and as tables of a configuration file."""

from __future__ import annotations

from typing import Any

from monitor_core.modeling.drawing import Drawing, part

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
            part("torque", "torque", "shaft", kT="kT"),
            part("inertia", "motor", "shaft", J="Jm"),
            part("viscous-friction", "bearing", "shaft", d="fm"),
            part("spring-damper", "belt", "shaft", "load", c="k", d="d"),
            part("inertia", "arm", "load", J="Ja"),
            part("speed-sensor", "encoder", "shaft"),
        ],
        nominal,
    )
