"""The result of an identification (estimates, fit, verdict), and the options of ``identify``."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal, NamedTuple

import numpy as np

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import split_name, value_of
from monitor_core.drive.structure import DELAY
from monitor_core.drive.thermal_state import ThermalStart
from monitor_core.identification.assessment.bode import Bode
from monitor_core.identification.assessment.outlook import Watched
from monitor_core.identification.assessment.verdict import FitQuality, Verdict
from monitor_core.identification.greybox import ComparedRecord, Estimate
from monitor_core.identification.parameter_selection import ScheduledTerm, Slope
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.record_parts import GapCut
from monitor_core.identification.starting import Growth, masses_of
from monitor_core.identification.thermal.warm_up import FoundWarmUp
from monitor_core.identification.torque_balance.standstill import Standstill

Start = Literal["values", "search", "records"]
"""Where the fit starts: at the nominal values; also at the results of a search around them in the frequency response;
from the records alone, without using the nominal values of free parameters."""


@dataclass(frozen=True)
class IdentificationOptions:
    """Options of ``identify``.

    Args:
        start: where the fit starts.
        monitored: parameters that will be monitored; the colour of the prediction errors is computed for them.
        load: monitor the load in any case; otherwise only if the records determine it.
        interval_mean: the drive reports the mean speed of each interval, not the speed at the sample.
        max_masses: also compare chains of one, two, .. so many masses; None: do not.
        held: reason for each held parameter, for reports.
        unknown: free parameters whose nominal values are only placeholders.
        scheduled: parameters that follow signals of the records.
        memory_s: memory of the monitor.
        memories_s: candidates instead, in ascending order; the shortest one that shows small changes is chosen.
        sizes: sizes of monitored parameters given by the user; needed if the nominal value is zero.
        speed_scales: candidates for the speed scale of Coulomb friction [rad/s], in addition to that of the problem;
            the best one is refined.
        thermal: heat at the start of the first record, if friction may depend on an unmeasured heat; None: no warm-up
            is searched for.
        begins_s: clock times of the first samples of the records [s]; None, or none at all: unknown.
        cut_at_gaps: fit a record with gaps as the parts between them; False: as the records are given.
    """

    start: Start = "search"
    monitored: tuple[str, ...] = ()
    load: bool = False
    interval_mean: bool = False
    max_masses: int | None = None
    held: Mapping[str, str] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    scheduled: tuple[ScheduledTerm, ...] = ()
    memory_s: float = 1.0
    memories_s: tuple[float, ...] = ()
    sizes: Mapping[str, float] = field(default_factory=dict)
    speed_scales: tuple[float, ...] = ()
    thermal: ThermalStart | None = None
    begins_s: tuple[float | None, ...] = ()
    cut_at_gaps: bool = True


_SIGNIFICANT = 3.0
"""Standard deviations."""


class Rejection(Enum):
    """Reason why an estimate gives no nominal values."""

    NOT_CONVERGED = "not-converged"
    NOT_IDENTIFIABLE = "not-identifiable"
    POOR = "poor"
    """The drive does not explain the motion.  Only this reason can be overruled by the user."""
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
    """Reason why the parameter is held; empty: it is estimated."""

    @property
    def relative_sd(self) -> float | None:
        """Relative standard deviation; None if the value is zero."""
        return None if self.sd is None or self.value == 0 else self.sd / abs(self.value)

    @property
    def is_about_zero(self) -> bool:
        """Whether the estimate does not differ significantly from zero."""
        return self.sd is not None and abs(self.value) < _SIGNIFICANT * self.sd

    @property
    def change(self) -> float | None:
        """Change relative to the value before the fit."""
        return None if not self.before else self.value / self.before - 1


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """Result of ``identify``.

    Attributes:
        start: the problem with the values before the fit.
        estimate: the estimates.
        estimation: traces of the fitted records.
        validation: traces of the validation records.
        bode: frequency responses of the drive, a black box and the records.
        colour: ratio of the variance of recursive estimates to that with white prediction errors; at least 1.
        growth: the comparison of chains of one, two, .. masses; None: not requested.
        options: the options of ``identify``.
        verdict: the verdict on the fit.
        held: parameters that the records do not determine, with the reasons why they are held.
        watched: whether each monitored parameter can be watched; empty: none were named.
        memory_s: the memory that ``watched`` holds for [s].
        warm_up: model of the warm-up, if friction depends on an unmeasured heat; None: it does not.
        standstill: the frequent standstills, whose torque is left out; None: the axis rarely stands still.
        gap_cuts: what is used of each record with gaps, also of those for validation.
    """

    start: Problem
    estimate: Estimate
    estimation: tuple[ComparedRecord, ...]
    validation: tuple[ComparedRecord, ...]
    bode: Bode
    colour: float
    growth: Growth | None
    options: IdentificationOptions
    verdict: Verdict
    held: Mapping[str, str]
    watched: tuple[Watched, ...]
    memory_s: float
    warm_up: FoundWarmUp | None = None
    not_following: tuple[str, ...] = ()
    """Friction parameters for which a warm-up was searched but not found"""
    temperature_errors: Mapping[str, float] = field(default_factory=dict)
    """Standard deviations of what friction is off by beside the measured temperature that it follows, by parameter"""
    temperature_share: float | None = None
    """What the measured temperature explains, over what the heat does; None: the records show one of both at most"""
    temperature_follows_motion: bool | None = None
    """Whether it becomes warmer and colder as the axis moves and stands; None: the records do not tell, or it was not
    looked for"""
    standstill: Standstill | None = None
    gap_cuts: tuple[GapCut, ...] = ()

    def model(self, monitored: Sequence[str]) -> AxisModel:
        """The axis with the estimates as its nominal values.

        Raises:
            KeyError, ValueError: what ``AxisModel`` refuses.
        """
        return self.estimate.model(tuple(monitored))

    @property
    def rejection(self) -> Rejection | None:
        """Reason why the estimates must not become nominal values; None: they can be used."""
        if not self.estimate.converged:
            return Rejection.NOT_CONVERGED
        if self.not_identifiable:
            return Rejection.NOT_IDENTIFIABLE
        if not 0 <= self.delay_s <= self.estimate.interval_s:
            return Rejection.DELAY_OUT_OF_RANGE
        if self.verdict.quality is FitQuality.POOR:
            return Rejection.POOR
        return None

    @property
    def not_identifiable(self) -> tuple[str, ...]:
        """Free parameters that the records do not identify: their variance is infinite."""
        e = self.estimate
        return tuple(name for name, sd in zip(e.names, e.sd.tolist(), strict=True) if not np.isfinite(sd))

    @property
    def delay_s(self) -> float:
        """Delay of the torque [s], rounded to zero or one interval if it does not differ from these significantly."""
        e = self.estimate
        if DELAY not in e.names:
            return e.delay_s
        sd = float(e.sd[e.names.index(DELAY)])
        nearest = min(max(e.delay_s, 0.0), e.interval_s)
        return nearest if abs(nearest - e.delay_s) < _SIGNIFICANT * sd else e.delay_s

    @property
    def slow_left_out(self) -> float:
        """Speed below which the motion is left out because of stick-slip [rad/s at the sensor]; 0: nothing is."""
        speed = self.estimate.problem.min_speed
        return 0.0 if self.standstill is not None and speed == self.standstill.speed else speed

    @property
    def masses(self) -> int | None:
        """Number of masses of the identified drive; see ``masses_of``."""
        return masses_of(self.estimate.problem)

    @property
    def recommended_masses(self) -> int | None:
        """The number of masses that the records support, if it differs from that of the drive; otherwise None."""
        if self.growth is None or self.masses is None:
            return None
        recommended = self.growth.recommended
        were_more_tried = len(self.growth.models) > recommended
        if recommended > self.masses or (recommended < self.masses and were_more_tried):
            return recommended
        return None

    def rows(self) -> Iterator[ParameterRow]:
        """The free parameters in their order, then the held ones; slopes have rows of their own."""
        e, estimates = self.estimate, self._estimates()
        slopes = {scheduled.slope for scheduled in self.options.scheduled}
        for name, (value, sd) in estimates.items():
            if name in slopes:
                continue
            if name == DELAY:
                yield ParameterRow(name, "s", "delay of the torque", value, sd, self.start.delay_s)
            else:
                p = e.drive.parameter(name)
                base = split_name(name)[0]
                known = base in self.start.nominal and base not in self.options.unknown
                before = value_of(self.start.nominal, name) if known else None
                yield ParameterRow(name, p.unit, p.meaning, value, sd, before)
        for name, reason in {**self.options.held, **self.held}.items():
            p = e.drive.parameter(name)
            yield ParameterRow(name, p.unit, p.meaning, e.values[name], None, self.start.nominal[name], reason)

    def _estimates(self) -> dict[str, tuple[float, float]]:
        e = self.estimate
        return dict(zip(e.names, zip(e.theta.tolist(), e.sd.tolist(), strict=True), strict=True))

    def slopes(self) -> Iterator[Slope]:
        """Slopes of the scheduled parameters."""
        estimates = self._estimates()
        for scheduled in self.options.scheduled:
            yield Slope(scheduled, estimates[scheduled.parameter][0], *estimates[scheduled.slope])
