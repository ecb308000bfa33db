"""What was measured, predicted one step ahead, and simulated, sample by sample: for pictures, and their fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.fit import fit_starts
from monitor_core.identification.predictor import Predictor
from monitor_core.identification.problem import Problem
from monitor_core.identification.record import Record


@dataclass(frozen=True, eq=False)
class Trace:
    """One record: times (N,), s; output as it was measured (NaN: it was not), predicted, simulated; fits, per cent."""

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
        """The same of the simulation."""
        return _nrmse(self.y, self.simulated)


def traces_of(problem: Problem, records: Sequence[Record]) -> tuple[Trace, ...]:
    """Of a problem's values, such as those of ``Estimate.problem``; only initial states are fitted.

    Raises:
        ValueError: another output than the drive's, no sample measured.
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
    """yhat; where nothing was measured eps is zero and so yhat is not known there."""
    found = predictor.errors(fit_starts(predictor))
    return [series.record.y - e.eps for series, e in zip(predictor.series, found, strict=True)]


def _nrmse(y: Floats, yhat: Floats) -> float:
    measured = np.isfinite(y)
    y, yhat = y[measured], yhat[measured]
    around = float(np.linalg.norm(y - y.mean()))
    return 100 * (1 - float(np.linalg.norm(y - yhat)) / around) if around > 0 else -np.inf
