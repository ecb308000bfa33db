"""Measured, predicted and simulated output of a record, sample by sample, with the fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.criterion import fit_starts
from monitor_core.identification.predictor import Predictor
from monitor_core.identification.problem import Problem
from monitor_core.identification.record import Record


@dataclass(frozen=True, eq=False)
class Trace:
    """Times (N,) [s] of one record; its output (N,) as measured (NaN: missing), predicted one step ahead, simulated."""

    name: str
    t: Floats
    y: Floats
    predicted: Floats
    simulated: Floats

    @property
    def fit(self) -> float:
        """NRMSE one step ahead: 100 (1 - |y - yhat| / |y - mean y|)."""
        return _nrmse(self.y, self.predicted)

    @property
    def fit_simulation(self) -> float:
        """The same fit of the simulation."""
        return _nrmse(self.y, self.simulated)


def traces_of(problem: Problem, records: Sequence[Record]) -> tuple[Trace, ...]:
    """Traces with the values of a problem, such as ``Estimate.problem``; only the initial states are fitted.

    Raises:
        ValueError: a record of another output than the drive's, or without a measured sample.
    """
    free_run = replace(
        problem, predictor="output-error", disturbance=None, K=None, motion="simulated", initial="free"
    )
    one_step = _outputs(Predictor(problem, records, problem.disturbance if problem.K is None else None))
    runs = _outputs(Predictor(free_run, records, None))
    return tuple(
        Trace(r.name, r.t, r.y, predicted, simulated)
        for r, predicted, simulated in zip(records, one_step, runs, strict=True)
    )


def _outputs(predictor: Predictor) -> list[Floats]:
    """yhat of each record; NaN where the output was not measured."""
    found = predictor.errors(fit_starts(predictor))
    return [series.record.y - e.eps for series, e in zip(predictor.series, found, strict=True)]


def _nrmse(y: Floats, yhat: Floats) -> float:
    measured = np.isfinite(y)
    y, yhat = y[measured], yhat[measured]
    around = float(np.linalg.norm(y - y.mean()))
    return 100 * (1 - float(np.linalg.norm(y - yhat)) / around) if around > 0 else -np.inf
