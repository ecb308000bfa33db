"""Grey-box identification: the parameters of a drive that predict records best (paper, section 4; Ljung, ch. 7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DELAY, DISTURBANCE_TIME, split_name
from monitor_core.identification.covariance import Information, information
from monitor_core.identification.criterion import choose_disturbance, fit_starts, settled, solve
from monitor_core.identification.estimate import Estimate
from monitor_core.identification.estimate_doubts import sentences
from monitor_core.identification.levenberg_marquardt import End
from monitor_core.identification.outlier_removal import without_gross
from monitor_core.identification.parameter_vector import Layout
from monitor_core.identification.predictor import Errors, Predictor
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.identification.record import Record
from monitor_core.identification.residuals import independence, whiteness
from monitor_core.kernel.tables import OF_MOTION

__all__ = ["DELAY", "Comparison", "Disturbance", "Estimate", "Problem", "compare", "fit"]

_SLACK = 20.0
"""A parameter that may be zero is compared with so many of its standard deviations, were all others known."""
_MOVES = 0.1
"""Standard deviations."""
_CLIPPED_VARIANCE = 0.7101645
"""Of a standard normal variable clipped at HUBER."""


class Comparison(NamedTuple):
    """NRMSE of one record, per cent: 100 (1 - |y - yhat| / |y - mean y|)."""

    one_step: float
    simulation: float


def fit(
    problem: Problem,
    records: Sequence[Record],
    start: Mapping[str, float] | Sequence[Mapping[str, float]] | None = None,
    *,
    tries: int = 1,
    spread: float = 0.5,
    seed: int = 0,
    most_iterations: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> Estimate:
    """Minimise the sum of squared prediction errors of all records over theta.

    ``start`` replaces nominal values of free parameters ("delay" is one); with several starts the best end is returned.
    With Huber's loss and a gain, outputs with gross errors then count as not measured, so that the state does not
    follow them, and the search continues.  With ``tries`` > 1 each start is followed by others around it: positive
    parameters times exp(``spread`` e), e normal, drawn with ``seed``.  ``progress`` is called with the number of
    evaluations and the cost whenever that has fallen.

    Raises:
        KeyError: a start for a parameter that is not free.
        ValueError: no record, another output than the drive's, no sample measured; no start from which the predictor is
            stable.
    """
    starts = [start or {}] if start is None or isinstance(start, Mapping) else list(start)
    rng = np.random.default_rng(seed)
    starts = [
        values for given in starts for values in (given, *_around(problem, given, spread, rng, tries - 1))
    ]
    ends, problems = [], list[ValueError]()
    for values in starts:
        try:
            ends.append(solve(_started(problem, values), records, most_iterations, progress))
        except ValueError as error:
            problems.append(error)
    if not ends:
        raise problems[0] if problems else ValueError("no start is given")
    best = min(ends, key=lambda found: found[1].normal.cost)
    return _estimate(*without_gross(*best, most_iterations, progress))


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
    one_step = _nrmse(ahead, ahead.errors(fit_starts(ahead)))
    return tuple(Comparison(a, b) for a, b in zip(one_step, _simulated(problem, records), strict=True))


def _simulated(problem: Problem, records: Sequence[Record]) -> tuple[float, ...]:
    """NRMSE of the simulation, per cent."""
    free_run = replace(
        problem,
        free=tuple(problem.varying),
        predictor="output-error",
        disturbance=None,
        K=None,
        motion="simulated",
        initial="free",
        free_delay=False,
    )
    predictor = Predictor(free_run, records, None)
    return _nrmse(predictor, predictor.errors(fit_starts(predictor)))


def _around(
    problem: Problem, start: Mapping[str, float], spread: float, rng: np.random.Generator, count: int
) -> list[Mapping[str, float]]:
    """Random starts around a given one, within the bounds."""
    layout = Layout(_started(problem, start), problem.drive, None, 1.0)
    lower, upper = layout.bounds()
    xi, log = layout.start(), layout.log
    drawn = [xi + spread * log * rng.standard_normal(xi.size) for _ in range(count)]
    free = layout.names[: len(problem.free)]
    return [
        {**start, **dict(zip(free, layout.numbers(np.clip(point, lower, upper)).tolist(), strict=False))}
        for point in drawn
    ]


def _started(problem: Problem, start: Mapping[str, float]) -> Problem:
    for name in start:
        if name not in problem.free and not (name == DELAY and problem.free_delay):
            raise KeyError(f"start of {name}: it is not free")
    values = {**problem.nominal}
    for name, value in start.items():
        base, inverse = split_name(name)
        if name != DELAY:
            values[base] = 1 / value if inverse else value
    return replace(problem, nominal=values, delay_s=start.get(DELAY, problem.delay_s))


def _estimate(predictor: Predictor, end: End, limit: float, outliers: tuple[int, ...]) -> Estimate:
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
    found = Estimate(
        drive=predictor.drive,
        problem=final,
        names=layout.names,
        theta=theta,
        covariance=information.covariance[:p, :p],
        values=point.values,
        delay_s=point.delay_s,
        K=gain.K * predictor.d,
        interval_s=predictor.interval_s,
        lam0=lam0,
        noise=noise if predictor.disturbance else {},
        cost=end.normal.cost,
        whiteness=whiteness(eps),
        independence=independence([s.u for s in predictor.series], eps),
        accuracy=information.accuracy,
        coloured=information.order,
        fit=_nrmse(predictor, errors),
        fit_simulation=_nrmse(predictor, errors)
        if _simulates(predictor, point.values)
        else _simulated(final, [s.record for s in predictor.series]),
        iterations=end.evaluations,
        converged=end.converged,
        moving=() if end.converged else _moving(predictor, end, information.covariance),
        outliers=outliers,
    )
    return replace(found, words=tuple(sentences(found, layout, xi)))


def _moving(predictor: Predictor, end: End, covariance: Floats) -> tuple[str, ...]:
    """Parameters that the remaining step would move; by an infinite amount where nothing determines them."""
    layout = predictor.layout
    p = len(layout.names)
    step = np.abs(end.left * layout.rates(end.xi))[:p]
    sd = np.sqrt(np.diag(covariance)[:p])
    by = np.where(np.isfinite(sd), step / np.where(sd > 0, sd, 1.0), np.inf)
    return tuple(layout.names[i] for i in np.argsort(-by, kind="stable") if by[i] > _MOVES)


def _simulates(predictor: Predictor, values: Mapping[str, float]) -> bool:
    """Whether the predictor uses no output: not for K, nor for friction and gravity, nor for its start."""
    problem, drive = predictor.problem, predictor.drive
    looks = np.isin(drive.inputs, OF_MOTION) & drive.matrix("B", values).any(axis=0)
    blind = problem.motion == "simulated" or not looks.any()
    return blind and problem.predictor == "output-error" and problem.initial == "free"


def _variance(end: End, errors: Sequence[Errors], limit: float) -> float:
    """lambda_0: mean square of the errors over the degrees of freedom."""
    freedom = max(end.normal.samples - end.xi.size, 1)
    if not limit < np.inf:
        return end.normal.cost / freedom
    clipped = sum(float(np.sum(np.clip(e.eps, -limit, limit) ** 2)) for e in errors)
    return clipped / freedom / _CLIPPED_VARIANCE


def _information(
    predictor: Predictor, xi: Floats, errors: Sequence[Errors], lam0: float, limit: float
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
    return information(names, sizes, gradients, starts, eps, variance)


def _nrmse(predictor: Predictor, errors: Sequence[Errors]) -> tuple[float, ...]:
    out = []
    for e, s in zip(errors, predictor.series, strict=True):
        measured = s.measured > 0
        y = s.y[measured]
        around = float(np.linalg.norm(y - y.mean()))
        out.append(100 * (1 - float(np.linalg.norm(e.eps[measured])) / around) if around > 0 else -np.inf)
    return tuple(out)
