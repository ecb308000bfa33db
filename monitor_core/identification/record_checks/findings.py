"""What may be wrong with a record, and what is known of the axis beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["refuse", "warn"]
Kind = Literal[
    "too-short", "constant-torque", "saturated", "stuck", "wrong-sign", "units",
    "gaps", "lost", "jitter", "outliers", "missing", "absurd",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Finding:
    """``sentence`` says it to the user; ``number`` is what shows it, in the unit that the sentence names."""

    kind: Kind
    severity: Severity
    sentence: str
    number: float


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of the axis beside the record; what is not known is not checked.

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
