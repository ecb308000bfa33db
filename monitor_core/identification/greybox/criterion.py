"""The prediction-error criterion of a problem on records, and its minimum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.structure import DELAY, DISTURBANCE_TIME
from monitor_core.identification.greybox.levenberg_marquardt import (
    NEARLY,
    STEP,
    UNDAMPED,
    End,
    Normal,
    minimise,
)
from monitor_core.identification.predictor.parameter_vector import LEVEL
from monitor_core.identification.predictor.prediction_errors import Errors, Predictor
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.identification.records.measured_record import Record

_START_STEPS = 10
_JITTER = 1e-3
_NEAR = 1e-3
_BEYOND = 0.01
_LEVEL_STEP = 1.5
"""Where a noise level hardly shows, it may go anywhere; the other entries then need not wait for it."""
_LEVELS = (1e-2, 1e-1, 1.0, 1e1, 1e2)
"""Of torque noise over output noise, tried in units of the signals' own ratio."""
_MOST_LEVELS = 11
"""With those beyond, where the first or the last predicts best: an angle that travels far is large beside its noise."""

Progress = Callable[[int, float], None]
"""Called with the number of evaluations and the cost whenever that has fallen."""


def solve(
    problem: Problem, records: Sequence[Record], most: int, progress: Progress | None
) -> tuple[Predictor, End]:
    """The minimum next to the start of the problem.

    Raises:
        ValueError: the predictor is unstable at the start.
    """
    predictor = Predictor(problem, records, choose_disturbance(problem, records))
    end = _search(predictor, most, progress)
    return _across_intervals(predictor, end, records, most, progress)


def _across_intervals(
    predictor: Predictor, end: End, records: Sequence[Record], most: int, progress: Progress | None
) -> tuple[Predictor, End]:
    """A delay at a limit of its interval continues in the next one, as long as that is better."""
    while (side := _held_at(predictor, end)) and all(r.jitter_s < _JITTER * r.interval_s for r in records):
        problem = settled(predictor, end.xi)
        problem = replace(problem, delay_s=problem.delay_s + side * _BEYOND * predictor.interval_s)
        try:
            following = Predictor(problem, records, problem.disturbance)
            found = _search(following, most, progress)
        except ValueError:
            break
        if not found.normal.cost < end.normal.cost:
            break
        predictor, end = following, found._replace(evaluations=end.evaluations + found.evaluations)
    return predictor, end


def _held_at(predictor: Predictor, end: End) -> int:
    """-1 or 1: the limit of its interval that holds the delay; 0: none, or the user's own bound."""
    layout = predictor.layout
    if not layout.free_delay:
        return 0
    k = layout.names.index(DELAY)
    lower, upper = (float(bound[k]) for bound in layout.bounds())
    near, low_high = _NEAR * predictor.interval_s, predictor.problem.bounds.get(DELAY, (-np.inf, np.inf))
    if end.xi[k] <= lower + near:
        return -1 if lower > low_high[0] else 0
    return 1 if end.xi[k] >= upper - near and upper < low_high[1] else 0


def settled(predictor: Predictor, xi: Floats) -> Problem:
    """The problem with the estimates as its start."""
    problem, layout, point = predictor.problem, predictor.layout, predictor.layout.point(xi)
    noise = predictor.disturbance
    if noise is not None:
        noise = replace(
            noise,
            torque=point.torque * noise.output,
            slow=point.slow * noise.output,
            time_constant_s=point.values.get(DISTURBANCE_TIME, noise.time_constant_s),
        )
    names = {p.name for p in problem.drive.parameters}
    called = layout.names[len(layout.free) : len(layout.free) + len(point.slopes)]
    slopes = dict(zip(called, point.slopes.tolist(), strict=True))
    return replace(
        problem,
        nominal={name: value for name, value in point.values.items() if name in names},
        delay_s=point.delay_s,
        disturbance=noise,
        slopes=slopes | {name: point.values[name] for name in predictor.torque_slopes},
    )


def fit_starts(predictor: Predictor) -> Floats:
    """The vector with the initial states that fit best, all else as at the start.

    Without friction and gravity of the simulated motion the errors are linear in them: one step.  With these the
    cost is rough, and the search ends after some steps, at little more than its least.
    """
    xi, shared = predictor.start(), predictor.layout.shared
    if xi.size == shared:
        return xi

    def evaluate(own: Floats) -> Normal:
        errors = predictor.errors_by_starts(np.concatenate([xi[:shared], own]))
        columns = np.split(np.arange(own.size), len(errors))
        return _normal(predictor, errors, columns, np.ones(own.size))

    own = xi[shared:]
    endless = np.full(own.size, np.inf)
    try:
        found = minimise(
            evaluate, own, (-endless, endless), endless, endless, _START_STEPS, None, UNDAMPED, NEARLY
        ).xi
    except ValueError:
        found = own
    return np.concatenate([xi[:shared], found])


def criterion(predictor: Predictor, xi: Floats) -> Normal:
    """Sum of squared errors over all records and its Gauss-Newton model.

    The cost is infinite where the prediction runs away.
    """
    errors = predictor.errors(xi)
    columns = [predictor.columns(i) for i in range(len(errors))]
    return _normal(predictor, errors, columns, predictor.layout.rates(xi))


def _normal(predictor: Predictor, errors: Sequence[Errors], columns: Sequence[Ints], rates: Floats) -> Normal:
    """The model of these errors, whose psi are by these entries of a vector; ``rates`` (P,): d number / d entry."""
    with np.errstate(all="ignore"):  # errors may be finite while their squares are not
        found = _sums(predictor, errors, columns, rates.size)
        found = found._replace(g=found.g * rates, H=found.H * np.outer(rates, rates))
        return found if np.isfinite(found.cost + found.H.sum()) else found._replace(cost=np.inf)


def _sums(predictor: Predictor, errors: Sequence[Errors], columns: Sequence[Ints], P: int) -> Normal:
    cost, g, H, samples = 0.0, np.zeros(P), np.zeros((P, P)), 0
    for i, (eps, psi, good) in enumerate(errors):
        if not good:
            return Normal(np.inf, g, H, samples)
        cost += float(eps @ eps)
        g[columns[i]] += psi.T @ eps
        H[np.ix_(columns[i], columns[i])] += psi.T @ psi
        samples += int(predictor.series[i].measured.sum())
    return Normal(cost, g, H, samples)


def choose_disturbance(problem: Problem, records: Sequence[Record]) -> Disturbance | None:
    """The noise for K; the level of white torque noise that predicts best, if it is not given."""
    if problem.predictor == "output-error" or problem.K is not None:
        return None
    given = problem.disturbance or Disturbance()
    if given.torque is not None:
        return given
    unit = given.output * _ratio(records)

    def noise(level: float) -> Disturbance:
        return replace(given, torque=level * unit, slow=level * unit if given.slow else 0.0)

    costs = {level: _cost(problem, records[:1], noise(level)) for level in _LEVELS}
    while (best := min(costs, key=costs.__getitem__)) in (min(costs), max(costs)) and len(
        costs
    ) < _MOST_LEVELS:
        beyond = best * (10.0 if best == max(costs) else 0.1)
        costs[beyond] = _cost(problem, records[:1], noise(beyond))
    return noise(best)


def _ratio(records: Sequence[Record]) -> float:
    """Root mean square of the torque over that of the output."""
    u = np.concatenate([r.u for r in records])
    y = np.concatenate([r.y[r.measured] for r in records])
    sizes = float(u.std()), float(y.std())
    return sizes[0] / sizes[1] if min(sizes) > 0 else 1.0


def _cost(problem: Problem, records: Sequence[Record], noise: Disturbance) -> float:
    """At the start: without derivatives by fixed entries, which are most of the work."""
    held = replace(problem, free=tuple(problem.varying), free_delay=False, initial="first")
    predictor = Predictor(held, records, noise)
    return criterion(predictor, predictor.start()).cost


def _search(predictor: Predictor, most: int, progress: Progress | None) -> End:
    xi = predictor.start()
    longest, clipped = np.full((2, xi.size), np.inf)
    for k, entry in enumerate(predictor.layout.entries):
        if entry.name.startswith(LEVEL):
            clipped[k] = _LEVEL_STEP
        elif entry.log:
            longest[k] = STEP

    def evaluate(at: Floats) -> Normal:
        return criterion(predictor, at)

    return minimise(evaluate, xi, predictor.bounds(), longest, clipped, most, progress)
