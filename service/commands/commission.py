"""``axiswatch commission``: turns records of a healthy robot into a configuration that the daemon can run."""

from __future__ import annotations

import math
import shlex
import sys
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from monitor_core.wording import duration, listed
from service.can.user_errors import RecordError
from service.commands.calibrate import Budget, seconds_of
from service.commands.command_line.exit_codes import FAULT, MISTAKE, NOT_TESTED, explained
from service.commands.command_line.freed_memory import return_freed_memory
from service.commands.command_line.options import LOG_KINDS, ConfigPath, axis_named, configuration
from service.commands.command_line.output_files import write
from service.commands.command_line.progress import axes_bars
from service.config import Config
from service.config.written.commissioned import commissioned, configured, corrected, relocated
from service.config.written.commissioning_files import RECORDS, REPORT
from service.config.written.corrections import Correction
from service.reports.commissioning_report import Outcome, as_html, motion_step, next_step, recording_s
from service.reports.formats import Provenance

if TYPE_CHECKING:
    from monitor_core.calibration import CalibrationOptions
    from service.commands.commissioning.axis.axis_commissioning import EarlierResult
    from service.commands.commissioning.axis.axis_job import AxisJob
    from service.commands.commissioning.signals.signal_proposals import Review

CONFIG = "axiswatch.toml"
Output = Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for everything that is written.")]
Yes = Annotated[bool, typer.Option("--yes", help="Accept all proposals without asking.")]
RecordsOrBus = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="RECORD...",
        help=f"Tables (.csv .parquet .mat) or CAN logs ({LOG_KINDS}) of the healthy robot; FILE@10:60 are its"
        " seconds 10 to 60. Without any, those of DIR/records.",
    ),
]
Minutes = Annotated[
    float | None,
    typer.Option(
        "--minutes",
        metavar="N",
        help="Without RECORD: first record the buses for so long, into DIR/records.",
    ),
]
Axes = Annotated[
    list[str] | None,
    typer.Option(
        "--axis",
        metavar="NAME",
        help="Work on this axis only; may be repeated. What an earlier call has found of the others stays.",
    ),
]


def commission(
    config: ConfigPath,
    records: RecordsOrBus = None,
    output: Output = Path("commissioned"),
    budget: Budget = "1y",
    yes: Yes = False,
    minutes: Minutes = None,
    axis: Axes = None,
) -> None:
    """Commission a robot from its healthy state, recorded or live: check, identify and calibrate every axis.

    Without RECORD, `--minutes N` looks at the buses first and says what is missing, then records them into
    DIR/records; Ctrl-C ends the recording early. Called again without both, it uses all that was recorded there.

    Where the records do not show a parameter, a motion that shows it is planned, into DIR/motion: let the controller
    run it, and record again. Nothing is sent to the robot.

    Writes DIR/axiswatch.toml, which `replay` and `run` take as it is, the nominal values and thresholds that it names,
    and DIR/report.html: which changes of each axis will be detected, how soon, which will not, and the next step. What
    the records show to be wrong in the configuration is proposed as a change. Called again, it repeats only what
    depends on something new. With --axis it works on the named axes only; the new configuration and the report also
    have what earlier calls have found of the others. The exit code is 5 where an axis that was worked on could not be
    commissioned, or `replay` tests nothing of it in these records, 2 where none could.
    """
    from service.commands.commissioning.axis.axis_job import AxisJob
    from service.commands.commissioning.live.live_recording import record_live, recorded
    from service.ingest.records.record_ranges import in_order_of_time

    return_freed_memory()
    budget_s = seconds_of(budget)
    _check_source(records, minutes, output)
    read = configuration(config, without_bus=bool(records), thresholds=False)
    names = [each.id for each in read.axes]
    chosen = {axis_named(read.axes, name).id for name in axis or ()} or set(names)
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(f"{output}: {error.strerror}", param_hint="--output") from None
    console = Console(highlight=False, soft_wrap=True)
    text = relocated(config.read_text(encoding="utf-8-sig"), config.parent.resolve(), output.resolve())
    earlier = _earlier([name for name in names if name not in chosen], output)
    with explained():
        if minutes is not None:
            record_live(read, text, output, 60 * minutes, yes)
        used = tuple(in_order_of_time(records, read) if records else map(str, recorded(output)))
        for name, result in earlier.items():
            text = corrected(text, name, result.of_signals)  # a chosen axis may follow the motion of this one
        shared = AxisJob(text, "", used, output, options_for(budget_s), Provenance.now(), yes)
        jobs, silent = _jobs(shared, read, chosen)
        reviews = _reviewed(jobs, yes, console, _command(records or (), config, output, budget, axis or ()))
        worked_on = [*_carried_out(jobs, reviews, console), *silent]
    motion_minutes = max(1, math.ceil(recording_s(worked_on) / 60))
    given, minutes_again = ((*records, "RECORD"), None) if records else ((), motion_minutes)
    again = _command(given, config, output, budget, axis or (), minutes_again, yes)
    outcomes = [*worked_on, *(result.outcome for result in earlier.values())]
    outcomes.sort(key=lambda outcome: names.index(outcome.axis_id))
    # Motions that were planned for the others are not asked for again.
    open_now = [o if o.axis_id in chosen else replace(o, motion="") for o in outcomes]
    words = next_step(open_now, output / CONFIG, bool(read.bus), again)
    _write(config, jobs[0], outcomes, words)
    for step in (motion_step(outcome, output / CONFIG) for outcome in worked_on):
        if step:
            console.print(step, markup=False)
    if missing := [name for name in names if name not in chosen | earlier.keys()]:
        console.print(f"{listed(missing)}: not commissioned yet, so left out of the new configuration.", markup=False)
    console.print(words, markup=False)
    if minutes is not None and any(outcome.motion for outcome in worked_on) and _wanted(motion_minutes, yes):
        commission(config, None, output, budget, yes, motion_minutes, axis)
    else:
        _exit(worked_on)


def _earlier(names: Sequence[str], output: Path) -> dict[str, EarlierResult]:
    """What earlier calls have found of these axes, by name; axes of which they have found nothing are left out."""
    from service.commands.commissioning.axis.axis_commissioning import earlier_result

    found = {name: earlier_result(output, name) for name in names}
    return {name: result for name, result in found.items() if result is not None}


def _check_source(records: Sequence[str] | None, minutes: float | None, output: Path) -> None:
    """Check that there is something to commission from: records, or a time to record."""
    from service.commands.commissioning.live.live_recording import check_minutes, recorded

    if records and minutes is not None:
        raise typer.BadParameter(
            "records that are given are used as they are: leave out --minutes, or the records",
            param_hint="--minutes",
        )
    if minutes is not None:
        check_minutes(minutes)
    if not records and minutes is None and not recorded(output):
        raise typer.BadParameter(
            f"no records, and none of half a minute in {output / RECORDS}: give tables or CAN logs of the healthy"
            " robot, or --minutes 10 to record its buses",
            param_hint="RECORD",
        )


def _jobs(shared: AxisJob, config: Config, chosen: Collection[str]) -> tuple[list[AxisJob], list[Outcome]]:
    """A job for each chosen axis that has records, and the outcomes of chosen axes that have none.

    ``shared``: what all jobs have in common, with all records.
    """
    from service.ingest.records.axis_records import silent_in
    from service.ingest.records.record_ranges import wanted

    silent = {record: silent_in(wanted(record).path, config) for record in shared.records}
    jobs: list[AxisJob] = []
    refused: list[Outcome] = []
    for axis in (each for each in config.axes if each.id in chosen):
        own = tuple(record for record in shared.records if axis.id not in silent[record])
        if own:
            jobs.append(shared._replace(axis_id=axis.id, records=own))
            continue
        lost = sum((Counter(silent[record][axis.id]) for record in shared.records), Counter[str]())
        dropped = ", ".join(f"{count} {reason}" for reason, count in lost.items() if count) or "nothing"
        words = f"not identified: no samples of it in {', '.join(shared.records)}; dropped: {dropped}"
        refused.append(Outcome(axis.id, refusal=words))
    if not jobs:
        which = "any axis" if len(chosen) == len(config.axes) else listed(sorted(chosen))
        raise RecordError(f"no samples of {which}: {'; '.join(o.axis_id + ' ' + o.refusal for o in refused)}")
    return jobs, refused


def options_for(budget_s: float) -> CalibrationOptions:
    """Settings of the calibration of every axis: the defaults of `calibrate`."""
    from monitor_core.calibration import CalibrationOptions

    return CalibrationOptions(budget_s)


def _reviewed(jobs: Sequence[AxisJob], yes: bool, console: Console, command: str) -> Mapping[str, Review]:
    """Review the signals of each axis; the corrections in it are those to which the user agrees."""
    from service.commands.commissioning.signals.exchanged_torques import exchanged
    from service.commands.commissioning.signals.signal_proposals import review
    from service.commands.commissioning.signals.torque_times import torque_times

    text, folder = jobs[0].text, jobs[0].folder
    proposals = _Proposals(yes, console)
    records = {job.axis_id: job.records for job in jobs}
    others = {axis_id: proposals.agreed(axis_id, found) for axis_id, found in exchanged(text, records, folder).items()}
    for axis_id, corrections in others.items():
        text = corrected(text, axis_id, corrections)
    reviews = {axis_id: review(text, axis_id, files, folder) for axis_id, files in records.items()}
    for axis_id, looked in reviews.items():
        agreed = proposals.agreed(axis_id, looked.corrections)
        reviews[axis_id] = looked._replace(corrections=(*others.get(axis_id, ()), *agreed))
        # If commissioning continues, these faults become the refusal of the axis.
        for words in (*looked.doubts, *(() if proposals.can_ask else looked.faults)):
            console.print(f"{axis_id}: {words}.", markup=False)
    for axis_id, looked in reviews.items():
        text = corrected(text, axis_id, looked.corrections)
    times = {axis_id: looked.torque_time for axis_id, looked in reviews.items() if not looked.faults}
    for axis_id, correction in torque_times(configured(text, None, folder)[0], times).items():
        agreed = proposals.agreed(axis_id, [correction])
        reviews[axis_id] = reviews[axis_id]._replace(corrections=(*reviews[axis_id].corrections, *agreed))
    proposals.check(command)
    return reviews


class _Proposals:
    """Corrections that are proposed to the user, axis by axis.

    Args:
        yes: agree to all without asking.
        console: where they are shown.
    """

    def __init__(self, yes: bool, console: Console) -> None:
        self._yes, self._console = yes, console
        self.can_ask = yes or sys.stdin.isatty()
        """Whether there is an answer; otherwise ``check`` ends the command"""
        self._made: list[str] = []

    def agreed(self, axis_id: str, corrections: Sequence[Correction]) -> tuple[Correction, ...]:
        """Show the corrections of an axis, and ask for each; returns those to which the user agrees."""
        agreed, refused = list[Correction](), set[tuple[str, ...]]()
        for correction in corrections:
            self._console.print(f"{axis_id}: {correction.reason}. -> {correction.change}", markup=False)
            self._made.append(f"{axis_id}: {correction.change}")
            if correction.key in refused:
                continue  # it builds on what was refused
            if self._is_agreed(f"Change {axis_id} to {correction.change}?"):
                agreed.append(correction)
            else:
                refused.add(correction.key)
        return tuple(agreed)

    def _is_agreed(self, question: str) -> bool:
        return self._yes or not self.can_ask or typer.confirm(question, default=True)

    def check(self, command: str) -> None:
        """End the command if proposals have no answer; ``command``: what would accept all with --yes.

        Raises:
            BadParameter: there are such proposals.
        """
        if self._made and not self.can_ask:
            # The box of an error would break the line.
            self._console.print(f"Accept all with: {command} --yes", markup=False)
            count = len(self._made)
            raise typer.BadParameter(
                f"{count} proposed {'changes' if count > 1 else 'change'}, to be confirmed in a terminal:"
                f" {'; '.join(self._made)}",
                param_hint="--yes",
            )


def _carried_out(jobs: Sequence[AxisJob], reviews: Mapping[str, Review], console: Console) -> list[Outcome]:
    """Commission the axes in parallel and show the progress; returns their outcomes.

    Each axis sees the corrections of all axes, as the motion of one may be a signal of another.
    """
    from service.commands.commissioning.axis.axis_processes import outcomes

    text = jobs[0].text
    for axis_id, looked in reviews.items():
        text = corrected(text, axis_id, looked.corrections)
    jobs = [job._replace(text=text) for job in jobs]
    found: dict[str, Outcome] = {}
    with axes_bars([job.axis_id for job in jobs]) as bars:
        for number, outcome in enumerate(outcomes(jobs, reviews, lambda step: bars.show(*step)), 1):
            found[outcome.axis_id] = outcome
            bars.end(outcome.axis_id)
            words = outcome.refusal or f"{outcome.answer} {outcome.verdict}".strip()
            console.print(f"[{number}/{len(jobs)}] {outcome.axis_id}: {words}", markup=False)
    return [found[job.axis_id] for job in jobs]


def _write(path: Path, job: AxisJob, outcomes: Sequence[Outcome], words: str) -> None:
    """Write the report, and the configuration to this path if any axis was commissioned."""
    found = {outcome.axis_id: outcome.found for outcome in outcomes if outcome.found is not None}
    text, written = job.text, [job.folder / REPORT]
    write(job.folder / REPORT, as_html(outcomes, words, job.folder / CONFIG, job.provenance))
    if found:
        for outcome in outcomes:
            text = corrected(text, outcome.axis_id, outcome.corrections)
        heading = [f"Made from {path.name} by `axiswatch commission`, {job.provenance.date}."]
        write(job.folder / CONFIG, commissioned(text, found, heading))
        written.insert(0, job.folder / CONFIG)
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)


def _wanted(minutes: float, yes: bool) -> bool:
    """Whether planned motions are to be recorded now; only a person can start them on the controller."""
    question = f"Record the planned motion now, for {duration(60 * minutes)}?"
    return not yes and sys.stdin.isatty() and typer.confirm(question, default=False)


def _command(
    records: Sequence[str],
    config: Path,
    output: Path,
    budget: str,
    axes: Sequence[str],
    minutes: float | None = None,
    yes: bool = False,
) -> str:
    """A command as it is typed in a shell."""
    words = ["axiswatch", "commission", *records, "--config", config, "--budget", budget, "--output", output]
    words += [word for name in axes for word in ("--axis", name)]
    words += [] if minutes is None else ["--minutes", f"{minutes:g}"]
    return shlex.join(map(str, [*words, *(["--yes"] if yes else [])]))


def _exit(outcomes: Sequence[Outcome]) -> None:
    """Exit with the code that tells the results of the axes."""
    if any(outcome.fault for outcome in outcomes):
        raise typer.Exit(FAULT)
    if not any(outcome.found for outcome in outcomes):
        raise typer.Exit(MISTAKE)
    if any(outcome.refusal or outcome.is_blind for outcome in outcomes):
        raise typer.Exit(NOT_TESTED)
