"""The complete identification of a drive: starting values, fit, comparison with the records and with a black box."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.signal_terms import Term
from monitor_core.drive.structure import LOAD
from monitor_core.identification.assessment.bode import bode_of
from monitor_core.identification.assessment.outlook import Outlook, Watched
from monitor_core.identification.assessment.verdict import Effect, FitQuality, Verdict, verdict_of
from monitor_core.identification.friction_scale import with_best_scale
from monitor_core.identification.greybox import Estimate, agreeing, colour_of, fit, traces_of
from monitor_core.identification.holding import hold_offset, hold_undetermined
from monitor_core.identification.identification_result import (
    IdentificationOptions,
    IdentificationResult,
    Rejection,
    Start,
)
from monitor_core.identification.problem import IdentificationError, Problem
from monitor_core.identification.record_checks.known_axis import drive_time_constant
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.record_parts import cut_at_gaps, most_moving_parts
from monitor_core.identification.starting import (
    Growth,
    best_of,
    fit_from,
    fit_from_scratch,
    fit_from_torque_balance,
    grow,
    hold_balanced_inertia,
)
from monitor_core.identification.thermal.warm_up import LEAST_MOTION_S, moving_s
from monitor_core.identification.thermal.warmed_fit import warmed_fit
from monitor_core.identification.torque_balance.slow_friction import slow_friction_speed
from monitor_core.identification.torque_balance.standstill import find_standstill
from monitor_core.identification.torque_balance.torque_windows import moves_one_way
from monitor_core.identification.weight.weight_balance import with_torque_of_links
from monitor_core.kernel.tables import COULOMB, OF_ANGLE, ONE

MOST_ITERATIONS = 100
MOST_MASSES, USUAL_MASSES = 9, 5
"""A motor hardly feels more masses."""
_LOAD_MEMORIES = 2
"""Factor on the longest memory: to distinguish load and torque constant, a memory must span several motions."""
_BETTER = 0.8
"""A repeated fit must leave less than this part of what the first fit leaves unexplained."""
_TOO_LARGE = 2.0
"""An inertia is too large that is this multiple of what the torque balance shows, in which both halves of the records
agree within the same factor."""
_LARGER = 1.2
"""From this multiple on, that of the torque balance is taken if the fit with it is as good."""
_BALANCED = "the one-step prediction hardly depends on it; value of the torque balance"

IdentificationProgress = Callable[[str, int, int], None]
"""Called with the present phase, its completed steps, and its largest number of steps."""


def identify(
    problem: Problem,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    options: IdentificationOptions | None = None,
    progress: IdentificationProgress | None = None,
) -> IdentificationResult:
    """Estimate the free parameters of a drive; simulate all records; compare with a black box.

    A record with gaps is cut there, and its parts are fitted, as ``cut_at_gaps`` says.
    The monitor must leave out what the fit does (``Problem.min_speed``): standstill, and slow motion in which friction
    falls with the speed.  If most of the motion is so slow that friction sticks and slips, and the drive does not
    explain it, the fit is repeated without all slow motion.  A fit of one mass from records alone that is not good is
    repeated with the inertia of the torque balance.

    Args:
        problem: drive, nominal values, free parameters, predictor.
        records: records to fit.
        validation: records that are only predicted and simulated.
        options: default: ``IdentificationOptions()``.
        progress: called while it runs.

    Raises:
        IdentificationError: the fit cannot start, for instance because the drive is unstable with the nominal values;
            numbers of masses are compared although gravity acts.
    """
    options = options or IdentificationOptions()
    given = _Given(records, validation, options, progress or _silent)
    if not options.cut_at_gaps:
        return _with_repeats(problem, given)
    slowest_s = drive_time_constant(problem.drive, problem.nominal, options.unknown)
    used, cuts = cut_at_gaps(records, slowest_s, options.begins_s)
    validated, further_cuts = cut_at_gaps(validation, slowest_s)
    cut = given._replace(
        records=[part.record for part in used],
        validation=[part.record for part in validated],
        options=replace(options, begins_s=tuple(part.begins_s for part in used)),
    )
    found = _with_repeats(problem, cut)
    as_given = replace(found.options, begins_s=options.begins_s)
    return replace(found, options=as_given, gap_cuts=(*cuts, *further_cuts))


class _Given(NamedTuple):
    """What each repetition of the fit takes, beside the problem."""

    records: Sequence[Record]
    validation: Sequence[Record]
    options: IdentificationOptions
    report: IdentificationProgress


def _with_repeats(problem: Problem, given: _Given) -> IdentificationResult:
    """The fit, repeated where ``identify`` says so."""
    found = _identify(problem, given)
    if Effect.SLOW in found.verdict.missing:
        faster = replace(problem, min_speed=found.verdict.slow)
        if again := _unless_rejected(faster, given):
            return again
    doubtful = found.verdict.quality is not FitQuality.GOOD or bool(_torque_terms(problem, given.options))
    if doubtful and found.rejection in (None, Rejection.POOR) and given.options.start == "records":
        return _with_balanced_inertia(found, problem, given)
    return found


def _with_balanced_inertia(found: IdentificationResult, problem: Problem, given: _Given) -> IdentificationResult:
    """The fit repeated with the inertia of the torque balance, if it is better; else ``found``.

    It is better if it explains clearly more.  Where a torque follows signals, it is if the fit has an inertia that is
    several times larger: the acceleration of the axis may be in these signals, and the measured one explains its motion
    by itself.  So a large inertia with as large a torque for the acceleration explains it, whatever the motor does.
    Where it is larger by less, the fit must be as good: joints that ring enlarge it, as the next sample shows little of
    the torque.
    """
    options, terms = given.options, _torque_terms(problem, given.options)
    rigid = hold_balanced_inertia(problem, given.records, terms)
    if rigid is None:
        return found
    held = {split_name(name)[0]: _BALANCED for name in set(problem.free) - set(rigid.free)}
    times = max((found.estimate.values[J] / rigid.nominal[J] for J in held), default=0.0) if terms else 0.0
    if found.verdict.quality is FitQuality.GOOD and not times > _LARGER:
        return found
    unknown = tuple(name for name in options.unknown if name not in held)
    known = replace(options, start="values", unknown=unknown)
    again = _unless_rejected(rigid, given._replace(options=known))
    if again is None:
        return found
    as_good = again.verdict.quality in (found.verdict.quality, FitQuality.GOOD)
    larger = times > _TOO_LARGE or (times > _LARGER and as_good)
    if not (found.rejection or larger or _is_better(again.verdict, found.verdict)):
        return found
    return replace(again, held={**held, **again.held})


def _torque_terms(problem: Problem, options: IdentificationOptions) -> tuple[str, ...]:
    """The signals that act on the drive as torques."""
    torques = problem.drive.constant_torques()
    return tuple(dict.fromkeys(s.term for s in options.scheduled if s.parameter in torques))


def _unless_rejected(problem: Problem, given: _Given) -> IdentificationResult | None:
    """A repeated fit; None: it cannot be used."""
    try:
        again = _identify(problem, given)
    except IdentificationError:
        return None
    return None if again.rejection else again


def _is_better(verdict: Verdict, other: Verdict) -> bool:
    return verdict.measure is other.measure and 100 - verdict.per_cent < _BETTER * (100 - other.per_cent)


def _identify(problem: Problem, given: _Given) -> IdentificationResult:
    records, validation, options, report = given
    as_one = dict[str, str]()
    if moves_one_way(records):
        problem, as_one = hold_offset(problem, options.monitored)
    links = _torque_terms(problem, options)
    balanced = with_torque_of_links(records, links)
    standstill = find_standstill(balanced)
    if standstill is not None:
        records = standstill.records
        validation = standstill.held(with_torque_of_links(validation, links))
        if standstill.speed and not problem.min_speed:
            # As the monitor is then used; the speed scale is that of the motion, too.
            slowest = max(standstill.speed, slow_friction_speed(balanced))
            problem = replace(problem, min_speed=slowest)
    most = options.max_masses
    growth = None if most is None else _growth(problem, records, validation, most, report)

    def refit(other: Problem, own: Sequence[Record]) -> Estimate:
        return _fit(other, own, report)

    try:
        estimate = _first(problem, records, options, report)
        if options.interval_mean:
            # The fit for the mean speed of each interval is close to the one for the speed at the sample.
            averaged = estimate.problem.drive.with_mean_speed()
            estimate = _fit(replace(estimate.problem, drive=averaged), records, report)
        warmed, searched = None, _may_follow_heat(estimate, records, options)
        if options.thermal is not None and searched:
            report("warm-up", 0, 1)
            warmed = warmed_fit(estimate, records, searched, refit, options.thermal, options.begins_s)
        if warmed is not None:
            estimate, records = warmed.estimate, warmed.records
            validation = warmed.validation(validation)
            options = replace(options, scheduled=(*options.scheduled, *warmed.terms))
        configured = {name: v for name, v in problem.nominal.items() if name not in options.unknown}
        estimate, held = hold_undetermined(
            estimate, configured, options.monitored, lambda fewer: _fit(fewer, records, _silent)
        )
        own = traces_of(estimate.problem, records)
        validated = traces_of(estimate.problem, validation) if validation else ()
        report("validation", 0, 1)
        verdict = verdict_of(estimate, records, validation, own, validated)
        estimate = agreeing(estimate, verdict.halves)
    except (ValueError, np.linalg.LinAlgError) as error:
        hint = "; give values to start from in [robot.axis.model.nominal], or a longer record with more motion"
        raise IdentificationError(f"no fit: {error}{hint if options.start == 'records' else ''}") from None
    watch = _watch(estimate, records, options)
    return IdentificationResult(
        start=problem,
        estimate=estimate,
        estimation=own,
        validation=validated,
        bode=bode_of(estimate, None if options.unknown else problem, records),
        colour=colour_of(estimate, options.monitored or estimate.problem.free, records, watch.carried),
        growth=growth,
        options=options,
        verdict=verdict,
        held={**as_one, **held},
        watched=watch.watched,
        memory_s=watch.memory_s,
        warm_up=None if warmed is None else warmed.warm_up,
        temperature_errors={} if warmed is None else warmed.errors,
        temperature_share=None if warmed is None else warmed.share,
        temperature_follows_motion=None if warmed is None else warmed.follows_motion,
        not_following=tuple(name for name in searched if warmed is None or name not in warmed.followers),
        standstill=standstill,
    )


def _first(
    problem: Problem, records: Sequence[Record], options: IdentificationOptions, report: IdentificationProgress
) -> Estimate:
    """The fit to all records with constant friction, started from a fit to the parts with most motion."""
    parts = most_moving_parts(records)
    found = _best(problem, parts, options.start, report)
    found = with_best_scale(found, options.speed_scales, lambda other: _fit(other, parts, _silent))
    if sum(map(len, parts)) == sum(map(len, records)):
        return found
    return replace(_fit(found.problem, records, report), started_from=found.started_from)


def _may_follow_heat(found: Estimate, records: Sequence[Record], options: IdentificationOptions) -> tuple[str, ...]:
    """Free friction parameters that are monitored and follow no signal; empty if no warm-up is searched for."""
    if options.thermal is None or moving_s(records) < LEAST_MOTION_S:
        return ()
    watched = {split_name(name)[0] for name in options.monitored}
    free = set(found.problem.free) - set(found.problem.varying)
    friction = friction_of(found.drive)
    return tuple(name for name in (*friction.viscous, *friction.coulomb) if name in free and name in watched)


class _Watch(NamedTuple):
    """The parameters that can be watched, the memory [s], and the weight for the load, if that can be watched."""

    watched: tuple[Watched, ...]
    memory_s: float
    carried: Mapping[str, float]


def _watch(estimate: Estimate, records: Sequence[Record], options: IdentificationOptions) -> _Watch:
    outlook, memory_s = Outlook(estimate, records, options.sizes), options.memory_s
    if options.memories_s:
        memory_s = outlook.sufficient_memory(options.monitored, options.memories_s)
    watched = outlook.watched(options.monitored, memory_s)
    weight = _carried_weight(estimate, options)
    if weight:
        longer_s = _LOAD_MEMORIES * options.memories_s[-1] if options.memories_s else memory_s
        if found := outlook.with_load(options.monitored, longer_s, weight):
            memory_s, watched = longer_s, found
        elif options.load:
            watched = outlook.watched((*options.monitored, LOAD), memory_s, weight)
    return _Watch(watched, memory_s, weight if any(w.name == LOAD for w in watched) else {})


def _carried_weight(estimate: Estimate, options: IdentificationOptions) -> dict[str, float]:
    """References of the terms that the constant torque follows as a weight, by slope; empty: no weight is an input."""
    torques = set(estimate.drive.constant_torques()) - {split_name(name)[0] for name in options.monitored}
    followed = [term for term in options.scheduled if term.parameter in torques]
    loads = [term for term in followed if Term.read(term.term).is_load]
    return {term.slope: term.reference for term in followed if loads and term.parameter == loads[0].parameter}


def _silent(*_: object) -> None:
    """No progress."""


def _best(problem: Problem, records: Sequence[Record], start: Start, report: IdentificationProgress) -> Estimate:
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


def _fit(problem: Problem, records: Sequence[Record], report: IdentificationProgress) -> Estimate:
    def fitting(done: int, cost: float) -> None:
        report(f"fit, sum of squares {cost:.4g}", min(done, MOST_ITERATIONS), MOST_ITERATIONS)

    return fit(problem, records, most_iterations=MOST_ITERATIONS, progress=fitting)


def _growth(
    problem: Problem, records: Sequence[Record], validation: Sequence[Record], most: int, report: IdentificationProgress
) -> Growth:
    """Chains of one, two, .. masses, with the friction of the drive."""
    drive, values, free = problem.drive, problem.nominal, problem.free
    if drive.acts(OF_ANGLE, values, free):
        raise IdentificationError("--masses compares chains of masses without gravity, which acts on this drive")
    kinds = {"fc": COULOMB, "tau0": ONE}
    friction = ["fm", *(name for name, kind in kinds.items() if drive.acts((kind,), values, free))]
    try:
        return grow(
            records,
            most,
            like=problem,
            friction=friction,
            validation=validation,
            progress=lambda done, most: report("chains of masses", done, most),
        )
    except ValueError as error:
        raise IdentificationError(f"--masses: {error}") from None
