"""What there is to say about a drive, found once for all reports; and all of it as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor_core.drive import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling import Laurent, StateSpace
from service.ingest.unit_names import UNITS
from service.reports.formats import json_text

if TYPE_CHECKING:
    from monitor_core.modeling import Resonances

_MOST_STATES = 100
"""Beyond that it takes minutes to find what can be identified."""
_MOST_MERGED = 60
"""Parameters that stand only inside of merged ones; each of them takes a further pass."""


@dataclass(frozen=True, slots=True)
class Facts:
    """A drive, the ``nominal`` values that are known, and what follows.

    ``missing``: parameters without a nominal value; with any of them there is no ``motion``.
    ``motion``: poles [1/s], resonances and anti-resonances from the torque to the first output.
    ``identifiability``: sentences.
    """

    space: StateSpace
    nominal: Mapping[str, float]
    missing: tuple[str, ...]
    motion: Resonances | None
    identifiability: tuple[str, ...]


def facts_of(space: StateSpace, values: Mapping[str, float] | None = None) -> Facts:
    """All of it, with nominal values that go before the drawing's own."""
    from monitor_core.modeling import nominal_of, resonances_of, structural

    nominal = nominal_of(space, values)
    missing = tuple(p.name for p in space.parameters if p.name not in nominal)
    motion = None if missing else resonances_of(space, values)
    why = _not_examined(space)
    identifiability = (f"Not examined: {why}.",) if why else structural(space).words()
    return Facts(space, nominal, missing, motion, identifiability)


def _not_examined(space: StateSpace) -> str:
    """Why it would take too long; empty if it does not."""
    if len(space.states) > _MOST_STATES:
        return f"the drive has more than {_MOST_STATES} states"
    merged = {name for definition in space.definitions for name in definition.value.names}
    if len(merged) > _MOST_MERGED:
        return f"more than {_MOST_MERGED} parameters are merged into others"
    return ""


def matrices(space: StateSpace) -> dict[str, list[list[str]]]:
    """The entries of A (n, n), B (n, m) and C (p, n) as text."""
    n, m, p = len(space.states), len(space.inputs), len(space.sensors)
    zero = Laurent()
    return {
        letter: [[str(entries.get((i, j), zero)) for j in range(columns)] for i in range(rows)]
        for letter, entries, rows, columns in (
            ("A", space.A, n, n),
            ("B", space.B, n, m),
            ("C", space.C, p, n),
        )
    }


# --- JSON -------------------------------------------------------------------------------------------------------------


_KINDS = {TORQUE: "torque", COULOMB: "direction", ONE: "one", COSINE: "cosine", SINE: "sine"}


def as_json(facts: Facts) -> str:
    """All of it: entries of A, B, C as expressions, numbers where they are known.

    What needs nominal values is null where one is missing (``missing_nominal``).
    """
    space, report, motion = facts.space, facts.space.report, facts.motion
    return json_text(
        {
            "name": space.name,
            "states": space.states,
            "inputs": [{"name": u.name, "kind": _KINDS[u.kind]} for u in space.inputs],
            "outputs": [
                {"name": s.name, "quantity": s.quantity, "unit": UNITS[s.quantity]} for s in space.sensors
            ],
            "parameters": [
                {"name": p.name, "unit": p.unit, "meaning": p.meaning, "nominal": facts.nominal.get(p.name)}
                for p in space.parameters
            ],
            "merged": [{"name": d.name, "definition": str(d.value)} for d in space.definitions],
            "missing_nominal": facts.missing,
            **matrices(space),
            "poles": [{"re": p.real, "im": p.imag} for p in motion.poles] if motion else None,
            "resonances_hz": [m.frequency_hz for m in motion.resonances] if motion else None,
            "antiresonances_hz": [m.frequency_hz for m in motion.antiresonances] if motion else None,
            "flat_equations": report.flat_equations,
            "flat_states": report.flat_states,
            "remaining_equations": report.remaining_equations,
            "identifiability": facts.identifiability,
            "notes": space.notes,
        }
    )
