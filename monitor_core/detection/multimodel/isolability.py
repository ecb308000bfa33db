"""Isolability: which candidate changes produce the same data, such as a scaled torque and another torque constant."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.multimodel.candidates import candidates, torque_unit
from monitor_core.detection.multimodel.hypothesis import REFERENCE, Hypothesis
from monitor_core.detection.multimodel.lanes import Tests, lanes_of, memory_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.hypotheses import BankTrace, Block, run_hypotheses
from monitor_core.settings import Settings

_SAME = 1e-4
"""Two candidates count as the same if they differ by at most this share of their evidence against REFERENCE."""
_MEMORIES = 6
"""Length of the record for which candidates are compared, in memories of the estimates; the first half is left out"""
_STRENGTH = 5.0
"""Size of its signals, in units of what moves the predicted output by its standard deviation"""


class Distinct(NamedTuple):
    """A candidate whose effect on the data no earlier candidate has."""

    place: int
    """Index of the candidate"""
    alike: tuple[str, ...]
    """Causes of later candidates with the same effect"""


def default_hypotheses(model: AxisModel, settings: Settings) -> tuple[Hypothesis, ...]:
    """The distinct candidates; of candidates with the same effect, the first one lists the causes of the others."""
    every = candidates(model, settings)
    return chosen(every, distinct_candidates(model, settings, every))


def chosen(every: Sequence[Hypothesis], distinct: Sequence[Distinct]) -> tuple[Hypothesis, ...]:
    """The distinct ones of all candidates, with the causes that have the same effect.

    Raises:
        ValueError: an index beyond the candidates.
    """
    if any(not 0 <= d.place < len(every) for d in distinct):
        raise ValueError(f"there are {len(every)} candidates")
    return tuple(replace(every[d.place], alike=d.alike) for d in distinct)


def distinct_candidates(model: AxisModel, settings: Settings, every: Sequence[Hypothesis]) -> tuple[Distinct, ...]:
    """Find the candidates that change the data, each in another way.

    Their predictions for one random record are compared over its second half.
    """
    eps = _innovations(model, settings, (REFERENCE, *every))
    effect = ((eps - eps[:, :1]) ** 2).sum(axis=0)
    kept: list[int] = []
    names: dict[int, list[str]] = {}
    for k, hypothesis in enumerate(every, 1):
        if effect[k] == 0.0 and hypothesis.variance == 1.0 and not hypothesis.still:
            continue
        same = next((j for j in kept if _have_same_effect(eps, effect, j, k, every)), None)
        if same is None:
            kept.append(k)
        elif every[same - 1].cause != hypothesis.cause:
            names.setdefault(same, []).append(hypothesis.cause)
    return tuple(Distinct(k - 1, tuple(names.get(k, ()))) for k in kept)


def _have_same_effect(eps: Floats, effect: Floats, j: int, k: int, every: Sequence[Hypothesis]) -> bool:
    a, b = every[j - 1], every[k - 1]
    apart = float(((eps[:, j] - eps[:, k]) ** 2).sum())
    alike = apart <= _SAME * min(effect[j], effect[k])
    return alike and abs(a.variance / b.variance - 1) < _SAME and a.still == b.still


def _innovations(model: AxisModel, s: Settings, hypotheses: Sequence[Hypothesis]) -> Floats:
    """Innovations (N, len(hypotheses)) for white torque, output and weight.

    Any signals serve to compare the hypotheses, as all predictors are linear.
    """
    many, N = len(hypotheses), 2 * round(_MEMORIES * s.memory / 2)
    tables, predictors = lanes_of(
        model, replace(s, outlier_limit=0.0), hypotheses, Tests(np.full(many, np.inf), *np.zeros((3, many)))
    )
    H = predictors.own.shape[1]
    rng = np.random.default_rng(0)
    u = _STRENGTH * torque_unit(model, s) * rng.standard_normal(N)
    y = _STRENGTH * np.sqrt(s.lam0) * rng.standard_normal(N)
    weight = _STRENGTH * torque_unit(model, s) * rng.standard_normal(N)
    t_us = np.arange(N, dtype=np.int64) * round(s.interval_s * 1e6)
    trace = BankTrace(*(np.empty((N, H)) for _ in range(3)))
    block = Block(t_us, u, y, np.empty((0, 1), np.bool_), weight)
    run_hypotheses(np.arange(H), tables, predictors, memory_of(tables, H), block, 0, trace)
    return trace.eps[N // 2 :, :many]
