"""Holds parameters that the records do not determine, so that the others are meaningful and can be monitored.

If the estimates of two parameters are strongly correlated, such as viscous and Coulomb friction at nearly one speed,
one of them is held.  The prediction is as good as before, the standard deviation of the other is small enough for a
monitor, and its alarm stands for both.  The held one keeps its configured value if that agrees with the records,
otherwise its estimate.  A prior around the configured value would give the same prediction, but the standard deviations
of both would depend on the width of the prior, which is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.parameter_names import split_name, value_of, with_values
from monitor_core.excitation.accuracy import POOR
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.problem import RELATIVE, Problem
from monitor_core.settings import DOUBTFUL, TOGETHER

_AGREES = 3.0
"""A configured value agrees with an estimate within this number of standard deviations."""


class HeldParameter(NamedTuple):
    """A parameter to hold, with its value and the reason."""

    name: str
    value: float
    reason: str


def hold_undetermined(
    found: Estimate,
    configured: Mapping[str, float],
    monitored: Collection[str],
    refit: Callable[[Problem], Estimate],
) -> tuple[Estimate, dict[str, str]]:
    """Hold parameters one by one until the records determine the remaining ones; the last fit, and why each is held.

    ``found``: the fit with all of them free.  ``configured``: values given by the user, by parameter.  ``monitored``:
    of two correlated parameters, one that will not be monitored is held.
    """
    monitored = {split_name(name)[0] for name in monitored}
    held = dict[str, str]()
    while len(found.problem.free) > 1 and (hold := _next(found, configured, monitored)):
        try:
            again = refit(_without(found.problem, hold))
        except ValueError:
            break
        found = replace(again, started_from=found.started_from)
        held[split_name(hold.name)[0]] = hold.reason
    return found, held


def hold_offset(problem: Problem, monitored: Collection[str]) -> tuple[Problem, dict[str, str]]:
    """Hold constant torques of an axis that moves in one direction only, as they cannot be told from Coulomb friction.

    The fit would separate the two by the few samples of each start, and both would be wrong.
    """
    friction = set(friction_of(problem.drive).coulomb) & set(problem.free)
    if not friction:
        return problem, {}
    watched = {split_name(name)[0] for name in monitored}
    offsets = [
        name
        for name in problem.drive.constant_torques()
        if name in problem.free and name not in problem.varying and name not in watched
    ]
    reason = f"the axis moves in one direction only, so it cannot be told from {', '.join(sorted(friction))}"
    free = tuple(name for name in problem.free if name not in offsets)
    return replace(problem, free=free), dict.fromkeys(offsets, reason)


def _without(problem: Problem, hold: HeldParameter) -> Problem:
    nominal = with_values(problem.nominal, [hold.name], [hold.value])
    bounds = {name: bound for name, bound in problem.bounds.items() if name != hold.name}
    free = tuple(name for name in problem.free if name != hold.name)
    return replace(problem, nominal=nominal, free=free, bounds=bounds)


def _next(found: Estimate, configured: Mapping[str, float], monitored: Collection[str]) -> HeldParameter | None:
    """The parameter to hold first: one that is zero, then one that the records do not show, then one of a pair."""
    table = _Table(found, monitored)
    for name in table.names:
        if found.drive.parameter(name).nonnegative and table.theta[name] == 0:
            if (partners := table.partners(name)) and _agrees(name, table, configured):
                return _kept(name, table.together(name, partners[0]), table, configured)
            return HeldParameter(name, 0.0, "zero: it has no effect in the records")
    if lost := [name for name in table.names if not np.isfinite(table.sd[name])]:
        first = min(lost, key=lambda name: (name not in RELATIVE, *table.rank(name)))
        return _kept(first, "the records do not determine it", table, configured)
    # Where a negative value makes no sense, one about zero is not determined.
    signless = [name for name in table.names if found.drive.parameter(name).least == 0]
    poor = [name for name in signless if table.relative(name) > POOR]
    if poor:
        worst = max(poor, key=table.relative)
        name = table.weakest(worst, table.partners(worst))
        if name == worst:
            return _kept(name, "it has hardly any effect in the records", table, configured)
        return _kept(name, table.together(name, worst), table, configured)
    for name in sorted(table.names, key=table.relative, reverse=True):
        if table.relative(name) > DOUBTFUL and (partners := table.partners(name)):
            weakest = table.weakest(name, partners)
            other = name if weakest != name else partners[0]
            return _kept(weakest, table.together(weakest, other), table, configured)
    return None


def _kept(name: str, reason: str, table: _Table, configured: Mapping[str, float]) -> HeldParameter:
    if _agrees(name, table, configured):
        return HeldParameter(name, value_of(configured, name), f"{reason}; configured value")
    return HeldParameter(name, table.theta[name], f"{reason}; its estimate")


def _agrees(name: str, table: _Table, configured: Mapping[str, float]) -> bool:
    """Whether the records do not contradict a configured value other than zero."""
    if not configured.get(split_name(name)[0]):
        return False
    return not abs(value_of(configured, name) - table.theta[name]) > _AGREES * table.sd[name]


class _Table:
    """The estimates that may be held, which are those that do not follow a signal."""

    def __init__(self, found: Estimate, monitored: Collection[str]) -> None:
        self._found, self._monitored = found, monitored
        self.names = [name for name in found.problem.free if name not in found.problem.varying]
        self._place = place = {name: k for k, name in enumerate(found.names)}
        self.theta = {name: float(found.theta[place[name]]) for name in self.names}
        self.sd = {name: float(found.sd[place[name]]) for name in self.names}

    def relative(self, name: str) -> float:
        """Standard deviation over the value."""
        return self.sd[name] / max(abs(self.theta[name]), 1e-300)

    def rank(self, name: str) -> tuple[bool, float]:
        """Order in which parameters are held: those that are not monitored first, then the less determined."""
        return split_name(name)[0] in self._monitored, -self.relative(name)

    def partners(self, name: str) -> list[str]:
        """Parameters whose estimates are correlated with this one, the strongest correlation first."""
        row = self._found.correlation[self._place[name]]
        r = {other: abs(float(row[self._place[other]])) for other in self.names if other != name}
        return sorted((other for other in r if r[other] > TOGETHER), key=lambda other: -r[other])

    def weakest(self, name: str, partners: list[str]) -> str:
        """The one to hold, of a parameter and its closest partner."""
        return min([name, *partners[:1]], key=self.rank)

    def together(self, name: str, other: str) -> str:
        """The reason for holding one of two correlated parameters, in words."""
        r = float(self._found.correlation[self._place[name], self._place[other]])
        return f"the records do not distinguish it from {other} (correlation {r:.2f})"
