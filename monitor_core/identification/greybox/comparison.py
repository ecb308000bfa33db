"""How well a drive predicts records one step ahead, and simulates them: NRMSE, 100 (1 - |y - yhat| / |y - mean y|)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DELAY, split_name
from monitor_core.identification.greybox.criterion import fit_starts
from monitor_core.identification.greybox.estimate import Estimate
from monitor_core.identification.greybox.residuals import information
from monitor_core.identification.predictor.prediction_errors import Errors, Predictor
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.record import Record


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


# --- How much more recursive estimates scatter than they would with white prediction errors ---------------------------


# Where the noise model is not right, neighbouring errors are correlated, and a sum of N of them is larger than
# sqrt(N) of one.  The standard deviations of the daemon come from lambda_0 P, so lambda_0 must be larger by this
# factor.


def colour_of(estimate: Estimate, monitored: Sequence[str], records: Sequence[Record]) -> float:
    """Largest ratio of the variance of a monitored parameter to its variance with white errors; at least 1.

    Everything else is held, as in the daemon: values, K and delay are the estimates, and schedules are followed.

    Raises:
        ValueError: a record of another output than the drive's.
    """
    found = estimate.problem
    K = tuple(estimate.K.tolist()) if found.predictor == "innovations" else None
    free = _free(found.varying, monitored)
    varying = {name: signals for name, signals in found.varying.items() if name in free}
    problem = replace(
        found, drive=estimate.drive, nominal=estimate.values, free=free,
        K=K, disturbance=None, delay_s=estimate.delay_s, free_delay=DELAY in monitored,
        bounds={}, varying=varying,
    )  # fmt: skip
    predictor = Predictor(problem, records, None)
    errors = predictor.errors(fit_starts(predictor))
    end = len(free) + sum(map(len, varying.values()))  # number of parameters and slopes, before the delay
    own, start = [*range(len(free)), *[end] * problem.free_delay], end + problem.free_delay
    gradients, starts = [e.psi[:, own] for e in errors], [e.psi[:, start:] for e in errors]
    names = [predictor.layout.names[k] for k in own]
    result = information(names, np.ones(len(own)), gradients, starts, [e.eps for e in errors], estimate.lam0)
    white, coloured = np.diag(result.white), np.diag(result.covariance)
    known = np.isfinite(white)
    return float(np.max(coloured[known] / white[known], initial=1.0))


def _free(varying: Iterable[str], monitored: Sequence[str]) -> tuple[str, ...]:
    """The monitored parameters; a scheduled one by the name (Ja or 1/Ja) that has the slopes."""
    called = {split_name(name)[0]: name for name in varying}
    return tuple(called.get(split_name(name)[0], name) for name in monitored if name != DELAY)
