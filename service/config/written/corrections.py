"""Corrected keys of an axis, as commissioning proposes them: what is to be written, and why."""

from collections.abc import Iterable
from typing import NamedTuple

SIGNAL = "signal"
"""Key of the auxiliary signals of an axis"""
GATE = "gate"
"""Key of the gates of an axis"""
NAMED_BY = {SIGNAL: "name", GATE: "signal"}
"""Lists of tables of an axis, with the key by which a correction names one"""


class Correction(NamedTuple):
    """A corrected key of an axis, e.g. ("torque", "factor") or ("sample_interval_s",), with new value and reason.

    ("signal", "axis2", "axis") is the key "axis" of the auxiliary signal named axis2, which need not exist yet, and
    ("gate", "closed", "below") that of the gate on the signal "closed".
    """

    key: tuple[str, ...]
    value: float | str | bool
    reason: str

    @property
    def change(self) -> str:
        """Key and value as in the configuration."""
        return f"{'.'.join(self.key)} = {self.toml_value}"

    @property
    def toml_value(self) -> str:
        """The value as in the configuration."""
        if isinstance(self.value, bool):
            return str(self.value).lower()
        return f'"{self.value}"' if isinstance(self.value, str) else f"{self.value:.6g}"

    def __str__(self) -> str:
        return f"{self.change}: {self.reason}"


class ShownChange(NamedTuple):
    """A change of the configuration for a reader: of one key, or of all keys of one auxiliary signal or gate."""

    written: str
    """As in the configuration"""
    reason: str


def changes_in(corrections: Iterable[Correction]) -> list[ShownChange]:
    """Corrections for a reader: those of one signal or gate are one change.

    Its reason is that of its first key.  Another reason is given once, with the first key that has it.
    """
    tables = dict[tuple[str, ...], list[Correction]]()
    for correction in corrections:
        table = correction.key[:2] if correction.key[0] in NAMED_BY else correction.key
        tables.setdefault(table, []).append(correction)
    found, given = list[ShownChange](), set[str]()
    for table, (first, *others) in tables.items():
        keys = {c.key[-1]: c.toml_value for c in (first, *others)}
        values = ", ".join(f"{key} = {value}" for key, value in keys.items())
        more = {c.reason: c.key[-1] for c in others if c.reason not in (first.reason, *given)}
        given |= more.keys()
        written = f"{'.'.join(table)} = {{ {values} }}" if others else first.change
        found.append(ShownChange(written, "; ".join((first.reason, *(f"{key}: {why}" for why, key in more.items())))))
    return found
