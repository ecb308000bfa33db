"""A drive as JSON: entries of A, B, C as expressions, numbers where they are known."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from monitor_core.modeling import Entries, FlatParameter, Laurent, Mode
from monitor_core.modeling.symbolic import shapes
from service.reports.model_facts import INPUT_KINDS, OUTPUT_UNITS, Facts, as_dict

Json = dict[str, Any]


def as_json(facts: Facts) -> str:
    """The whole document.  What needs nominal values is null where one is missing (``missing_nominal``)."""
    space, report = facts.space, facts.space.report
    content = {
        "name": space.name,
        "states": [{"name": s.name, "unit": s.unit} for s in space.states],
        "inputs": [{"name": u.name, "kind": INPUT_KINDS[u.kind]} for u in space.inputs],
        "outputs": [
            {"name": s.name, "quantity": s.quantity, "unit": OUTPUT_UNITS[s.quantity]} for s in space.sensors
        ],
        "parameters": [_parameter(p, facts.nominal) for p in space.parameters],
        "merged": [{"name": d.name, "definition": str(d.value)} for d in space.definitions],
        "missing_nominal": list(facts.missing),
        **_matrices(facts),
        **_motion(facts),
        "flat_equations": report.flat_equations,
        "flat_states": report.flat_states,
        "remaining_equations": report.remaining_equations,
        "identifiability": list(facts.identifiability),
        "local": as_dict(facts.local) if facts.local else None,
        "notes": list(space.notes),
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _parameter(p: FlatParameter, nominal: Mapping[str, float]) -> Json:
    return {"name": p.name, "unit": p.unit, "meaning": p.meaning, "nominal": nominal.get(p.name)}


def _matrices(facts: Facts) -> Json:
    s = facts.space
    return {
        letter: _rows(entries, *shape)
        for letter, entries, shape in zip("ABC", (s.A, s.B, s.C), shapes(s), strict=True)
    }


def _rows(entries: Entries, rows: int, columns: int) -> list[list[str]]:
    zero = Laurent()
    return [[str(entries.get((row, column), zero)) for column in range(columns)] for row in range(rows)]


def _motion(facts: Facts) -> Json:
    m = facts.motion
    return {
        "poles": [{"re": p.real, "im": p.imag} for p in m.poles] if m else None,
        "resonances_hz": _hertz(m.resonances) if m else None,
        "antiresonances_hz": _hertz(m.antiresonances) if m else None,
    }


def _hertz(modes: Iterable[Mode]) -> list[float]:
    return [mode.frequency_hz for mode in modes]
