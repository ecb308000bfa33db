"""Commissioning of one axis: signals are checked, then identification and calibration; all results in one folder.

A refusal stops this axis only.  Results are kept with digests of everything on which they depend, and computed again
only when a digest has changed.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.calibration import CalibrationError, CalibrationOptions
from monitor_core.drive import split_name
from monitor_core.excitation import ExcitationError
from monitor_core.identification import FitQuality, IdentificationError, turning_weight
from monitor_core.modeling import ModelError
from monitor_core.wording import listed
from service.can.messages import DescriptionError
from service.can.user_errors import IngestError
from service.commands.calibrate import as_identified, calibrate_axis
from service.commands.commissioning.checked_axis import configured
from service.commands.commissioning.commissioning_remedies import (
    Retry,
    SuggestedMotion,
    followers_monitored,
    memories_of,
    memory_change,
    motion_for,
    remedy_for,
    retry,
    watched_in,
)
from service.commands.commissioning.link_load import link_load, motors_without_ratio
from service.commands.commissioning.signal_proposals import Review
from service.commands.excite import planned, torque_columns
from service.commands.identification_task import IdentificationTask, Request, drawing_of, prepare
from service.commands.output_files import replace_text
from service.config import AxisConfig, Config, ConfigErrors, NamedAxis
from service.config.axis_settings import AxisError
from service.config.commissioned import SIGNAL, Correction, Found, commissioned, corrected, motion_file, pages_of
from service.config.conditions import needed
from service.ingest.axis_records import sha256_of, wanted
from service.ingest.loaded_records import samples_in
from service.reports import calibration_files, identification_html
from service.reports.commissioning_report import Outcome, own_config
from service.reports.excitation_report import as_csv
from service.reports.formats import Provenance
from service.reports.identification_files import as_toml
from service.reports.identification_report import IdentificationReport, verdict_line
from service.reports.outlook_words import missing_words
from service.texts.not_tested_words import not_tested_sentences

_MISTAKES = (
    *(CalibrationError, IdentificationError, ModelError, DescriptionError, IngestError),
    *(ConfigErrors, AxisError, ExcitationError),
)
"""Errors that end the commissioning of one axis."""
CommissioningProgress = Callable[[str, str, float], None]
"""Called with the phase, "identify" or "calibrate", the present work, and the completed share of it, 0 to 1"""


class Order(NamedTuple):
    """The task for one axis; it can be sent to another process."""

    text: str
    """Text of the configuration, valid in ``folder``"""
    axis_id: str
    records: tuple[str, ...]
    folder: Path
    options: CalibrationOptions
    provenance: Provenance
    shorten: bool
    """If the records do not support the false-alarm budget: use the longest one that they support"""


# --- From the records to nominal values and thresholds ----------------------------------------------------------------


def commission_axis(
    order: Order, review: Review, progress: CommissioningProgress = lambda _phase, _work, _share: None
) -> Outcome:
    """Identify and calibrate an axis, unless both are done already with the same configuration and records.

    ``review``: findings about its signals; an axis with faults is refused.
    """
    name = order.axis_id
    text = corrected(order.text, name, review.corrections)
    digest = _digest(text, order)
    kept = order.folder / f"{name}.json"
    if (before := _read(kept, digest, order.folder)) is not None:
        return before
    (order.folder / motion_file(name)).unlink(missing_ok=True)
    order = order._replace(records=tuple(r for r in order.records if r not in review.standing))
    if review.faults:
        faults = "; ".join(review.faults)
        return Outcome(name, corrections=review.corrections, refusal=f"not identified: {faults}")
    open_points = tuple(f"{words[0].upper()}{words[1:]}." for words in review.doubts)
    open_points += (review.unchecked,) if review.unchecked else ()
    open_points += tuple(f"{record} is left out: the axis does not move in it." for record in review.standing)
    first = Outcome(name, corrections=review.corrections, notes=open_points)
    outcome = _identified(order, text, first, progress)
    if outcome.found is not None:
        outcome = _calibrated(order, text, outcome, progress)
        if outcome.thresholds_file is not None:
            outcome = _replayed(order, text, outcome, progress)
        _, axis = configured(text, name, order.folder)
        outcome = replace(outcome, notes=(*outcome.notes, *unmonitored_words(axis.config, outcome.watched)))
    replace_text(kept, json.dumps({"digest": digest, "outcome": asdict(outcome)}, indent=1) + "\n")
    return outcome


def _identified(order: Order, text: str, outcome: Outcome, progress: CommissioningProgress) -> Outcome:
    progress("identify", "reading the records", 0.0)
    attempts = _Attempts(order, text, outcome)
    try:
        found = attempts.run(progress)
        report, outcome = found.report, found.outcome
        if report.is_poor or report.result.verdict.quality is FitQuality.FAIR or _is_coupled(outcome, found.axis):
            motors = motors_without_ratio(found.text, found.axis.id, order.records, order.folder)
            outcome = replace(outcome, notes=(*outcome.notes, *_without_ratio(motors)))
    except _MISTAKES as error:
        return replace(attempts.outcome, refusal=f"not identified: {error}")
    outcome = _with_values(order.folder, found.axis, report, outcome, attempts.taken, attempts.lacks)
    motion = motion_for(report, [item.record for item in found.task.estimation])
    if motion is None:
        return outcome
    progress("identify", "planning a motion", 0.0)
    return _with_motion(order, found.text, outcome, motion)


class _Attempt(NamedTuple):
    """An identification with a configuration, and the outcome before it."""

    text: str
    axis: NamedAxis
    task: IdentificationTask
    report: IdentificationReport
    outcome: Outcome

    @property
    def is_usable(self) -> bool:
        """Whether its values may be nominal values, and something can be monitored with them."""
        return not self.report.rejection and bool(watched_in(self.report))


class _Attempts:
    """Identifications of an axis, each with the configuration that the one before suggests."""

    def __init__(self, order: Order, text: str, outcome: Outcome) -> None:
        self._order, self._text = order, text
        self.outcome = outcome
        """The outcome so far: changes that were tried, and notes"""
        self.lacks = ""
        """See ``lacks_of``"""
        self.taken = ""
        """Changes that --yes would apply, in words"""
        self._schedule: tuple[str, ...] = ()
        self._drives: list[str] = []
        self._without_links: _Attempt | None = None
        """A usable fit without the load of links, which stands if the one with it is not usable"""

    def run(self, progress: CommissioningProgress) -> _Attempt:
        """The attempt that stands."""
        while True:
            found, again = self._attempt(progress)
            self._drives.append(found.axis.config.model.drive)
            self.lacks = lacks_of(found.report, self.lacks)
            if self._without_links is not None and not found.is_usable:
                return self._without_links
            if again is not None and again.changes and not self._order.shorten:
                self.taken = self.taken or f"; --yes applies {again.words}"
                again = None if found.report.rejection else followers_monitored(found.report, self._text, found.axis)
            if again is None:
                return found
            if again.schedule and found.is_usable:
                self._without_links = found
            self._apply(again)

    def _attempt(self, progress: CommissioningProgress) -> tuple[_Attempt, Retry | None]:
        """Identify with the present configuration; also the changes that the result suggests."""
        order, text = self._order, self._text
        config, axis = configured(text, order.axis_id, order.folder)
        request = Request(schedule=self._schedule, memories_s=memories_of(axis.config))
        task = prepare(config, axis, order.records, [], request)
        provenance = order.provenance._replace(drawing=drawing_of(axis.config))
        load = cache(partial(link_load, text, axis.id, order.records, order.folder))
        turn = partial(turning_weight, max((item.record for item in task.estimation), key=len))
        is_guess = order.shorten and not self._drives  # the first drive may be one
        for part in (task.with_most_moving_parts(), task) if is_guess else (task,):
            report = part.run(provenance, _within("identify", progress))
            is_last = bool(self._schedule and report.rejection)
            again = None if is_last else retry(report, text, axis, self._drives, load, turn)
            if report.rejection and again:  # the complete records would not help
                break
        return _Attempt(text, axis, task, report, self.outcome), again

    def _apply(self, again: Retry) -> None:
        self._text, self._schedule = again.text, self._schedule or again.schedule
        notes = self.outcome.notes
        if again.schedule:
            notes = (*notes, f"The torque shows {again.shown}. {', '.join(again.schedule)}.")
        self.outcome = replace(self.outcome, notes=notes, corrections=(*self.outcome.corrections, *again.changes))


def _is_coupled(outcome: Outcome, axis: NamedAxis) -> bool:
    """Whether the torque was found to follow the motion of another axis."""
    return any(c.key[0] == SIGNAL and c.key[-1] == "axis" and c.value != axis.config.name for c in outcome.corrections)


def _without_ratio(motors: Sequence[str]) -> Iterator[str]:
    """What the unknown gear ratios of these axes hide; nothing if there are none."""
    if motors:
        yield (
            f"The angles of {listed(motors)} turn by more than two turns, so they are those of motors, and their gear"
            " ratios are not known. Without them only a weight is looked for that follows the pose of the arm, not the"
            " inertia. Give the angle of the arm over that of the motor, 0.02 for a gear of 50:1, as r in"
            " [robot.axis.model.nominal] of each of these axes, and commission again. A linear axis needs none."
        )


def _with_values(
    folder: Path, axis: NamedAxis, report: IdentificationReport, outcome: Outcome, taken: str, lacks: str
) -> Outcome:
    """Outcome with the identified values, written into the folder.

    ``taken``: remedies that --yes would apply; ``lacks``: see ``lacks_of``.
    """
    page, values = pages_of(axis.id)[0], f"{axis.id}-nominal.toml"
    better = [f"A better fit can be tried{taken}."] if taken and not report.rejection and watched_in(report) else []
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
        return replace(outcome, refusal=not_identified(report, taken, lacks))
    replace_text(folder / values, as_toml(report))
    watched = watched_in(report)
    return replace(
        outcome,
        nominal_file=values,
        watched=watched,
        refusal="" if watched else f"{outcome.outlook.removesuffix('.')}{taken}",
        corrections=(*outcome.corrections, *memory_change(report, axis.config)),
    )


def unmonitored_words(axis: AxisConfig, watched: Sequence[str]) -> Iterator[str]:
    """Configuration keys to leave out, since they name a parameter that is no longer monitored."""
    model, alarms = axis.model, axis.alarms
    for name in model.monitor:
        base = split_name(name)[0]
        tables: dict[str, Iterable[str]] = {
            "scales": model.scales, "bounds": model.bounds, "limits": model.limits,
            "priorities": alarms.priorities, "latched": alarms.latched, "suppressed": alarms.suppressed,
        }  # fmt: skip
        keys = [key for key, names in tables.items() if base in {split_name(own)[0] for own in names}]
        if keys and base not in {split_name(own)[0] for own in watched}:
            yield f"{name} is not monitored, so it is left out of {listed(keys)} in the new configuration."


def lacks_of(report: IdentificationReport, before: str) -> str:
    """What the drive of a poor fit lacks; where the records do not show it, what the drive ``before`` lacked."""
    return (missing_words(report.result.verdict) if report.is_poor else "") or before


def not_identified(report: IdentificationReport, taken: str, lacks: str) -> str:
    """Reason why an axis has no nominal values; ``taken``, ``lacks``: remedies that --yes applies, missing effects."""
    return f"not identified: {report.rejection}{taken}" + (f". {lacks.removesuffix('.')}" if lacks else "")


def _with_motion(order: Order, text: str, outcome: Outcome, motion: SuggestedMotion) -> Outcome:
    """Add a file with a motion of the axis that shows what its records do not.

    ``text``: the configuration with which its nominal values were identified.
    """
    name, file = order.axis_id, motion_file(order.axis_id)
    assert outcome.nominal_file is not None
    changed = corrected(text, name, outcome.corrections)
    own = commissioned(changed, {name: outcome.found or Found(outcome.nominal_file, None, motion.lost)})
    if outcome.found is None:  # no part of what is commissioned, but a motion is planned with its values
        replace_text(order.folder / own_config(name), own)
    outcome = replace(outcome, lost=motion.lost, excite=motion.request.options)
    path = order.folder / file
    path.parent.mkdir(exist_ok=True)
    try:
        _, axis = configured(own, name, order.folder)
        experiment = planned(axis, motion.request, np.random.default_rng(_PHASES))
    except _MISTAKES as error:
        return replace(outcome, notes=(*outcome.notes, f"No motion could be planned for it: {error}."))
    replace_text(path, as_csv(experiment, torque_columns(axis)))
    seconds = experiment.task.schedule.samples * experiment.task.plant.interval_s
    return replace(outcome, motion=file, motion_s=seconds)


_PHASES = 1
"""Seed for the phases of a planned motion, so that the same records give the same file."""


def _calibrated(order: Order, text: str, outcome: Outcome, progress: CommissioningProgress) -> Outcome:
    options, found, step = order.options, None, _within("calibrate", progress)
    for _ in range(_MOST_REMEDIES):
        try:
            config, axis = as_identified(*_as_found(order, text, outcome), order.records)
            found = calibrate_axis(config, axis, order.records, options, order.provenance, step)
            break
        except CalibrationError as error:
            remedy = remedy_for(error, outcome, options)
            if remedy is None or not order.shorten:
                taken = "" if remedy is None else f"; --yes applies {remedy.words}"
                return replace(outcome, refusal=f"not calibrated: {error}{taken}")
            outcome, options = remedy.outcome, remedy.options
        except _MISTAKES as error:
            return replace(outcome, refusal=f"not calibrated: {error}")
    if found is None:
        return replace(outcome, refusal="not calibrated: the records are too short, or move the axis too little")
    page, values = pages_of(order.axis_id)[1], f"{order.axis_id}-thresholds.toml"
    replace_text(order.folder / page, calibration_files.as_html(found))
    replace_text(order.folder / values, calibration_files.as_toml(found))
    first = found.detectors[0]
    return replace(
        outcome,
        notes=tuple(dict.fromkeys((*outcome.notes, *found.warnings))),
        thresholds_file=values,
        budget_s=options.budget_s,
        promise=first.promise,
        within_s=found.result.within_s,
        smallest=tuple((name, *first.smallest(name)) for name in found.result.model.monitored),
        pages=(*outcome.pages, page),
    )


_MOST_REMEDIES = 5
"""Remedies are tried repeatedly, since one refusal may follow another."""
_AT_ONCE = 10_000
"""Number of samples between two reports of progress"""


def _replayed(order: Order, text: str, outcome: Outcome, progress: CommissioningProgress) -> Outcome:
    """Add the parameters that the daemon could not test in these records, as the axis temperature is unknown."""
    from service.pipeline.axis_monitors import AxisMonitors

    config, axis = _as_found(order, text, outcome)
    monitors, many = AxisMonitors([axis]), len(order.records)
    for number, record in enumerate(order.records):
        block, _ = samples_in(record, config, axis, needed(axis))
        for k in range(0, block.size, _AT_ONCE):
            progress("calibrate", "replaying the records", (number + k / block.size) / many)
            monitors.update({axis.id: block.select(slice(k, k + _AT_ONCE))})
    status = monitors.by_id[axis.id].status()
    not_tested = status.untested_so_far()
    untested = tuple(parameter for names in not_tested.values() for parameter in names)
    sentences = not_tested_sentences(not_tested, status, monitors.axes[axis.id].gated_by)
    words = tuple(f"In its own records {sentence}." for sentence in sentences)
    return replace(outcome, untested=untested, notes=(*outcome.notes, *words))


def _as_found(order: Order, text: str, outcome: Outcome) -> tuple[Config, NamedAxis]:
    """The configuration with all that was found until now, and the axis."""
    assert outcome.found is not None
    changed = corrected(text, order.axis_id, outcome.corrections)
    own = commissioned(changed, {order.axis_id: outcome.found})
    return configured(own, order.axis_id, order.folder)


def _within(phase: str, progress: CommissioningProgress) -> Callable[[str, float, float], None]:
    return lambda work, done, total: progress(phase, work, done / total if total else 0.0)


# --- What was found before --------------------------------------------------------------------------------------------


def _digest(text: str, order: Order) -> str:
    parts = [order.provenance.version, text, order.axis_id, repr(order.options), repr(order.shorten)]
    parts += [f"{record} {sha256_of(wanted(record).path)}" for record in order.records]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _read(kept: Path, digest: str, folder: Path) -> Outcome | None:
    try:
        content = json.loads(kept.read_text(encoding="utf-8"))
        if content["digest"] != digest:
            return None
        fields = content["outcome"]
        fields["corrections"] = tuple(Correction(tuple(key), *rest) for key, *rest in fields["corrections"])
        fields["smallest"] = tuple(tuple(row) for row in fields["smallest"])
        for name in ("watched", "untested", "notes", "pages", "lost", "excite"):
            fields[name] = tuple(fields[name])
        outcome = Outcome(**fields)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    files = [f for f in (*outcome.pages, outcome.nominal_file, outcome.thresholds_file, outcome.motion) if f]
    return outcome if all((folder / name).exists() for name in files) else None
