"""Drives of one mass for real axes, and their records through the program's own reader."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from monitor_core.drive.structure import Drive
from monitor_core.modeling.drawing import (
    AngleSensor,
    CoulombFriction,
    Drawing,
    Gravity,
    Inertia,
    Torque,
    TorqueOffset,
    ViscousFriction,
)
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.numbers import drive_of
from service.ingest.identification_records import Loaded, load
from tests.service.ingest.plant import axis1, make_config

GRAVITY = Gravity("weight", "shaft", gc="gc", gs="gs")


def one_mass(*, gravity: bool = False) -> Drive:
    """A mass with friction and an offset; its angle is measured."""
    parts = [
        Torque("motor", "shaft", kT=1.0),
        Inertia("mass", "shaft", J="J"),
        ViscousFriction("bearing", "shaft", d="fv"),
        CoulombFriction("seal", "shaft", fc="fc"),
        TorqueOffset("offset", "shaft", tau0="tau0"),
        AngleSensor("encoder", "shaft"),
    ]
    if gravity:
        parts.append(GRAVITY)
    return drive_of(eliminate(Drawing("one-mass", parts).flat()))


def loaded(path: Path, folder: Path, interval_s: float, columns: Mapping[str, dict[str, Any]]) -> Loaded:
    """The record in a file, by a configuration (made in ``folder``) with these columns: torque, angle, time."""
    axis = axis1(time=columns["time"], sample_interval_s=interval_s, pairing_tolerance_s=0.4 * interval_s)
    for name in ("torque", "angle"):
        axis[name] |= columns[name]
    return load(str(path), make_config(folder, axis), "r.one")
