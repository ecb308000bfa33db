"""The prediction-error criterion of a problem on records, and its minimum, with or without outliers."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.drive.structure import DELAY, DISTURBANCE_TIME
from monitor_core.identification.greybox.levenberg_marquardt import (
    NEARLY,
    STEP,
    UNDAMPED,
    NormalEquations,
    Region,
    SearchResult,
    minimise,
)
from monitor_core.identification.predictor.parameter_vector import LEVEL
from monitor_core.identification.predictor.prediction_errors import Errors, RecordPredictor
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.identification.records.measured_record import Record

HUBER = 1.345
"""Errors beyond this number of standard deviations count linearly; 95 % efficient for normal errors."""
_ROUNDS = 3
_START_STEPS = 10
_JITTER = 1e-3
_NEAR = 1e-3
_BEYOND = 0.01
_LEVEL_STEP = 1.5
"""Longest step of a noise level, so that a level that hardly matters does not shorten the steps of other entries."""
_LEVELS = (1e-2, 1e-1, 1.0, 1e1, 1e2)
"""Candidates of the ratio of torque noise to output noise, in units of the ratio of the signals"""
_MOST_LEVELS = 11
"""Largest number of candidates, with further ones if the first or the last predicts best: an angle that travels far is
large compared with its noise."""

FitProgress = Callable[[int, float], None]
"""Called with the number of evaluations and the cost whenever the cost has fallen."""


class Fitted(NamedTuple):
    """The end of a search, the limit of Huber's loss (infinite: squares), and outputs omitted of each record."""

    predictor: RecordPredictor
    end: SearchResult
    limit: float = np.inf
    outliers: tuple[int, ...] = ()


def solve(problem: Problem, records: Sequence[Record], most: int, progress: FitProgress | None) -> Fitted:
    """The minimum next to the start of the problem.

    Raises:
        ValueError: the predictor is unstable at the start.
    """
    predictor = RecordPredictor(problem, records, choose_disturbance(problem, records))
    end = _search(predictor, predictor.start(), np.inf, most, progress)
    predictor, end = _across_intervals(predictor, end, records, most, progress)
    if problem.loss == "squares":
        return Fitted(predictor, end)
    limit = np.inf
    for _ in range(_ROUNDS):
        errors = zip(predictor.errors(end.xi), predictor.series, strict=True)
        counted = np.concatenate([e.eps[s.counts > 0] for e, s in errors])
        limit = HUBER * float(1.4826 * np.median(np.abs(counted)))  # their standard deviation, robustly
        again = _search(predictor, end.xi, limit, most, progress)
        end = again._replace(evaluations=end.evaluations + again.evaluations)
    return Fitted(predictor, end, limit)


def _across_intervals(
    predictor: RecordPredictor, end: SearchResult, records: Sequence[Record], most: int, progress: FitProgress | None
) -> tuple[RecordPredictor, SearchResult]:
    """A delay at a limit of its interval continues in the next one, as long as that is better."""
    while (side := _held_at(predictor, end)) and all(r.jitter_s < _JITTER * r.interval_s for r in records):
        problem = settled(predictor, end.xi)
        problem = replace(problem, delay_s=problem.delay_s + side * _BEYOND * predictor.interval_s)
        try:
            following = RecordPredictor(problem, records, problem.disturbance)
            found = _search(following, following.start(), np.inf, most, progress)
        except ValueError:
            break
        if not found.normal.cost < end.normal.cost:
            break
        predictor, end = following, found._replace(evaluations=end.evaluations + found.evaluations)
    return predictor, end


def _held_at(predictor: RecordPredictor, end: SearchResult) -> int:
    """-1 or 1 if the delay is at the lower or upper limit of its interval; 0: neither, or at a bound of the user."""
    layout = predictor.layout
    if not layout.free_delay:
        return 0
    k = layout.names.index(DELAY)
    lower, upper = (float(bound[k]) for bound in layout.bounds())
    near, low_high = _NEAR * predictor.interval_s, predictor.problem.bounds.get(DELAY, (-np.inf, np.inf))
    if end.xi[k] <= lower + near:
        return -1 if lower > low_high[0] else 0
    return 1 if end.xi[k] >= upper - near and upper < low_high[1] else 0


def settled(predictor: RecordPredictor, xi: Floats) -> Problem:
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


def fit_starts(predictor: RecordPredictor) -> Floats:
    """The vector with the initial states that fit best; all other entries are those of the start.

    Without friction and gravity of the simulated motion the errors are linear in the initial states: one step suffices.
    Otherwise the cost is rough, and the search ends after some steps close to the minimum.
    """
    xi, shared = predictor.start(), predictor.layout.shared
    if xi.size == shared:
        return xi

    def evaluate(own: Floats) -> NormalEquations:
        errors = predictor.errors_by_starts(np.concatenate([xi[:shared], own]))
        columns = np.split(np.arange(own.size), len(errors))
        return _normal(predictor, errors, columns, np.ones(own.size), np.inf)

    own, region = xi[shared:], Region(clipped=predictor.farthest_starts())
    try:
        found = minimise(evaluate, own, region, _START_STEPS, None, UNDAMPED, NEARLY).xi
    except ValueError:
        found = own
    return np.concatenate([xi[:shared], found])


def criterion(predictor: RecordPredictor, xi: Floats, limit: float) -> NormalEquations:
    """Sum of squared errors over all records (Huber's loss: linear beyond ``limit``) and its Gauss-Newton model.

    The cost is infinite where the prediction runs away.
    """
    errors = predictor.errors(xi)
    columns = [predictor.columns(i) for i in range(len(errors))]
    return _normal(predictor, errors, columns, predictor.layout.rates(xi), limit)


def _normal(
    predictor: RecordPredictor, errors: Sequence[Errors], columns: Sequence[Ints], rates: Floats, limit: float
) -> NormalEquations:
    """The model of these errors, whose psi are by these entries of a vector; ``rates`` (P,): d number / d entry."""
    P = rates.size
    cost, g, H, samples = 0.0, np.zeros(P), np.zeros((P, P)), 0
    with np.errstate(all="ignore"):  # errors may be finite while their squares are not
        for i, (eps, psi, good) in enumerate(errors):
            if not good:
                return NormalEquations(np.inf, g, H, samples)
            weight = np.minimum(1.0, limit / np.maximum(np.abs(eps), 1e-300)) if limit < np.inf else None
            weighted = psi if weight is None else psi * weight[:, None]
            cost += _loss(eps, limit)
            g[columns[i]] += weighted.T @ eps
            H[np.ix_(columns[i], columns[i])] += weighted.T @ psi
            samples += int(predictor.series[i].counts.sum())
        g, H = g * rates, H * np.outer(rates, rates)
        return NormalEquations(cost if np.isfinite(cost + H.sum()) else np.inf, g, H, samples)


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
    while True:
        best = min(costs, key=costs.__getitem__)
        if min(costs) < best < max(costs) or len(costs) >= _MOST_LEVELS:
            return noise(best)
        beyond = best * (10.0 if best == max(costs) else 0.1)
        costs[beyond] = _cost(problem, records[:1], noise(beyond))


def _ratio(records: Sequence[Record]) -> float:
    """Root mean square of the torque over that of the output."""
    u = np.concatenate([r.u for r in records])
    y = np.concatenate([r.y[r.measured] for r in records])
    sizes = float(u.std()), float(y.std())
    return sizes[0] / sizes[1] if min(sizes) > 0 else 1.0


def _cost(problem: Problem, records: Sequence[Record], noise: Disturbance) -> float:
    """Cost at the start, without derivatives by fixed entries, which are most of the work."""
    held = replace(problem, free=tuple(problem.varying), free_delay=False, initial="first")
    predictor = RecordPredictor(held, records, noise)
    return criterion(predictor, predictor.start(), np.inf).cost


def _search(
    predictor: RecordPredictor, xi: Floats, limit: float, most: int, progress: FitProgress | None
) -> SearchResult:
    longest, clipped = np.full((2, xi.size), np.inf)
    # Of an axis that stands at first, with errors that count from min_speed on, nothing determines the initial state.
    clipped[predictor.layout.shared :] = predictor.farthest_starts()
    for k, entry in enumerate(predictor.layout.entries):
        if entry.name.startswith(LEVEL):
            clipped[k] = _LEVEL_STEP
        elif entry.log:
            longest[k] = STEP

    def evaluate(at: Floats) -> NormalEquations:
        return criterion(predictor, at, limit)

    return minimise(evaluate, xi, Region(*predictor.bounds(), longest, clipped), most, progress)


def _loss(eps: Floats, limit: float) -> float:
    size = np.abs(eps)
    if not limit < np.inf:
        return float(eps @ eps)
    return float(np.sum(np.where(size <= limit, size**2, 2 * limit * size - limit**2)))


# --- Outliers: in the innovations form K carries each outlier on in the state, whatever the loss ----------------------


OUTLIER_SIGMAS = 5.0
"""Limit of gross errors in standard deviations; one normal error in 1.7 million is beyond it."""

_CARRIED = 20
"""Number of samples that an outlier may disturb: gross errors this close after it are computed again without it."""

_MAX_PASSES = 20
"""Number of passes.  In the last one all gross errors count: a stretch in which nothing fits is not split further."""


def without_outliers(fitted: Fitted, most: int, progress: FitProgress | None) -> Fitted:
    """Repeat a fit with Huber's loss without outliers, the outputs with gross errors.

    Only with a gain: in a simulation an outlier affects only its own error, which is clipped.
    """
    predictor, end, limit, _ = fitted
    if not (limit < np.inf and predictor.gain(end.xi).K.any()):
        return fitted
    gross = outliers(predictor, end.xi, OUTLIER_SIGMAS / HUBER * limit)
    if not any(which.any() for which in gross):
        return fitted
    try:
        again = solve(settled(predictor, end.xi), _without(predictor, gross), most, progress)
    except ValueError:  # a value at its bound may start beyond it by rounding
        return fitted
    found = again.end._replace(evaluations=end.evaluations + again.end.evaluations)
    return again._replace(end=found, outliers=tuple(int(np.count_nonzero(which)) for which in gross))


def outliers(predictor: RecordPredictor, xi: Floats, limit: float) -> list[Bools]:
    """Masks (N,), by record, of outputs whose errors exceed the limit by themselves, not because K carried others on.

    Of gross errors in close succession only the first counts; then the errors are computed again without it.
    """
    found = [np.zeros(len(s.record), dtype=np.bool_) for s in predictor.series]
    looking = predictor
    for look in range(_MAX_PASSES):
        gross = [np.abs(e.eps) > limit for e in looking.errors(xi)]
        if not any(which.any() for which in gross):
            break
        last = look == _MAX_PASSES - 1
        found = [have | (new if last else _first(new)) for have, new in zip(found, gross, strict=True)]
        looking = RecordPredictor(predictor.problem, _without(predictor, found), predictor.disturbance)
    return found


def _first(gross: Bools) -> Bools:
    """The gross errors without another one shortly before."""
    before = np.cumsum(np.concatenate([np.zeros(_CARRIED + 1, dtype=np.int64), gross]))
    return np.asarray(gross & (before[_CARRIED:-1] == before[: -_CARRIED - 1]))


def _without(predictor: RecordPredictor, which: Sequence[Bools]) -> list[Record]:
    return [s.record.without(these) for s, these in zip(predictor.series, which, strict=True)]
