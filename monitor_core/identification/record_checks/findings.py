"""Findings about a record."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["refuse", "warn"]
FindingKind = Literal[
    "too-short", "too-slow", "constant-torque", "saturated", "stuck", "still", "exchanged", "unsigned", "wrong-sign",
    "units", "gaps", "lost", "jitter", "outliers", "missing", "absurd",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class RecordFinding:
    """A fault found in a record: ``sentence`` for the user, ``number`` that shows it, in the unit of the sentence."""

    kind: FindingKind
    severity: Severity
    sentence: str
    number: float
