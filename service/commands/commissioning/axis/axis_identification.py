"""Identification of an axis: attempts, each with the changes that the one before suggests, and its nominal values."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from monitor_core.identification import FitQuality, IdentificationError
from monitor_core.wording import listed
from service.commands.commissioning.axis.axis_job import REFUSALS, AxisJob, CommissioningProgress, within
from service.commands.commissioning.axis.identification_retries import (
    Retry,
    followers_monitored,
    memories_of,
    memory_change,
    retry,
    watched_in,
    without_fit,
    without_unsettled,
)
from service.commands.commissioning.axis.load_search import LoadSearch
from service.commands.commissioning.axis.missing_motion import motion_for, with_motion, within_arm
from service.commands.identification_task import IdentificationTask, Request, drawing_of, prepare
from service.commands.output_files import replace_text
from service.config import NamedAxis
from service.config.commissioned import SIGNAL, pages_of
from service.reports import identification_html
from service.reports.commissioning_report import Outcome
from service.reports.identification_files import as_toml
from service.reports.identification_report import IdentificationReport, verdict_line
from service.reports.outlook_words import missing_words

_MOST_LEFT_OUT = 2
"""Terms of the load of links that are left out, one after the other, if the fit does not converge: each takes a fit"""


def identified(job: AxisJob, outcome: Outcome, progress: CommissioningProgress) -> Outcome:
    """The outcome with nominal values, and with a motion for what the records do not show, written into the folder."""
    progress("identify", "reading the records", 0.0)
    attempts = _Attempts(job, outcome)
    try:
        found = attempts.run(progress)
        outcome = replace(found.outcome, notes=(*found.outcome.notes, *_unknown_gears(found)))
    except REFUSALS as error:
        return replace(attempts.outcome, refusal=f"not identified: {error}")
    outcome = _with_values(found, outcome, attempts.offer, attempts.lacks)
    motion = motion_for(found.report, [item.record for item in found.task.estimation])
    if motion is None:
        return outcome
    progress("identify", "planning a motion", 0.0)
    if found.axis.config.coupling:
        motion = within_arm(motion, found.job)
    return with_motion(found.job, outcome, motion)


# --- The attempts -----------------------------------------------------------------------------------------------------


class _Attempt(NamedTuple):
    """An identification with a configuration, that of its job, and the outcome before it."""

    job: AxisJob
    axis: NamedAxis
    task: IdentificationTask
    report: IdentificationReport
    outcome: Outcome
    search: LoadSearch

    @property
    def is_usable(self) -> bool:
        """Whether its values may be nominal values, and something can be monitored with them."""
        return not self.report.rejection and bool(watched_in(self.report))


class _Attempts:
    """Identifications of an axis, each with the configuration that the one before suggests."""

    def __init__(self, job: AxisJob, outcome: Outcome) -> None:
        self._job = job
        """With the configuration of the next attempt"""
        self.outcome = outcome
        """The outcome so far: changes that were tried, and notes"""
        self.lacks = ""
        """See ``lacks_of``"""
        self.offer = ""
        """What --yes would apply, as the end of a sentence"""
        self._schedule: tuple[str, ...] = ()
        """The terms of the load of links"""
        self._drives: list[str] = []
        """Those that were tried"""
        self._left_out = 0
        """Number of terms that were left out"""
        self._without_links: _Attempt | None = None
        """A usable fit without the load of links, which stands if the one with it is not usable"""

    def run(self, progress: CommissioningProgress) -> _Attempt:
        """The attempt that stands."""
        while True:
            found, again = self._attempt(progress)
            self._drives.append(found.axis.config.model.drive)
            self.lacks = lacks_of(found.report, self.lacks)
            if self._without_links is not None and not found.is_usable and not (again and again.left_out):
                return self._without_links
            again = self._agreed(found, again)
            if again is None:
                return found
            if again.schedule and found.is_usable:
                self._without_links = found
            self._apply(again)

    def _attempt(self, progress: CommissioningProgress) -> tuple[_Attempt, Retry | None]:
        """Identify with the present configuration; also the changes that the result suggests."""
        job, text = self._job, self._job.text
        config, axis = job.configured()
        request = Request(schedule=self._schedule, memories_s=memories_of(axis.config))
        task = prepare(config, axis, job.records, [], request)
        provenance = job.provenance._replace(drawing=drawing_of(axis.config))
        search = LoadSearch(text, axis.id, job.records, job.folder, [item.record for item in task.estimation])
        is_guess = job.shorten and not self._drives  # the first drive may be one
        for part in (task.with_most_moving_parts(), task) if is_guess else (task,):
            try:
                report = part.run(provenance, within("identify", progress))
            except IdentificationError:
                first = job.shorten and not self._schedule and not self._drives
                if (with_links := without_fit(text, axis, search) if first else None) is None:
                    raise
                self._drives.append(axis.config.model.drive)
                self._apply(with_links)
                return self._attempt(progress)
            if self._schedule and report.rejection:
                again = without_unsettled(report, text) if self._left_out < _MOST_LEFT_OUT else None
            else:
                again = retry(report, text, axis, self._drives, search)
            if report.rejection and again:  # the complete records would not help
                break
        return _Attempt(job, axis, task, report, self.outcome, search), again

    def _agreed(self, found: _Attempt, again: Retry | None) -> Retry | None:
        """What is tried next: without --yes nothing that changes more than which parameters are monitored."""
        if again is None or not again.changes or self._job.shorten:
            return again
        self.offer = self.offer or f"; --yes applies {again.words}"
        return None if found.report.rejection else followers_monitored(found.report, self._job.text, found.axis)

    def _apply(self, again: Retry) -> None:
        self._job = self._job._replace(text=again.text)
        self._schedule = again.schedule or self._schedule
        notes = self.outcome.notes
        if again.left_out:
            self._left_out += 1
            notes = (*notes, f"The fit does not converge with {again.left_out}, so this term is left out.")
        elif again.schedule:
            self.lacks = ""  # the schedules have it
            notes = (*notes, f"The torque shows {again.shown}. {', '.join(again.schedule)}.")
        self.outcome = replace(self.outcome, notes=notes, corrections=(*self.outcome.corrections, *again.changes))


def lacks_of(report: IdentificationReport, before: str) -> str:
    """What the drive of a poor fit lacks; where the records do not show it, what the drive ``before`` lacked."""
    return (missing_words(report.result.verdict) if report.is_poor else "") or before


# --- What the attempt that stands gives -------------------------------------------------------------------------------


def _unknown_gears(found: _Attempt) -> Iterator[str]:
    """What unknown gear ratios hide from a fit that is not good, or that follows the motion of another axis."""
    report, corrections = found.report, found.outcome.corrections
    own = found.axis.config.name
    follows = any(c.key[0] == SIGNAL and c.key[-1] == "axis" and c.value != own for c in corrections)
    good = not report.is_poor and report.result.verdict.quality is not FitQuality.FAIR
    if good and not follows:
        return
    if motors := found.search.motors_without_ratio:
        yield (
            f"The angles of {listed(motors)} turn by more than two turns, so they are those of motors, and their gear"
            " ratios are not known. Without them only a weight is looked for that follows the pose of the arm, not the"
            " inertia. Give the angle of the arm over that of the motor, 0.02 for a gear of 50:1, as r in"
            " [robot.axis.model.nominal] of each of these axes, and commission again. A linear axis needs none."
        )


def _with_values(found: _Attempt, outcome: Outcome, offer: str, lacks: str) -> Outcome:
    """Outcome with the identified values, written into the folder.

    ``offer``: what --yes would apply, as the end of a sentence; ``lacks``: see ``lacks_of``.
    """
    folder, axis, report = found.job.folder, found.axis, found.report
    page, values = pages_of(axis.id)[0], f"{axis.id}-nominal.toml"
    better = [f"A better fit can be tried{offer}."] if offer and not report.rejection and watched_in(report) else []
    replace_text(folder / page, identification_html.as_html(report))
    outcome = replace(
        outcome,
        verdict=verdict_line(report).removeprefix(f"{axis.id}: ").capitalize(),
        outlook=report.outlook,
        notes=(*outcome.notes, *report.warnings, *better),
        pages=(page,),
        no_warm_up=bool(report.result.not_following) and report.result.warm_up is None,
    )
    if report.rejection:
        return replace(outcome, refusal=not_identified(report, offer, lacks))
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
    """Reason why an axis has no nominal values; ``offer``, ``lacks``: as above."""
    return f"not identified: {report.rejection}{offer}" + (f". {lacks.removesuffix('.')}" if lacks else "")
