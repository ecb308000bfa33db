"""Drives drawn for tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from monitor_core.modeling.drawing import Drawing, part


def two_mass() -> Drawing:
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
    )


def drawn(parts: Iterable[Mapping[str, Any]], name: str = "random") -> Drawing:
    """The drawing of a random drive's parts; the node "ground" is fixed."""
    components = [
        part(
            p["type"], p["name"], *p["at"], **{k: v for k, v in p.items() if k not in ("type", "name", "at")}
        )
        for p in parts
    ]
    if any("ground" in each.nodes for each in components):
        components.append(part("fixed", "ground", "ground"))
    return Drawing(name, components)
