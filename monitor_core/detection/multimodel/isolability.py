"""Isolability: causes that produce the same data, such as a scaled torque and a torque constant."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.multimodel.candidates import torque_unit
from monitor_core.detection.multimodel.hypothesis import REFERENCE, Hypothesis
from monitor_core.detection.multimodel.lanes import lanes_of, memory_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.hypotheses import BankTrace, Block, run_hypotheses
from monitor_core.settings import Settings

_SAME = 1e-4
"""Share of the evidence against REFERENCE by which two may be told apart that count as one."""
_MEMORIES = 6
_STRENGTH = 5.0


def distinguishable(
    model: AxisModel, settings: Settings, found: Sequence[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Hypotheses that change the data; of those with the same data only the first, with the causes of the others.

    Their predictions for one random record are compared, of which the last half counts.
    """
    eps = _innovations(model, settings, (REFERENCE, *found))
    from_now = ((eps - eps[:, :1]) ** 2).sum(axis=0)
    kept: list[int] = []
    names: dict[int, list[str]] = {}
    for k, hypothesis in enumerate(found, 1):
        if from_now[k] == 0.0 and hypothesis.variance == 1.0 and not hypothesis.still:
            continue
        same = next((j for j in kept if _same(eps, from_now, j, k, found)), None)
        if same is None:
            kept.append(k)
        elif found[same - 1].cause != hypothesis.cause:
            names.setdefault(same, []).append(hypothesis.cause)
    return tuple(replace(found[k - 1], alike=tuple(names.get(k, ()))) for k in kept)


def _same(eps: Floats, from_now: Floats, j: int, k: int, found: Sequence[Hypothesis]) -> bool:
    a, b = found[j - 1], found[k - 1]
    apart = float(((eps[:, j] - eps[:, k]) ** 2).sum())
    alike = apart <= _SAME * min(from_now[j], from_now[k])
    return alike and abs(a.variance / b.variance - 1) < _SAME and a.still == b.still


def _innovations(model: AxisModel, s: Settings, hypotheses: Sequence[Hypothesis]) -> Floats:
    """Innovations (N, len(hypotheses)) for a white torque and a white output; any signals do, as all is linear."""
    many, N = len(hypotheses), 2 * round(_MEMORIES * s.memory / 2)
    tables, predictors = lanes_of(
        model, replace(s, outlier_limit=0.0), hypotheses, np.full(many, np.inf), np.zeros(many)
    )
    H = predictors.own.shape[1]
    rng = np.random.default_rng(0)
    u = _STRENGTH * torque_unit(model, s) * rng.standard_normal(N)
    y = _STRENGTH * np.sqrt(s.lam0) * rng.standard_normal(N)
    t_us = np.arange(N, dtype=np.int64) * round(s.interval_s * 1e6)
    trace = BankTrace(*(np.empty((N, H)) for _ in range(3)))
    block = Block(t_us, u, y, np.empty((0, 1), np.bool_))
    run_hypotheses(np.arange(H), tables, predictors, memory_of(tables, H), block, 0, trace)
    return trace.eps[N // 2 :, :many]
