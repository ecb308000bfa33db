"""The result of an identification: estimates, how well they explain the records, and whether they can be used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from monitor_core.drive.structure import DELAY, split_name
from monitor_core.identification.bode import Bode
from monitor_core.identification.greybox import Estimate, Trace
from monitor_core.identification.parameter_selection import ScheduledTerm, Slope
from monitor_core.identification.problem import Problem, value_of
from monitor_core.identification.starting import Growth, masses_of

_SIGNIFICANT = 3.0
"""Standard deviations."""


class Rejection(Enum):
    """Why no nominal values are made of an estimate."""

    NOT_CONVERGED = "not-converged"
    NOT_IDENTIFIABLE = "not-identifiable"
    DELAY_OUT_OF_RANGE = "delay-out-of-range"
    """The daemon can only follow a torque that acts between its sample and the next one."""


class ParameterRow(NamedTuple):
    """One parameter: estimate and standard deviation, and the value before; a held one has no standard deviation."""

    name: str
    unit: str
    meaning: str
    value: float
    sd: float | None
    before: float | None
    held: str = ""
    """Why it is held; empty: it is estimated."""

    @property
    def relative_sd(self) -> float | None:
        """Standard deviation over the value; None where the value is zero."""
        return None if self.sd is None or self.value == 0 else self.sd / abs(self.value)

    @property
    def is_about_zero(self) -> bool:
        """Whether the estimate does not differ significantly from zero."""
        return self.sd is not None and abs(self.value) < _SIGNIFICANT * self.sd

    @property
    def change(self) -> float | None:
        """Relative change of the value before."""
        return None if not self.before else self.value / self.before - 1


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """What ``identify`` returns.

    Attributes:
        start: the problem with the values before the fit.
        estimate: the estimates.
        estimation: traces of the fitted records.
        validation: traces of the records that were kept aside.
        bode: frequency responses of the drive, a black box and the records.
        colour: ratio of the variance of recursive estimates to that with white prediction errors; at least 1.
        growth: the comparison of chains of one, two, .. masses; None: not asked for.
        held: why each held parameter is held.
        unknown: parameters whose values before the fit are only placeholders.
        scheduled: which parameters follow which signals.
    """

    start: Problem
    estimate: Estimate
    estimation: tuple[Trace, ...]
    validation: tuple[Trace, ...]
    bode: Bode
    colour: float
    growth: Growth | None
    held: Mapping[str, str]
    unknown: tuple[str, ...]
    scheduled: tuple[ScheduledTerm, ...]

    @property
    def rejection(self) -> Rejection | None:
        """Why no nominal values should be made of the estimates; None: they can be used."""
        if not self.estimate.converged:
            return Rejection.NOT_CONVERGED
        if self.not_identifiable:
            return Rejection.NOT_IDENTIFIABLE
        if not 0 <= self.delay_s <= self.estimate.interval_s:
            return Rejection.DELAY_OUT_OF_RANGE
        return None

    @property
    def not_identifiable(self) -> tuple[str, ...]:
        """Free parameters that the records do not identify: their variance is infinite."""
        e = self.estimate
        return tuple(name for name, sd in zip(e.names, e.sd.tolist(), strict=True) if not np.isfinite(sd))

    @property
    def delay_s(self) -> float:
        """Delay of the torque [s]; zero or a whole interval where it does not differ from these significantly."""
        e = self.estimate
        if DELAY not in e.names:
            return e.delay_s
        sd = float(e.sd[e.names.index(DELAY)])
        nearest = min(max(e.delay_s, 0.0), e.interval_s)
        return nearest if abs(nearest - e.delay_s) < _SIGNIFICANT * sd else e.delay_s

    @property
    def masses(self) -> int | None:
        """Number of masses of the identified drive; see ``masses_of``."""
        return masses_of(self.estimate.problem)

    @property
    def recommended_masses(self) -> int | None:
        """The number of masses that the records ask for, if it is another one than the drive's; None: no doubt."""
        if self.growth is None or self.masses is None:
            return None
        recommended = self.growth.recommended
        were_more_tried = len(self.growth.models) > recommended
        if recommended > self.masses or (recommended < self.masses and were_more_tried):
            return recommended
        return None

    def rows(self) -> Iterator[ParameterRow]:
        """The free parameters in their order, then the held ones; slopes have rows of their own."""
        e = self.estimate
        estimates = dict(zip(e.names, zip(e.theta.tolist(), e.sd.tolist(), strict=True), strict=True))
        slopes = {scheduled.slope for scheduled in self.scheduled}
        for name, (value, sd) in estimates.items():
            if name in slopes:
                continue
            if name == DELAY:
                yield ParameterRow(name, "s", "delay of the torque", value, sd, self.start.delay_s)
            else:
                p = e.drive.parameter(name)
                base = split_name(name)[0]
                known = base in self.start.nominal and base not in self.unknown
                before = value_of(self.start.nominal, name) if known else None
                yield ParameterRow(name, p.unit, p.meaning, value, sd, before)
        for name, reason in self.held.items():
            p = e.drive.parameter(name)
            yield ParameterRow(
                name, p.unit, p.meaning, e.values[name], None, self.start.nominal[name], reason
            )

    def slopes(self) -> Iterator[Slope]:
        """Slopes of the scheduled parameters."""
        e = self.estimate
        estimates = dict(zip(e.names, zip(e.theta.tolist(), e.sd.tolist(), strict=True), strict=True))
        for scheduled in self.scheduled:
            yield Slope(scheduled, estimates[scheduled.parameter][0], *estimates[scheduled.slope])
