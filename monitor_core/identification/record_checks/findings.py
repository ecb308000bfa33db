"""What may be wrong with a record."""

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
