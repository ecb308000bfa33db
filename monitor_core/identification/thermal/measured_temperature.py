"""Friction that follows the measured temperature of an axis, if the records show it.

The drive is fitted with constant friction first.  Then its friction parameters follow the signal,

    theta(t) = value + slope (temperature(t) - reference),

and those whose slopes the records show are kept.  The thermal state of ``warm_up`` stands in for a temperature that
nobody measures; which of both explains the records better is the caller's to compare.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.drive.parameter_names import slope_name
from monitor_core.drive.thermal_state import TEMPERATURE
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.parameter_selection import ScheduledTerm, scheduled_terms, with_terms
from monitor_core.identification.problem import IdentificationError, Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal.warm_up_search import LEAST_FALL

_SURE = 5.0
"""Standard deviations of a slope that chance does not reach, also where neighbouring errors are correlated"""


class FollowedTemperature(NamedTuple):
    """A fit with friction that follows the measured temperature, its records, and what follows it."""

    estimate: Estimate
    records: tuple[Record, ...]
    terms: tuple[ScheduledTerm, ...]


def following_temperature(
    found: Estimate,
    records: Sequence[Record],
    followers: Sequence[str],
    refit: Callable[[Problem, Sequence[Record]], Estimate],
) -> FollowedTemperature | None:
    """The fit again, with friction that follows the signal "temperature"; None: the records do not show that.

    ``followers``: free parameters that may follow it.  One is kept if it falls as the axis becomes warmer, as that of a
    gear does, by 4 % at least within the records and by five standard deviations.

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
        if again.converged and all(fall > _SURE for fall in falls.values()):
            return FollowedTemperature(replace(again, started_from=found.started_from), own, terms)
        names.remove(min(names, key=lambda name: falls[name]))
    return None


def _fall(found: Estimate, term: ScheduledTerm) -> float:
    """By how many standard deviations a parameter falls with the temperature; zero: by too little to matter."""
    k = found.names.index(slope_name(term.parameter, term.term))
    slope, sd = float(found.theta[k]), float(found.sd[k])
    if not np.isfinite(sd) or -slope * (term.high - term.low) < LEAST_FALL * abs(found.values[term.parameter]):
        return 0.0
    return -slope / sd
