"""Grey-box identification: the parameters of a drive that predict records best (paper, section 4; Ljung, ch. 7)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DISTURBANCE_TIME
from monitor_core.identification.greybox.comparison import fits, simulated_fits
from monitor_core.identification.greybox.criterion import FitProgress, Fitted, settled, solve, without_outliers
from monitor_core.identification.greybox.estimate import Estimate, sentences
from monitor_core.identification.greybox.levenberg_marquardt import SearchResult
from monitor_core.identification.greybox.residuals import Information, independence, information, whiteness
from monitor_core.identification.predictor.prediction_errors import Errors, RecordPredictor
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.motion_cells import PredictedMotion, motion_cells
from monitor_core.kernel.tables import OF_MOTION

_SLACK = 20.0
"""The size of a parameter that may be zero is at least this number of its standard deviations with all others known."""
_MOVES = 0.1
"""A parameter counts as still moving if the remaining step exceeds this number of its standard deviations."""
_CLIPPED_VARIANCE = 0.7101645
"""Variance of a standard normal variable clipped at HUBER"""
_RARE = 1e-4
"""Share of the errors above the reported largest error, as records may contain outliers."""


def fit(
    problem: Problem,
    records: Sequence[Record],
    *,
    most_iterations: int = 100,
    progress: FitProgress | None = None,
) -> Estimate:
    """Minimise the sum of squared prediction errors of all records over theta, from the problem's values.

    With Huber's loss and a gain, outputs with gross errors then count as not measured, so that the state does not
    follow them, and the search continues.  ``progress`` is called with the number of evaluations and the cost whenever
    the cost has fallen.

    Raises:
        ValueError: no record, another output than the drive's, no sample measured; the predictor is unstable at the
            start.
    """
    found = solve(problem, records, most_iterations, progress)
    return _estimate(without_outliers(found, most_iterations, progress))


def _estimate(fitted: Fitted) -> Estimate:
    predictor, end, limit, outliers = fitted
    layout, xi = predictor.layout, end.xi
    errors = predictor.errors(xi)
    lam0 = _variance(end, errors, limit)
    information = _information(predictor, xi, errors, lam0, limit)
    p = len(layout.names)
    theta = layout.numbers(xi)[:p]
    final = settled(predictor, xi)
    point, gain = layout.point(xi), predictor.gain(xi)
    output = float(np.sqrt(lam0 / gain.S)) if predictor.disturbance else float(np.sqrt(lam0))
    noise = {"torque": point.torque * output, "slow": point.slow * output, "output": output}
    if DISTURBANCE_TIME in point.values:
        noise["time_constant"] = point.values[DISTURBANCE_TIME]
    eps = [e.eps for e in errors]
    # A remaining step that is long because it has many entries may still move no parameter significantly.
    moving = () if end.converged else _moving(predictor, end, information.covariance)
    found = Estimate(
        drive=predictor.drive,
        problem=final,
        names=layout.names,
        theta=theta,
        covariance=information.covariance[:p, :p],
        values={name: value for name, value in point.values.items() if name not in predictor.torque_slopes},
        delay_s=point.delay_s,
        K=gain.K * predictor.d,
        interval_s=predictor.interval_s,
        lam0=lam0,
        largest_error=_largest(eps),
        noise=noise if predictor.disturbance else {},
        cost=end.normal.cost,
        whiteness=whiteness(eps),
        independence=independence([s.u for s in predictor.series], eps),
        accuracy=information.accuracy,
        coloured=information.order,
        excess=information.excess[:p],
        fit=fits(predictor, errors),
        simulate=None
        if _simulates(predictor, point.values)
        else partial(simulated_fits, final, [s.record for s in predictor.series]),
        iterations=end.evaluations,
        converged=not moving,
        moving=moving,
        outliers=outliers,
    )
    return replace(found, words=tuple(sentences(found, layout, xi)))


def _largest(eps: Sequence[Floats]) -> float:
    """The magnitude that one in ten thousand of the counted errors exceeds; 0: there are none (others are zero)."""
    errors = np.abs(np.concatenate(eps))
    counted = errors[errors > 0]
    return float(np.quantile(counted, 1 - _RARE)) if counted.size else 0.0


def _moving(predictor: RecordPredictor, end: SearchResult, covariance: Floats) -> tuple[str, ...]:
    """Parameters that the remaining step would move, including those that nothing determines."""
    layout = predictor.layout
    p = len(layout.names)
    step = np.abs(end.left * layout.rates(end.xi))[:p]
    sd = np.sqrt(np.diag(covariance)[:p])
    by = np.where(np.isfinite(sd), step / np.where(sd > 0, sd, 1.0), np.inf)
    return tuple(layout.names[i] for i in np.argsort(-by, kind="stable") if by[i] > _MOVES)


def _simulates(predictor: RecordPredictor, values: Mapping[str, float]) -> bool:
    """Whether the predictor uses no measured output: neither for K, nor for friction and gravity, nor for its start."""
    problem, drive = predictor.problem, predictor.drive
    blind = problem.motion == "simulated" or not drive.acts(OF_MOTION, values)
    blind = blind and drive.output != "angle"  # which is compared by its speed
    return blind and problem.predictor == "output-error" and problem.initial == "free"


def _variance(end: SearchResult, errors: Sequence[Errors], limit: float) -> float:
    """lambda_0: mean square of the errors over the degrees of freedom."""
    freedom = max(end.normal.samples - end.xi.size, 1)
    if not limit < np.inf:
        return end.normal.cost / freedom
    clipped = sum(float(np.sum(np.clip(e.eps, -limit, limit) ** 2)) for e in errors)
    return clipped / freedom / _CLIPPED_VARIANCE


def _information(
    predictor: RecordPredictor, xi: Floats, errors: Sequence[Errors], lam0: float, limit: float
) -> Information:
    """Information on everything that the records share, including noise levels."""
    layout, shared = predictor.layout, predictor.layout.shared
    gradients, starts = [e.psi[:, :shared] for e in errors], [e.psi[:, shared:] for e in errors]
    numbers = np.abs(layout.numbers(xi))
    lengths = np.sqrt(sum((psi**2).sum(axis=0) for psi in gradients))
    alone = np.sqrt(lam0) / np.where(lengths > 0, lengths, 1.0)
    sizes = np.where(layout.log, numbers, np.maximum(numbers, _SLACK * alone))
    sizes[sizes == 0] = 1.0
    names = [entry.name for entry in layout.entries]
    eps, variance = [e.eps for e in errors], lam0
    if limit < np.inf:
        eps = [np.clip(e, -limit, limit) for e in eps]
        inside = np.mean(np.concatenate([np.abs(e) < limit for e in eps]))
        eps = [e / inside for e in eps]
        variance = lam0 * _CLIPPED_VARIANCE / inside**2
    cells = motion_cells(
        [
            PredictedMotion(s.record.t, s.record.y - e.eps, s.record.quantity, s.counts > 0)
            for s, e in zip(predictor.series, errors, strict=True)
        ]
    )
    return information(names, sizes, gradients, starts, eps, variance, cells)
