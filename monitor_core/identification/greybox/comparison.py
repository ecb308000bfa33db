"""How well a drive predicts records one step ahead, and simulates them: NRMSE, 100 (1 - |y - yhat| / |y - mean y|)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.greybox.criterion import choose_disturbance, fit_starts
from monitor_core.identification.predictor.prediction_errors import Errors, Predictor
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.record import Record


class Comparison(NamedTuple):
    """NRMSE of one record, per cent."""

    one_step: float
    simulation: float


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
        """NRMSE one step ahead, per cent."""
        return _nrmse(self.y, self.y - self.predicted)

    @property
    def fit_simulation(self) -> float:
        """The same of the simulation."""
        return _nrmse(self.y, self.y - self.simulated)


def traces_of(problem: Problem, records: Sequence[Record]) -> tuple[Trace, ...]:
    """Traces with the values of a problem, such as ``Estimate.problem``; only the initial states are fitted.

    Raises:
        ValueError: a record of another output than the drive's, or without a measured sample.
    """
    ahead = Predictor(problem, records, problem.disturbance if problem.K is None else None)
    outputs = [
        [series.record.y - e.eps for series, e in zip(p.series, p.errors(fit_starts(p)), strict=True)]
        for p in (ahead, Predictor(_free_run(problem), records, None))
    ]
    return tuple(Trace(r.name, r.t, r.y, *both) for r, *both in zip(records, *outputs, strict=True))


def compare(problem: Problem, records: Sequence[Record]) -> tuple[Comparison, ...]:
    """How well a problem's values, such as those of ``Estimate.problem``, predict and simulate records.

    Only the initial states are fitted.  One step ahead K is that of the problem's noise at these records' interval,
    where it names none of the white torque noise that predicts the first of them best, found to a factor of ten;
    friction and gravity in the simulation follow the simulated motion.

    Raises:
        ValueError: no record, another output than the drive's, no sample measured.
    """
    held = replace(problem, free=tuple(problem.varying))
    ahead = Predictor(held, records, choose_disturbance(held, records))
    one_step = fits(ahead, ahead.errors(fit_starts(ahead)))
    return tuple(Comparison(a, b) for a, b in zip(one_step, simulated_fits(problem, records), strict=True))


def simulated_fits(problem: Problem, records: Sequence[Record]) -> tuple[float, ...]:
    """NRMSE of the simulation of each record, per cent; only the initial states are fitted."""
    held = replace(problem, free=tuple(problem.varying), free_delay=False)
    predictor = Predictor(_free_run(held), records, None)
    return fits(predictor, predictor.errors(fit_starts(predictor)))


def fits(predictor: Predictor, errors: Sequence[Errors]) -> tuple[float, ...]:
    """NRMSE of each record, per cent, where a predictor leaves these errors."""
    return tuple(_nrmse(s.record.y, e.eps) for s, e in zip(predictor.series, errors, strict=True))


def _free_run(problem: Problem) -> Problem:
    return replace(
        problem, predictor="output-error", disturbance=None, K=None, motion="simulated", initial="free"
    )


def _nrmse(y: Floats, eps: Floats) -> float:
    measured = np.isfinite(y)
    y, eps = y[measured], eps[measured]
    around = float(np.linalg.norm(y - y.mean()))
    return 100 * (1 - float(np.linalg.norm(eps)) / around) if around > 0 else -np.inf
