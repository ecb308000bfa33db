"""Finds the warm-up in records: the time constant of the heat, and the dependence of friction on it.

The drive is fitted with constant friction first.  Near that fit the prediction errors are linear in the parameters,

    eps(t) = psi(t)' delta(t),     delta(t) = c + s (heat(t) - mean),

with a constant part c of each parameter and slopes s of the friction that follows the heat.  The records enter only by
sums of psi psi' and psi eps over short windows, within which the heat is constant.  So c and s are a least-squares
problem for given time constant and heats at the starts of the records; these are searched for.

A first record that begins cold makes the slopes certain: with a uniform motion, a record that begins at an unknown heat
shows how friction falls, but not from which heat.  The errors of friction that the heat does not explain are estimated
on windows that a fit has not used (``model_errors``).  A record that follows another one in time, without a motion in
between, begins with the heat that is left after the pause; any other one begins with an unknown heat.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.friction_roles import braking
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.structure import Output
from monitor_core.drive.thermal_state import GAP_S, HEAT, MOVED, ThermalModel, ThermalStart, ThermalState
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.parameter_selection import ScheduledTerm, scheduled_terms, with_terms
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal.law_errors import PARTS, deviations_in_groups, worst_error
from monitor_core.identification.thermal.warm_up_search import (
    ONE,
    HeatProportions,
    Search,
    WarmUpFit,
    chosen,
    heat_course,
    kept_by,
    left_of,
)
from monitor_core.identification.thermal.warm_up_windows import Windows, speeds_of, windows_of

LEAST_MOTION_S = 60.0
"""Records with less motion are not searched for a warm-up."""
AMBIENT_SHARE = 0.25
"""Standard deviation of the ambient heat, in largest heats of the records: a gearbox becomes 10 to 30 degrees warmer
than the hall, which is 3 to 5 degrees colder or warmer from day to day."""
_A_LITTLE = 0.01
"""Relative change of the friction, used to see whether all of it falls"""
_STANDS = 0.05
"""The axis stands below this share of the root mean square of the speed."""


@dataclass(frozen=True)
class FoundWarmUp:
    """A warm-up that the records show.

    Attributes:
        model: time constant, friction for the power, largest heat.
        slopes: of the parameters that follow the heat, by name, with their standard deviations.
        starts: heat of each part at the first sample of each record [W].
        ambients: ambient heat of each record [W], relative to that of the first; 0: the records do not show it.
        errors: standard deviation of the errors of friction that the heat does not explain, by name of each parameter
            that might follow it; for one that does not, its warm-up is part of the error.
        judged: whether the records are long enough to estimate these errors.  If not, an error is half of the change
            with the heat, as for a law that is only known to explain these records.
    """

    model: ThermalModel
    slopes: dict[str, tuple[float, float]]
    starts: tuple[tuple[float, ...], ...]
    ambients: tuple[float, ...]
    errors: dict[str, float] = field(default_factory=dict)
    judged: bool = True


def moving_s(records: Sequence[Record]) -> float:
    """Time for which the axis moves in records [s]."""
    total = 0.0
    for record in records:
        speed, h = speeds_of(record)
        size = math.sqrt(float(np.mean(speed**2))) if speed.size else 0.0
        total += float(h[speed > _STANDS * size].sum())
    return total


def find_warm_up(
    found: Estimate,
    records: Sequence[Record],
    followers: Sequence[str],
    start: ThermalStart = "cold",
    begins_s: Sequence[float | None] = (),
) -> FoundWarmUp | None:
    """The warm-up in records, from a fit of them with constant friction; None: they do not show one.

    ``followers``: free parameters that may follow the heat.  ``start``: how the first record begins.  ``begins_s``:
    clock times of the first samples [s]; None or empty: unknown.
    """
    fm, fc = braking(found.drive, found.values)
    if not followers or not fm + fc > 0:
        return None
    unit = ThermalModel(1.0, fm, fc, 1.0)
    names, windows = windows_of(found, records, unit)
    index = [names.index(name) for name in followers if name in names]
    carried = _carried(records, [*begins_s, *[None] * len(records)][: len(records)], found.drive.output)
    search = Search(windows, index, carried, start)
    if search.highest <= 0:
        return None
    fit = chosen(search, [found.values[names[i]] for i in index])
    if fit is None:
        return None
    search = search.with_halls() if any(fit.ambients) else search
    slopes = {names[i]: (float(s), float(sd)) for i, s, sd in zip(fit.which, fit.slopes, fit.sd, strict=True)}
    if not _falls(found, slopes, records):
        return None
    errors = model_errors(search, fit.which, fit.shape)
    judged = bool(np.isfinite(errors).all())
    starts, model = tuple(fit.starts), replace(fit.model, fm=fm, fc=fc, largest=search.highest)
    heats = [with_heat(record, model, parts) for record, parts in zip(records, starts, strict=True)]
    largest = max(float(record.signals[HEAT].max()) for record in heats)
    others = fit.ambients[1:] or [0.0]
    ambient = max(AMBIENT_SHARE * largest, math.sqrt(float(np.mean(np.square(others)))))
    if judged:
        off = {names[i]: float(errors[i]) for i in index}
    else:
        off = {name: abs(slope) * largest / 2 for name, (slope, _) in slopes.items()}
    model = replace(model, largest=largest, ambient=ambient)
    return FoundWarmUp(model, slopes, starts, tuple(fit.ambients), off, judged)


def _falls(found: Estimate, slopes: Mapping[str, tuple[float, float]], records: Sequence[Record]) -> bool:
    """Whether friction falls as the axis warms up, at the root mean square of its speed, as that of a gear does.

    What rises in a record is no warm-up, but something else that has changed on the way, as where the axis moves.
    """
    step = _A_LITTLE * min(abs(found.values[name] / slope) for name, (slope, _) in slopes.items())
    warmer = {name: found.values[name] + step * slope for name, (slope, _) in slopes.items()}
    cold, warm = (np.array(braking(found.drive, {**found.values, **more})) for more in ({}, warmer))
    speed = math.sqrt(float(np.mean(np.concatenate([speeds_of(record)[0] for record in records]) ** 2)))
    return bool((warm - cold) @ (speed, 1.0) < 0)


def following(
    found: Estimate,
    warm_up: FoundWarmUp,
    records: Sequence[Record],
    refit: Callable[[Problem, Sequence[Record]], Estimate],
) -> tuple[Estimate, tuple[Record, ...], tuple[ScheduledTerm, ...]]:
    """The fit again, with friction that follows the heat; the records with their heat; and what follows it.

    Raises:
        ValueError: the fit cannot start.
    """
    begins = zip(records, warm_up.starts, warm_up.ambients, strict=True)
    heated = [with_heat(record, warm_up.model, start, ambient) for record, start, ambient in begins]
    before, schedule = found.problem, dict.fromkeys(warm_up.slopes, (HEAT,))
    scheduled = scheduled_terms(schedule, heated)
    heated = [with_terms(record, scheduled) for record in heated]
    slopes = {f"{name} per {HEAT}": slope for name, (slope, _) in warm_up.slopes.items()}
    problem = replace(before, varying={**before.varying, **schedule}, slopes={**before.slopes, **slopes})
    again = refit(problem, heated)
    return replace(again, started_from=found.started_from), tuple(heated), scheduled


def heated_as(
    found: Estimate, warm_up: FoundWarmUp, scheduled: Sequence[ScheduledTerm], records: Sequence[Record]
) -> tuple[Record, ...]:
    """Further records with their heat, from the heat at the start, and of the hall, that explain friction best."""
    heated = [with_heat(record, warm_up.model, *_start_of(found, warm_up, scheduled, record)) for record in records]
    return tuple(with_terms(record, scheduled) for record in heated)


def _start_of(
    found: Estimate, warm_up: FoundWarmUp, scheduled: Sequence[ScheduledTerm], record: Record
) -> tuple[tuple[float, ...], float]:
    """Heat of each part at the first sample of a record, and its ambient heat [W], with the slopes of a fit.

    All parts are as warm.  The expectation of both is that of an unknown heat in the hall of the first record.
    """
    varying = {name: terms for name, terms in found.problem.varying.items() if terms != (HEAT,)}
    problem, model = replace(found.problem, varying=varying), warm_up.model
    names, (w,) = windows_of(replace(found, problem=problem), [record], model)
    values = dict(zip(found.names, found.theta.tolist(), strict=True))
    index, s = [names.index(term.parameter) for term in scheduled], [values[term.slope] for term in scheduled]
    I, b, slope = w.information[:, index][:, :, index], w.score[:, index], np.array(s)
    expected = model.largest / 2
    kept = kept_by(model, w.middle_s)
    heat: Floats = expected * kept + np.sum(
        [share * heat_course(w.power, 0.0, tau_s)[0] for tau_s, share in model.parts], axis=0
    )
    off = b - np.einsum("wij,wj->wi", I, (heat - scheduled[0].reference)[:, np.newaxis] * slope)
    courses = np.array([kept, np.ones(kept.size)])
    weights = np.einsum("aw,bw,i,wij,j->ab", courses, courses, slope, I, slope)
    prior = np.diag(1 / np.array([expected, max(model.ambient, 1e-6 * model.largest)]) ** 2)
    start, ambient = np.linalg.solve(weights + prior, courses @ off @ slope).tolist()
    return (min(max(expected + start, 0.0), model.largest),) * len(model.parts), ambient


def with_heat(record: Record, model: ThermalModel, start: tuple[float, ...], ambient: float = 0.0) -> Record:
    """The record with its heat as a further signal, from that of each part at its first sample and its hall [W]."""
    state, t_us = ThermalState(replace(model, start="cold")), np.rint(record.t * 1e6).astype(np.int64)
    state.parts, state.ambient = start, ambient
    heat = state.take(t_us, MeasuredSpeed(record.quantity).take(t_us, record.y))
    return replace(record, signals={**record.signals, HEAT: heat})


def _carried(records: Sequence[Record], begins_s: Sequence[float | None], output: Output) -> list[float | None]:
    """Pause before each record that follows the one before it [s]; None: it follows none."""
    pauses: list[float | None] = [None]
    for k, (before, record) in enumerate(pairwise(records)):
        begun, begins = begins_s[k], begins_s[k + 1]
        pause = None if begun is None or begins is None else begins - begun - before.duration_s
        way = abs(record.y[record.measured][0] - before.y[before.measured][-1])
        known = pause is not None and pause >= 0
        stood = pause is not None and (pause <= GAP_S or not (output == "angle" and way > MOVED))
        pauses.append(pause if known and stood else None)
    return pauses


# --- Model errors of the warm-up: deviations of friction that the heat does not explain -------------------------------


# One or two time constants and straight lines do not describe any gearbox exactly.  The remaining error is estimated on
# windows that the fit has not used (``law_errors``):
#
# * the beginning, the middle and the end of each record, with the fit to the other records, as on another day;
# * the last third of each record, with the fit to the part before, as for an axis that becomes warmer than its records.


def model_errors(search: Search, index: list[int], shape: HeatProportions = ONE) -> Floats:
    """Standard deviation of the errors of the parameters (p,) that the heat does not explain, in their units.

    NaN where the records are too short for that.

    Args:
        search: the search that has found the warm-up in the records.
        index: parameters that follow the heat.
        shape: proportions of its time constants.
    """
    windows = search.windows
    search = Search(windows, index, search.carried, search.start, search.halls)
    days = [course for seen in _days(search) for course in _deviations(search, shape, seen)]
    but_last = [np.arange(w.power.size) < w.power.size * (PARTS - 1) / PARTS for w in windows]
    return worst_error(days, _deviations(search, shape, but_last), windows[0].score.shape[1])


def _days(search: Search) -> Iterator[list[Bools]]:
    """Which windows (W,) of each record the fit sees: all but those of one record.

    The fit needs a record that begins at a known heat, if there is one.
    """
    windows, known = search.windows, [search.start == "cold"]
    for pause in search.carried[1:]:
        known.append(pause is not None and known[-1])
    for k in range(len(windows) if len(windows) > 1 else 0):
        if any(known[:k] + known[k + 1 :]) or not any(known):
            yield [np.full(w.power.size, j != k) for j, w in enumerate(windows)]


def _deviations(search: Search, shape: HeatProportions, seen: Sequence[Bools]) -> list[Floats]:
    """Deviations of the parameters (G, p) in the groups of windows of each record that the fit does not see."""
    windows, fit, found = search.windows, search.seeing(seen).best(search.index, shape), list[Floats]()
    for k, (w, by, left) in enumerate(zip(windows, seen, left_of(windows, fit), strict=True)):
        if by.all():
            continue
        if not by.any():
            left = _as_observed(w, fit, left, k in search.free)
        found.append(deviations_in_groups(w, left, int(np.argmin(by))))
    return found


def _as_observed(w: Windows, fit: WarmUpFit, left: Floats, free: bool) -> Floats:
    """Scores (W, p) that are left with the likeliest heat, as the daemon observes it, in a record that no fit has seen.

    ``free``: whether the heat at its start is unknown; that of its hall always is.
    """
    slopes = np.zeros(left.shape[1])
    slopes[fit.which] = fit.slopes
    courses = [np.ones(w.middle_s.size), *([kept_by(fit.model, w.middle_s)] if free else [])]
    more = [np.einsum("wij,j,w->wi", w.information, slopes, course) for course in courses]
    weights = np.array([[course @ other @ slopes for other in more] for course in courses])
    found = np.linalg.lstsq(weights, np.array([course @ left @ slopes for course in courses]), rcond=1e-9)[0]
    return np.asarray(left - np.tensordot(found, more, 1))
