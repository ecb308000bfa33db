"""A fit with friction that follows the measured temperature, or else the heat that the motion leaves in the axis."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from monitor_core.drive.thermal_state import ThermalStart
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.parameter_selection import ScheduledTerm, with_terms
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal.measured_temperature import following_temperature, is_of_the_gear
from monitor_core.identification.thermal.temperature_source import follows_motion, temperature_courses
from monitor_core.identification.thermal.warm_up import FoundWarmUp, find_warm_up, following, heated_as


class WarmedFit(NamedTuple):
    """A fit with friction that falls as the axis warms up, the records for it, and what follows the temperature."""

    estimate: Estimate
    records: Sequence[Record]
    terms: Sequence[ScheduledTerm]
    warm_up: FoundWarmUp | None
    """Of an axis whose heat is not measured; None: its temperature is"""
    errors: Mapping[str, float]
    """What the followers of a measured temperature are off by beside it; empty: they follow the heat"""
    share: float | None = None
    """What the measured temperature explains of what the heat explains; None: the records show one of both at most"""
    follows_motion: bool | None = None
    """Whether the measured temperature follows the motion; None: the records do not tell"""

    @property
    def followers(self) -> tuple[str, ...]:
        """The parameters that follow it."""
        return tuple(term.parameter for term in self.terms)

    def validation(self, records: Sequence[Record]) -> Sequence[Record]:
        """Further records with what the parameters follow."""
        if self.warm_up is not None:
            return heated_as(self.estimate, self.warm_up, self.terms, records)
        return tuple(with_terms(record, self.terms) for record in records)


def warmed_fit(
    found: Estimate,
    records: Sequence[Record],
    followers: Sequence[str],
    refit: Callable[[Problem, Sequence[Record]], Estimate],
    thermal: ThermalStart,
    begins_s: Sequence[float | None],
) -> WarmedFit | None:
    """The fit with friction that follows the measured temperature or the heat; None: the records show neither.

    The temperature is taken unless it explains little of what the heat explains: it may be that of the winding or of a
    board, or, if it does not follow the motion, that of a cabinet.

    Args:
        found: the fit with constant friction.
        records: to which it was fitted.
        followers: names of its friction parameters that may follow.
        refit: fits a changed problem to records.
        thermal: how warm the axis is at the start of the first record.
        begins_s: clock times of the records' first samples [s]; None: not known.
    """
    measured, heated = None, None
    # A fit that explains nothing, or all, has no errors to learn from.
    with suppress(ValueError, np.linalg.LinAlgError):
        if follows := following_temperature(found, records, followers, refit):
            of_axis = follows_motion(temperature_courses(found, records), thermal == "cold")
            measured = _if_better(WarmedFit(*follows[:3], None, follows.errors, follows_motion=of_axis), found)
    with suppress(ValueError, np.linalg.LinAlgError):
        if warm_up := find_warm_up(found, records, followers, thermal, begins_s):
            heated = _if_better(WarmedFit(*following(found, warm_up, records, refit), warm_up, {}), found)
    if measured is None or heated is None:
        return measured or heated
    share = (found.cost - measured.estimate.cost) / (found.cost - heated.estimate.cost)
    taken = measured if is_of_the_gear(share, measured.follows_motion) else heated
    return taken._replace(share=share, follows_motion=measured.follows_motion)


def _if_better(fit: WarmedFit, found: Estimate) -> WarmedFit | None:
    """A fit that explains more than that with constant friction; None: it does not."""
    return fit if fit.estimate.converged and fit.estimate.cost < found.cost else None
