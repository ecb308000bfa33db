"""Findings about a record."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["refuse", "warn"]
Kind = Literal[
    "too-short", "constant-torque", "saturated", "stuck", "exchanged", "wrong-sign", "units",
    "gaps", "lost", "jitter", "outliers", "missing", "absurd",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault found in a record: ``sentence`` for the user, ``number`` that shows it, in the unit of the sentence."""

    kind: Kind
    severity: Severity
    sentence: str
    number: float
