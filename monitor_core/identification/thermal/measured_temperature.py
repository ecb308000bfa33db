"""Friction that follows the measured temperature of an axis, if the records show it.

The drive is fitted with constant friction first.  Then its friction parameters follow the signal,

    theta(t) = value + slope (temperature(t) - reference),

and those whose slopes the records show are kept.  A thermometer beside the gear follows it late, in whole degrees, and
friction is not a straight line over it.  What that leaves is estimated as the errors of the thermal state are
(``law_errors``), and the tests allow for it.

The thermal state of ``warm_up`` stands in for a temperature that nobody measures.  ``is_of_the_gear`` chooses between
both.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.operating_conditions import MARGIN
from monitor_core.drive.parameter_names import slope_name
from monitor_core.drive.thermal_state import TEMPERATURE, ThermalModel
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.parameter_selection import ScheduledTerm, scheduled_terms, with_terms
from monitor_core.identification.problem import IdentificationError, Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal.law_errors import PARTS, deviations_in_groups, worst_error
from monitor_core.identification.thermal.warm_up_search import LEAST_FALL
from monitor_core.identification.thermal.warm_up_windows import Windows, windows_of

_SURE = 5.0
"""Standard deviations of a slope that chance does not reach, also where neighbouring errors are correlated"""
_OF_THE_GEAR = 0.5
"""Least share of what the heat explains that the temperature of a gear explains."""
_STEEPEST = 0.1
"""Largest share by which friction falls for each degree: the viscosity of oils and greases falls by 3 to 8 %."""
_UNIT = ThermalModel(1.0, 0.0, 1.0, 1.0)
"""Any friction: the power of the windows is not used."""


class FollowedTemperature(NamedTuple):
    """A fit with friction that follows the measured temperature, its records, and what follows it.

    ``errors``: standard deviation of what each of these parameters is off by beside the temperature, in its unit.
    """

    estimate: Estimate
    records: tuple[Record, ...]
    terms: tuple[ScheduledTerm, ...]
    errors: Mapping[str, float]


def is_of_the_gear(share: float, follows_motion: bool | None) -> bool:
    """Whether friction follows the temperature rather than the heat; by the share of what the heat explains.

    In the records of a morning or two the heat has the advantage: two time constants of its own, while a thermometer
    lags.  But it is blind to the hall, which may be 10 degrees colder or warmer on another day, as much as an axis
    warms up by itself.  The error of a thermometer that lags is in the records, and ends with the warm-up; that of the
    heat in another hall is in none of them, and lasts all day.  So the temperature is taken unless it misses most of
    what the records show.  One that does not follow the motion, as that of a cabinet, must explain more than the heat.
    """
    return share >= (1.0 if follows_motion is False else _OF_THE_GEAR)


def following_temperature(
    found: Estimate,
    records: Sequence[Record],
    followers: Sequence[str],
    refit: Callable[[Problem, Sequence[Record]], Estimate],
) -> FollowedTemperature | None:
    """The fit again, with friction that follows the signal "temperature"; None: the records do not show that.

    ``followers``: free parameters that may follow it.  One is kept if it falls as the axis becomes warmer, as that of a
    gear does, by 4 % at least within the records and by five standard deviations; and if what it is off by beside the
    temperature, in the worst part of the records, is at most half of that fall: a constant in its middle would do as
    well.  So the temperature of something else is left aside where the records show it, as those of days do whose halls
    are not alike.  None follows a signal with which one would fall by more than a tenth for each degree, as with that
    of a hall, which rises by a degree or two while the axis warms up.

    Raises:
        ValueError: the fit cannot start.
    """
    names = list(followers)
    while names:
        schedule = dict.fromkeys(names, (TEMPERATURE,))
        try:
            terms = scheduled_terms(schedule, records)
            own = tuple(with_terms(record, terms) for record in records)
        except IdentificationError:  # not a signal of these records, or constant
            return None
        before = found.problem
        again = refit(replace(before, varying={**before.varying, **schedule}), own)
        falls = {term.parameter: _fall(again, term) for term in terms}
        if not (again.converged and all(fall > _SURE for fall in falls.values())):
            names.remove(min(names, key=lambda name: falls[name]))
            continue
        if any(_steepness(again, term) > _STEEPEST for term in terms):
            return None
        halves, errors = _half_falls(again, terms), _errors(found, records, again, terms)
        worst = max(names, key=lambda name: errors[name] / halves[name])
        if errors[worst] <= halves[worst]:
            return FollowedTemperature(replace(again, started_from=found.started_from), own, terms, errors)
        names.remove(worst)
    return None


def _steepness(found: Estimate, term: ScheduledTerm) -> float:
    """Share by which a parameter falls for each degree."""
    slopes = dict(zip(found.names, found.theta.tolist(), strict=True))
    return -float(slopes[slope_name(term.parameter, term.term)]) / abs(found.values[term.parameter])


def _half_falls(found: Estimate, terms: Sequence[ScheduledTerm]) -> dict[str, float]:
    """Half of what each parameter changes with the temperature within the records, in its unit."""
    slopes = dict(zip(found.names, found.theta.tolist(), strict=True))
    return {t.parameter: abs(slopes[slope_name(t.parameter, t.term)]) * (t.high - t.low) / 2 for t in terms}


def _fall(found: Estimate, term: ScheduledTerm) -> float:
    """By how many standard deviations a parameter falls with the temperature; zero: by too little to matter."""
    k = found.names.index(slope_name(term.parameter, term.term))
    slope, sd = float(found.theta[k]), float(found.sd[k])
    if not np.isfinite(sd) or -slope * (term.high - term.low) < LEAST_FALL * abs(found.values[term.parameter]):
        return 0.0
    return -slope / sd


# --- What the temperature leaves --------------------------------------------------------------------------------------


def _errors(
    found: Estimate, records: Sequence[Record], again: Estimate, terms: Sequence[ScheduledTerm]
) -> dict[str, float]:
    """Standard deviation of what each parameter is off by beside the temperature, in its unit.

    ``found`` is the fit with constant friction, ``again`` that with slopes.  Where the records are too short to judge
    it, it is half of what the temperature changes in them.
    """
    names, windows = windows_of(found, records, _UNIT)
    index = [names.index(term.parameter) for term in terms]
    temperatures = [
        np.asarray(np.interp(w.middle_s, record.t - record.t[0], record.signals[TEMPERATURE]), np.float64)
        for w, record in zip(windows, records, strict=True)
    ]
    errors = temperature_errors(windows, temperatures, index)
    halves = _half_falls(again, terms)
    return {
        term.parameter: float(errors[i]) if np.isfinite(errors[i]) else halves[term.parameter]
        for term, i in zip(terms, index, strict=True)
    }


def temperature_errors(windows: Sequence[Windows], temperatures: Sequence[Floats], index: Sequence[int]) -> Floats:
    """Standard deviation of the errors of the parameters (p,) beside a line over the temperature, in their units.

    Each record is judged by the line through all of them, which cannot follow a lag; by that through the others, as on
    another day; and its last third by that through what was before.  The latter two count where the temperature is in
    the range of the line, since the monitor tests nothing beyond it.  NaN where the records are too short.

    Args:
        windows: of each record, W of them with p parameters.
        temperatures: in the middle of each window (W,), of each record.
        index: the parameters that follow the temperature.
    """
    everything = [np.ones(w.power.size, np.bool_) for w in windows]
    but_last = [np.arange(w.power.size) < w.power.size * (PARTS - 1) / PARTS for w in windows]
    others = [[by if j != k else ~by for j, by in enumerate(everything)] for k in range(len(windows))]

    def unseen(seen: Sequence[Bools]) -> list[Floats]:
        low, high = _range(np.concatenate([x[by] for x, by in zip(temperatures, seen, strict=True)]))
        judged = [~by & (x >= low) & (x <= high) for x, by in zip(temperatures, seen, strict=True)]
        return _deviations(windows, _left_by_line(windows, temperatures, index, seen), judged)

    own = _deviations(windows, _left_by_line(windows, temperatures, index, everything), everything)
    days = [course for seen in others if len(windows) > 1 for course in unseen(seen)]
    p = windows[0].score.shape[1]
    judged = [worst_error(own, [], p), worst_error(days, [], p), worst_error([], unseen(but_last), p)]
    if not np.isfinite(judged[0]).all():  # some minutes: all of it at once
        judged[0] = worst_error([], own, p)
    return np.asarray(np.fmax.reduce(judged), np.float64)


def _range(temperature: Floats) -> tuple[float, float]:
    """Where a line over these temperatures is used."""
    low, high = float(temperature.min()), float(temperature.max())
    return low - MARGIN * (high - low), high + MARGIN * (high - low)


def _deviations(windows: Sequence[Windows], left: Sequence[Floats], judged: Sequence[Bools]) -> list[Floats]:
    """Deviations (G, p) from a line in groups of the windows of each record that are judged."""
    found = [
        deviations_in_groups(w._replace(power=w.power[by], information=w.information[by]), rest[by])
        for w, rest, by in zip(windows, left, judged, strict=True)
    ]
    return [course for course in found if len(course)]


def _left_by_line(
    windows: Sequence[Windows], temperatures: Sequence[Floats], index: Sequence[int], seen: Sequence[Bools]
) -> list[Floats]:
    """Scores of the windows (W, p) of each record less what a line explains that was fitted to those that are seen."""
    information = np.concatenate([w.information[by] for w, by in zip(windows, seen, strict=True)])
    score = np.concatenate([w.score[by] for w, by in zip(windows, seen, strict=True)])
    warm = np.concatenate([x[by] for x, by in zip(temperatures, seen, strict=True)])
    mean, p = float(warm.mean()), score.shape[1]
    warm = warm - mean
    once, twice = np.tensordot(warm, information, 1)[:, index], np.tensordot(warm**2, information, 1)
    N = np.block([[information.sum(axis=0), once], [once.T, twice[np.ix_(index, index)]]])
    r = np.concatenate([score.sum(axis=0), (warm @ score)[index]])
    size = 1 / np.sqrt(np.maximum(np.diag(N), 1e-300))
    beta = size * np.linalg.lstsq(N * size[:, np.newaxis] * size, size * r, rcond=1e-12)[0]
    slopes = np.zeros(p)
    slopes[list(index)] = beta[p:]
    return [
        w.score - np.einsum("wij,wj->wi", w.information, beta[:p] + (x - mean)[:, np.newaxis] * slopes)
        for w, x in zip(windows, temperatures, strict=True)
    ]
