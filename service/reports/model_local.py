"""Words and numbers for what a record tells of the parameters of a drive."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from monitor_core.excitation.local_identifiability import Local
from service.reports.model_words import OUTPUT_UNITS

_MODEST = 10
"""Condition of the scaled sensitivities below which nothing is said of it."""


def experiment_words(local: Local) -> str:
    """What the figures stand on."""
    return f"{local.experiment.words}; noise {local.noise:.3g}{_unit(local)}; standard deviation of each parameter:"


def _unit(local: Local) -> str:
    return f" {OUTPUT_UNITS[local.quantity]}"


def deviation_cells(local: Local) -> Iterator[str]:
    """``Jm 0.3 %`` for each parameter."""
    for name, sd in zip(local.accuracy.names, local.accuracy.standard_deviations.tolist(), strict=True):
        yield f"{name} {100 * sd:.2g} %" if sd < float("inf") else f"{name}: not told"


def local_words(local: Local) -> tuple[str, ...]:
    """What is not told, what was assumed."""
    words = local.accuracy.words()
    if local.accuracy.condition > _MODEST:
        words += (f"Condition of the scaled sensitivities: {local.accuracy.condition:.3g}.",)
    if local.held:
        words += (f"Held known: {', '.join(local.held)}.",)
    if local.left_out:
        words += (f"Zero at nominal, left out: {', '.join(local.left_out)}.",)
    return words


def as_dict(local: Local) -> dict[str, Any]:
    """For JSON; null where a parameter is not told at all."""
    deviations = zip(local.accuracy.names, local.accuracy.standard_deviations.tolist(), strict=True)
    pairs = [{"names": [one, other], "correlation": r} for one, other, r in local.accuracy.pairs()]
    condition = local.accuracy.condition
    return {
        "experiment": local.experiment.words,
        "noise": local.noise,
        "held_known": list(local.held),
        "left_out": list(local.left_out),
        "relative_standard_deviations": {n: sd if sd < float("inf") else None for n, sd in deviations},
        "condition": condition if condition < float("inf") else None,
        "correlated_pairs": pairs,
        "words": list(local.accuracy.words()),
    }
