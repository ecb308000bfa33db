"""The identification of a drive as a whole, and its result: estimates, how well they explain records, what to use."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Literal, NamedTuple

import numpy as np

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.structure import DELAY, split_name, value_of
from monitor_core.drive.thermal_state import HEAT, ThermalStart
from monitor_core.identification.bode import Bode, bode_of
from monitor_core.identification.friction_scale import with_best_scale
from monitor_core.identification.greybox import Estimate, Trace, colour_of, fit, traces_of
from monitor_core.identification.holding import hold_undetermined
from monitor_core.identification.outlook import Watched, outlook, shortest_memory
from monitor_core.identification.parameter_selection import ScheduledTerm, Slope, acting
from monitor_core.identification.problem import IdentificationError, Problem
from monitor_core.identification.records.measured_record import Record, lively_parts
from monitor_core.identification.records.standstill import Standstill, find_standstill
from monitor_core.identification.starting import (
    Growth,
    best_of,
    fit_from,
    fit_from_scratch,
    fit_from_torque_balance,
    grow,
    masses_of,
)
from monitor_core.identification.verdict import Effect, Quality, Verdict, verdict_of
from monitor_core.identification.warm_up import (
    LEAST_MOTION_S,
    FoundWarmUp,
    find_warm_up,
    following,
    heated_as,
    moving_s,
)
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE

_SIGNIFICANT = 3.0
"""Standard deviations."""


class Rejection(Enum):
    """Why no nominal values are made of an estimate."""

    NOT_CONVERGED = "not-converged"
    NOT_IDENTIFIABLE = "not-identifiable"
    POOR = "poor"
    """The drive does not explain the motion.  Only this can be overruled."""
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
        options: why parameters are held, which values before the fit are only placeholders, what follows signals.
        verdict: on the fit.
        held: why parameters are held that the records do not determine.
        watched: which of the monitored parameters can be watched; empty: none were named.
        memory_s: the memory that this is for [s].
        warm_up: how the axis warms up, where friction follows a heat that nobody measures; None: it does not.
        standstill: where the axis often stands; the torque there is left out; None: it seldom does.
    """

    start: Problem
    estimate: Estimate
    estimation: tuple[Trace, ...]
    validation: tuple[Trace, ...]
    bode: Bode
    colour: float
    growth: Growth | None
    options: IdentificationOptions
    verdict: Verdict
    held: Mapping[str, str]
    watched: tuple[Watched, ...]
    memory_s: float
    warm_up: FoundWarmUp | None = None
    standstill: Standstill | None = None

    def model(self, monitored: Sequence[str]) -> AxisModel:
        """The axis with the estimates as its nominal values.

        Raises:
            KeyError, ValueError: what ``AxisModel`` refuses.
        """
        return self.estimate.model(tuple(monitored))

    @property
    def rejection(self) -> Rejection | None:
        """Why no nominal values should be made of the estimates; None: they can be used."""
        if not self.estimate.converged:
            return Rejection.NOT_CONVERGED
        if self.not_identifiable:
            return Rejection.NOT_IDENTIFIABLE
        if not 0 <= self.delay_s <= self.estimate.interval_s:
            return Rejection.DELAY_OUT_OF_RANGE
        if self.verdict.quality is Quality.POOR:
            return Rejection.POOR
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
    def slow_left_out(self) -> float:
        """Speed below which the motion is left out, as it sticks and slips, rad/s at the sensor; 0: none is."""
        return self.estimate.problem.min_speed

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
            yield ParameterRow(
                name, p.unit, p.meaning, e.values[name], None, self.start.nominal[name], reason
            )

    def _estimates(self) -> dict[str, tuple[float, float]]:
        e = self.estimate
        return dict(zip(e.names, zip(e.theta.tolist(), e.sd.tolist(), strict=True), strict=True))

    def slopes(self) -> Iterator[Slope]:
        """Slopes of the scheduled parameters."""
        estimates = self._estimates()
        for scheduled in self.options.scheduled:
            yield Slope(scheduled, estimates[scheduled.parameter][0], *estimates[scheduled.slope])


# --- The procedure: starting values, fit, comparison with the records and with a black box ----------------------------


MOST_ITERATIONS = 100
MOST_MASSES, USUAL_MASSES = 9, 5
"""A motor hardly feels more masses."""

Start = Literal["values", "search", "records"]
"""Where the fit starts: at the nominal values; also at the results of a search around them in the frequency response;
from the records alone, without using the nominal values of free parameters."""

Progress = Callable[[str, int, int], None]
"""Called with the present phase, the steps done and the most steps of it."""


@dataclass(frozen=True)
class IdentificationOptions:
    """Options of ``identify``.

    Args:
        start: where the fit starts.
        monitored: parameters that will be monitored; the colour of the prediction errors is computed for them.
        interval_mean: the drive reports the mean speed of each interval, not the speed at the sample.
        max_masses: also compare chains of one, two, .. so many masses; None: do not.
        held: why each held parameter is held, for reports.
        unknown: free parameters whose nominal values are only placeholders.
        scheduled: parameters that follow signals of the records.
        memory_s: of the monitor.
        memories_s: instead, some to choose from, in ascending order: the shortest that shows small changes is taken.
        sizes: of monitored parameters as given; needed where the nominal value is zero.
        speed_scales: of Coulomb friction, rad/s, to be tried beside that of the problem; then the best one is refined.
        thermal: how the axis begins the first record, where friction may follow a heat that nobody measures; None: it
            is not asked whether it does.
        begins_s: clock times of the first samples of the records [s]; None, or none at all: unknown.
    """

    start: Start = "search"
    monitored: tuple[str, ...] = ()
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


def identify(
    problem: Problem,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> IdentificationResult:
    """Estimate the free parameters of a drive; simulate all records; compare with a black box.

    Where most of the motion is so slow that its friction sticks and slips, and the drive does not explain it, the fit
    is repeated without that motion, as the monitor is then to be used (``Problem.min_speed``).

    Args:
        problem: drive, nominal values, free parameters, predictor.
        records: to be fitted.
        validation: records that are only predicted and simulated.
        options: default: ``IdentificationOptions()``.
        progress: called while it runs.

    Raises:
        IdentificationError: the fit cannot start, for instance because the drive is unstable with the nominal values;
            masses are compared although gravity acts.
    """
    options = options or IdentificationOptions()
    found = _identify(problem, records, validation, options, progress or _silent)
    if Effect.SLOW not in found.verdict.missing:
        return found
    faster = replace(problem, min_speed=found.verdict.slow)
    try:
        again = _identify(faster, records, validation, options, progress or _silent)
    except IdentificationError:
        return found
    return found if again.rejection else again


def _identify(
    problem: Problem,
    records: Sequence[Record],
    validation: Sequence[Record],
    options: IdentificationOptions,
    report: Progress,
) -> IdentificationResult:
    standstill = find_standstill(records)
    if standstill is not None:
        records = standstill.records
        validation = standstill.held(validation)
    most = options.max_masses
    growth = None if most is None else _growth(problem, records, validation, most, report)
    try:
        estimate = _first(problem, records, options, report)
        if options.interval_mean:
            # The fit for the mean speed of each interval is close to the one for the speed at the sample.
            averaged = estimate.problem.drive.with_mean_speed()
            estimate = _fit(replace(estimate.problem, drive=averaged), records, report)
        warm_up, seen = None, options.scheduled
        if options.thermal is not None:
            warm_up, estimate, records, seen = _warming(estimate, records, options, report)
            if warm_up is not None:
                following_heat = [term for term in seen if term.term == HEAT]
                validation = heated_as(estimate, warm_up, following_heat, validation)
                options = replace(options, scheduled=seen)
        configured = {name: v for name, v in problem.nominal.items() if name not in options.unknown}
        estimate, held = hold_undetermined(
            estimate, configured, options.monitored, lambda fewer: _fit(fewer, records, _silent)
        )
        own = traces_of(estimate.problem, records)
        validated = traces_of(estimate.problem, validation) if validation else ()
        report("validation", 0, 1)
        verdict = verdict_of(estimate, records, validation, own, validated)
    except (ValueError, np.linalg.LinAlgError) as error:
        hint = (
            "; give values to start from in [robot.axis.model.nominal], or a longer record with more motion"
        )
        raise IdentificationError(f"no fit: {error}{hint if options.start == 'records' else ''}") from None
    memory_s = options.memory_s
    if options.memories_s:
        memory_s = shortest_memory(estimate, options.monitored, records, options.memories_s, options.sizes)
    return IdentificationResult(
        problem,
        estimate,
        own,
        validated,
        bode_of(estimate, None if options.unknown else problem, records),
        colour_of(estimate, options.monitored or estimate.problem.free, records),
        growth,
        options,
        verdict,
        held,
        outlook(estimate, options.monitored, records, memory_s, options.sizes),
        memory_s,
        warm_up,
        standstill,
    )


def _first(
    problem: Problem, records: Sequence[Record], options: IdentificationOptions, report: Progress
) -> Estimate:
    """The fit with constant friction, of all records, from what the part of them with most motion shows."""
    parts = lively_parts(records)
    found = _best(problem, parts, options.start, report)
    found = with_best_scale(found, options.speed_scales, lambda other: _fit(other, parts, _silent))
    if sum(map(len, parts)) == sum(map(len, records)):
        return found
    return replace(_fit(found.problem, records, report), started_from=found.started_from)


def _warming(
    found: Estimate, records: Sequence[Record], options: IdentificationOptions, report: Progress
) -> tuple[FoundWarmUp | None, Estimate, Sequence[Record], tuple[ScheduledTerm, ...]]:
    """The warm-up that the records show, the fit with it, the records with their heat, and what follows it."""
    watched = {split_name(name)[0] for name in options.monitored}
    free = set(found.problem.free) - set(found.problem.varying)
    friction = friction_of(found.drive)
    followers = [name for name in (*friction.viscous, *friction.coulomb) if name in free and name in watched]
    assert options.thermal is not None
    if not followers or moving_s(records) < LEAST_MOTION_S:
        return None, found, records, options.scheduled
    report("warm-up", 0, 1)
    warm_up = find_warm_up(found, records, followers, options.thermal, options.begins_s)
    if warm_up is None:
        return None, found, records, options.scheduled
    try:
        again, heated, scheduled = following(
            found, warm_up, records, lambda problem, own: _fit(problem, own, report)
        )
    except ValueError:
        return None, found, records, options.scheduled
    if not (again.converged and again.cost < found.cost):
        return None, found, records, options.scheduled
    return warm_up, again, heated, (*options.scheduled, *scheduled)


def _silent(*_: object) -> None:
    """No progress."""


def _best(problem: Problem, records: Sequence[Record], start: Start, report: Progress) -> Estimate:
    """The fit of least cost."""

    def searching(done: int, most: int) -> None:
        report("search for starting values", done, most)

    if start == "records":
        try:
            return fit_from_scratch(problem, records, progress=searching)
        except ValueError as error:
            try:
                return fit_from_torque_balance(problem, records)
            except ValueError:
                raise error from None
    try:
        direct = _fit(problem, records, report)
    except ValueError:
        if start == "values":
            raise
        return fit_from(problem, records, progress=searching)
    if start == "values":
        return direct
    try:
        searched = fit_from(problem, records, progress=searching)
    except ValueError:
        return direct
    return best_of([direct, searched])


def _fit(problem: Problem, records: Sequence[Record], report: Progress) -> Estimate:
    def fitting(done: int, cost: float) -> None:
        report(f"fit, sum of squares {cost:.4g}", min(done, MOST_ITERATIONS), MOST_ITERATIONS)

    return fit(problem, records, most_iterations=MOST_ITERATIONS, progress=fitting)


def _growth(
    problem: Problem, records: Sequence[Record], validation: Sequence[Record], most: int, report: Progress
) -> Growth:
    """Chains of one, two, .. masses, with the friction of the drive."""
    drive = problem.drive
    kinds = {drive.inputs[k] for k in acting(drive, problem.nominal, problem.free)}
    if kinds & {COSINE, SINE}:
        raise IdentificationError(
            "--masses compares masses in a row without gravity, which acts on this drive"
        )
    friction = {"fm": True, "fc": COULOMB in kinds, "tau0": ONE in kinds}
    try:
        return grow(
            records,
            most,
            like=problem,
            friction=[name for name, acts in friction.items() if acts],
            validation=validation,
            progress=lambda done, most: report("rows of masses", done, most),
        )
    except ValueError as error:
        raise IdentificationError(f"--masses: {error}") from None
