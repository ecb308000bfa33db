"""One thing that is wrong with a record, and what is known of the axis beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from monitor_core.drive.structure import Drive
from monitor_core.identification.records.rigid_body import antiresonance_s, rigid_inertia

Severity = Literal["refuse", "warn"]
Kind = Literal[
    "too-short", "constant-torque", "saturated", "stuck", "wrong-sign", "units",
    "gaps", "lost", "jitter", "outliers", "missing", "absurd",
]  # fmt: skip

_NOUGHT = 1e-9
"""Of the fastest pole: poles so slow are those of the free rigid motion, which has no time constant."""


@dataclass(frozen=True, slots=True)
class Finding:
    """``sentence`` says it to the user; ``number`` is what shows it, in the unit that the sentence names."""

    kind: Kind
    severity: Severity
    sentence: str
    number: float


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of the axis beside the record; what is not known is not looked at.

    Args:
        parameters: how many are to be found.
        slowest_s: slowest time constant of the drive, s.
        inertia: nominal inertia of the whole drive as the motor feels it, kg m^2: ``rigid_inertia``.
        antiresonance_s: period of its lowest antiresonance, s; faster motions do not show that inertia.
        speed_scale: Coulomb friction is fc tanh(speed / speed_scale), rad/s.
    """

    parameters: int = 0
    slowest_s: float | None = None
    inertia: float | None = None
    antiresonance_s: float | None = None
    speed_scale: float = 1.0


def known_of(drive: Drive, values: Mapping[str, float], parameters: int, speed_scale: float = 1.0) -> Known:
    """What is known of an axis with these nominal values; arguments as of ``Known``.

    Raises:
        KeyError, ValueError: a value is missing or makes no sense.
    """
    poles = np.linalg.eigvals(drive.matrix("A", drive.complete(values)))
    decay = -poles.real
    slow = decay[decay > _NOUGHT * abs(poles).max()]
    slowest = float(1 / slow.min()) if slow.size else None
    inertia, antiresonance = rigid_inertia(drive, values), antiresonance_s(drive, values)
    return Known(parameters, slowest, inertia, antiresonance, speed_scale)
