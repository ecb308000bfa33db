"""Identification of an axis: attempts, each with the changes that the one before suggests, and its nominal values."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from monitor_core.identification import FitQuality, IdentificationError, Record, TurningWeight, turning_weight
from monitor_core.wording import listed
from service.commands.command_line.output_files import replace_text
from service.commands.commissioning.axis.axis_job import (
    REFUSALS,
    AxisJob,
    CommissioningProgress,
    as_found,
    within,
)
from service.commands.commissioning.axis.identification_retries import (
    ONE_MASS,
    Retry,
    followers_monitored,
    memories_of,
    memory_change,
    retry,
    watched_in,
    with_spring,
    without_fit,
    without_unsettled,
)
from service.commands.commissioning.axis.identification_task import Request, drawing_of, prepare
from service.commands.commissioning.axis.load_search import LoadSearch, LoadSearches
from service.commands.commissioning.axis.missing_motion import motion_for, with_motion, within_arm
from service.config import NamedAxis
from service.config.written.commissioning_files import pages_of
from service.config.written.corrections import SIGNAL, Correction
from service.reports import identification_html
from service.reports.commissioning_report import Outcome
from service.reports.identification_files import as_toml
from service.reports.identification_report import IdentificationReport
from service.reports.identification_tables import verdict_line
from service.reports.outlook_words import missing_words

_MOST_LEFT_OUT = 2
"""Terms of the load of links that are left out, one after the other, if the fit does not converge: each takes a fit"""


def identified(job: AxisJob, outcome: Outcome, loads: LoadSearches, progress: CommissioningProgress) -> Outcome:
    """The outcome with nominal values, and with a motion for what the records do not show, written into the folder."""
    progress("identify", "reading the records", 0.0)
    found = _settled(_Attempt(job, outcome), loads, progress)
    return found if isinstance(found, Outcome) else _with_results(found, progress)


def identified_with_spring(
    job: AxisJob, misfit: Outcome, outcome: Outcome, loads: LoadSearches, progress: CommissioningProgress
) -> Outcome | None:
    """As ``identified``, with a spring; None: that gives no better values, or cannot.

    One mass may explain most of the motion and yet leave so much of each sample that the estimates are off.

    ``misfit``: the outcome with the values that do not fit; ``outcome``: that before they were identified.
    """
    _, axis = as_found(job, misfit)
    again = with_spring(job.text, axis, misfit.refusal) if job.shorten else None
    if again is None:
        return None
    found = _settled(_following(_Attempt(job, outcome), again, axis.config.model.drive), loads, progress)
    if isinstance(found, Outcome) or not found.is_usable or found.axis.config.model.drive == axis.config.model.drive:
        return None
    return _with_results(found, progress)


# --- The attempts -----------------------------------------------------------------------------------------------------


class _Attempt(NamedTuple):
    """What is identified, and what it and the attempts before it have shown."""

    job: AxisJob
    """With the configuration of this attempt"""
    outcome: Outcome
    """The outcome so far: changes that were tried, and notes"""
    schedule: tuple[str, ...] = ()
    """The terms of the load of links"""
    drives: tuple[str, ...] = ()
    """Those of the attempts before"""
    left_out: int = 0
    """Number of terms that were left out"""
    lacks: str = ""
    """What the drive lacks, see ``lacks_of``"""
    offer: str = ""
    """What --yes would apply, as the end of a sentence"""


class _Fit(NamedTuple):
    """The identification of an attempt."""

    attempt: _Attempt
    axis: NamedAxis
    report: IdentificationReport
    records: Sequence[Record]
    """Those to which the drive is fitted"""
    search: LoadSearch

    @property
    def is_usable(self) -> bool:
        """Whether its values may be nominal values, and something can be monitored with them."""
        return not self.report.rejection and bool(watched_in(self.report))


def _settled(attempt: _Attempt, loads: LoadSearches, progress: CommissioningProgress) -> _Fit | Outcome:
    """The fit after which nothing else is tried, or the outcome with the reason why there is none."""
    without_links: _Fit | None = None
    while True:
        try:
            fit, again = _fit(attempt, loads, progress)
        except REFUSALS as error:
            return replace(attempt.outcome, refusal=f"not identified: {error}")
        if without_links is not None and not fit.is_usable and not (again and again.left_out):
            return without_links
        fit, again = _agreed(fit, again)
        if again is None:
            return fit
        if again.schedule and fit.is_usable:
            without_links = fit  # it stands if none of those with the load of links is usable
        attempt = _following(fit.attempt, again, fit.axis.config.model.drive)


def _fit(attempt: _Attempt, loads: LoadSearches, progress: CommissioningProgress) -> tuple[_Fit, Retry | None]:
    """Identify with the configuration of the attempt; also the changes that the result suggests."""
    job, text = attempt.job, attempt.job.text
    config, axis = job.configured()
    request = Request(schedule=attempt.schedule, memories_s=memories_of(axis.config))
    task = prepare(config, axis, job.records, [], request)
    records = task.records.fitted
    provenance = job.provenance._replace(drawing=drawing_of(axis.config))
    search, turn = loads.search(text), partial(_turn_of_weight, records)
    is_guess = job.shorten and not attempt.drives  # the first drive may be one
    for part in (task.with_most_moving_parts(), task) if is_guess else (task,):
        try:
            report = part.run(provenance, within("identify", progress))
        except IdentificationError:
            first = job.shorten and not attempt.schedule and not attempt.drives
            if (with_links := without_fit(text, axis, search) if first else None) is None:
                raise
            return _fit(_following(attempt, with_links, axis.config.model.drive), loads, progress)
        if attempt.schedule and report.rejection:
            again = without_unsettled(report, text) if attempt.left_out < _MOST_LEFT_OUT else None
        else:
            again = retry(report, text, axis, attempt.drives, search, turn)
        if report.rejection and again:  # the complete records would not help
            break
    attempt = attempt._replace(lacks=lacks_of(report, attempt.lacks))
    return _Fit(attempt, axis, report, records, search), again


def _turn_of_weight(records: Sequence[Record]) -> TurningWeight | None:
    return turning_weight(max(records, key=len))


def _agreed(fit: _Fit, again: Retry | None) -> tuple[_Fit, Retry | None]:
    """What is tried next: without --yes nothing that changes more than which parameters are monitored.

    The first change of another kind is offered.
    """
    job, report = fit.attempt.job, fit.report
    if again is None or not again.changes or job.shorten:
        return fit, again
    attempt = fit.attempt._replace(offer=fit.attempt.offer or f"; --yes applies {again.words}")
    return fit._replace(attempt=attempt), None if report.rejection else followers_monitored(report, job.text, fit.axis)


def _following(before: _Attempt, again: Retry, drive: str) -> _Attempt:
    """The attempt after this one, which was with ``drive``."""
    lacks, notes = before.lacks, before.outcome.notes
    if again.left_out:
        notes = (*notes, f"The fit does not converge with {again.left_out}, so this term is left out.")
    elif again.schedule:
        lacks = ""  # the schedules have it
        notes = (*notes, f"The torque shows {again.shown}. {', '.join(again.schedule)}.")
    return before._replace(
        job=before.job._replace(text=again.text),
        outcome=replace(before.outcome, notes=notes, corrections=(*before.outcome.corrections, *again.changes)),
        schedule=again.schedule or before.schedule,
        drives=(*before.drives, drive),
        left_out=before.left_out + bool(again.left_out),
        lacks=lacks,
    )


def lacks_of(report: IdentificationReport, before: str) -> str:
    """What the drive of a poor fit lacks; where the records do not show it, what the drive ``before`` lacked."""
    return (missing_words(report.result.verdict) if report.is_poor else "") or before


# --- What the attempt that stands gives -------------------------------------------------------------------------------


def _with_results(fit: _Fit, progress: CommissioningProgress) -> Outcome:
    """The outcome of this fit, with its files."""
    job, outcome = fit.attempt.job, fit.attempt.outcome
    outcome = replace(outcome, corrections=(*outcome.corrections, *_poses(fit)))
    outcome = _with_values(fit, replace(outcome, notes=(*outcome.notes, *_unknown_gears(fit))))
    motion = motion_for(fit.report, fit.records)
    if motion is None:
        return outcome
    progress("identify", "planning a motion", 0.0)
    if fit.axis.config.coupling:
        motion = within_arm(motion, job)
    return with_motion(job, outcome, motion)


_GIVE_RATIOS = (
    "Give the angle of the arm over that of the motor, 0.02 for a gear of 50:1, as r in [robot.axis.model.nominal] of"
    " each of these axes, and commission again. A linear axis needs none."
)


def other_program(motors: Sequence[str]) -> str:
    """What a change within a record may be where the gear ratios of these axes are not known."""
    return (
        "If only another program begins there, the pose of the arm may explain the change; it is not looked for without"
        f" the gear ratios of {listed(motors)}. {_GIVE_RATIOS}"
    )


def _unknown_gears(fit: _Fit) -> Iterator[str]:
    """What unknown gear ratios hide from a fit that is not good, or that follows the motion of another axis."""
    report, corrections = fit.report, fit.attempt.outcome.corrections
    own = fit.axis.config.name
    follows = any(c.key[0] == SIGNAL and c.key[-1] == "axis" and c.value != own for c in corrections)
    good = not report.is_poor and report.result.verdict.quality is not FitQuality.FAIR
    if good and not follows:
        return
    if motors := fit.search.motors_without_ratio:
        yield (
            f"The angles of {listed(motors)} turn by more than two turns, so they are those of motors, and their gear"
            " ratios are not known. Without them only a weight is looked for that follows the pose of the arm, not the"
            f" inertia. {_GIVE_RATIOS}"
        )


def _poses(fit: _Fit) -> tuple[Correction, ...]:
    """The angles that the load may follow as signals, where one mass does without the terms of the load.

    They explain clearly more, as the inertia of a base or the weight of a wrist that turns little, but too little for
    terms that hold in other programs.  So the values hold in the poses of the records.
    """
    if not fit.attempt.job.shorten or fit.attempt.schedule or fit.axis.config.model.drive != ONE_MASS.name:
        return ()
    load = fit.search.terms
    return load.poses if load is not None else ()


def _with_values(fit: _Fit, outcome: Outcome) -> Outcome:
    """Outcome with the identified values, written into the folder."""
    folder, axis, report, offer = fit.attempt.job.folder, fit.axis, fit.report, fit.attempt.offer
    page, values = pages_of(axis.id)[0], f"{axis.id}-nominal.toml"
    better = [f"A better fit can be tried{offer}."] if offer and not report.rejection and watched_in(report) else []
    replace_text(folder / page, identification_html.as_html(report))
    outcome = replace(
        outcome,
        verdict=verdict_line(report).removeprefix(f"{axis.id}: ").capitalize(),
        outlook=report.outlook,
        obstacles=report.obstacles,
        notes=(*outcome.notes, *report.warnings, *better),
        pages=(page,),
        no_warm_up=bool(report.result.not_following) and report.result.warm_up is None,
    )
    if report.rejection:
        return replace(outcome, refusal=not_identified(report, offer, fit.attempt.lacks))
    replace_text(folder / values, as_toml(report))
    watched = watched_in(report)
    return replace(
        outcome,
        nominal_file=values,
        watched=watched,
        refusal="" if watched else f"{outcome.outlook.removesuffix('.')}{offer}",
        corrections=(*outcome.corrections, *memory_change(report, axis.config)),
    )


def not_identified(report: IdentificationReport, offer: str, lacks: str) -> str:
    """Reason why an axis has no nominal values.

    ``offer``: what --yes would apply, as the end of a sentence; ``lacks``: see ``lacks_of``.
    """
    return f"not identified: {report.rejection}{offer}" + (f". {lacks.removesuffix('.')}" if lacks else "")
