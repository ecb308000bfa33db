"""A drive as JSON: entries of A, B, C as expressions, numbers where they are known."""

from __future__ import annotations

from typing import Any

from monitor_core.drive import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.excitation import LocalIdentifiability
from service.reports.formats import json_text
from service.reports.model_facts import OUTPUT_UNITS, Facts, matrices

Json = dict[str, Any]
_KINDS = {TORQUE: "torque", COULOMB: "direction", ONE: "one", COSINE: "cosine", SINE: "sine"}


def as_json(facts: Facts) -> str:
    """The whole document.  What needs nominal values is null where one is missing (``missing_nominal``)."""
    space, report, motion = facts.space, facts.space.report, facts.motion
    return json_text(
        {
            "name": space.name,
            "states": space.states,
            "inputs": [{"name": u.name, "kind": _KINDS[u.kind]} for u in space.inputs],
            "outputs": [
                {"name": s.name, "quantity": s.quantity, "unit": OUTPUT_UNITS[s.quantity]}
                for s in space.sensors
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
            "local": _local(facts.local) if facts.local else None,
            "notes": space.notes,
        }
    )


def _local(local: LocalIdentifiability) -> Json:
    """What a record tells; null where a parameter is not told at all."""
    accuracy = local.accuracy
    deviations = zip(accuracy.names, accuracy.standard_deviations.tolist(), strict=True)
    return {
        "experiment": local.experiment.words,
        "noise": local.noise,
        "held_known": local.held,
        "left_out": local.left_out,
        "relative_standard_deviations": dict(deviations),
        "condition": accuracy.condition,
        "correlated_pairs": [{"names": [a, b], "correlation": r} for a, b, r in accuracy.pairs()],
        "words": accuracy.words(),
    }
