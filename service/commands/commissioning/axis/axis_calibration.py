"""Calibration of an axis, repeated with what a refusal suggests, and a test of the thresholds in its own records."""

from dataclasses import replace
from typing import NamedTuple

from monitor_core.calibration import CalibrationError, CalibrationOptions
from monitor_core.wording import rounded_down
from service.commands.command_line.output_files import replace_text
from service.commands.commissioning.axis.axis_job import REFUSALS, AxisJob, CommissioningProgress, as_found, within
from service.commands.commissioning.axis.calibration_task import as_identified, calibrate_axis
from service.config.conditions import needed
from service.config.written.commissioning_files import pages_of
from service.config.written.corrections import Correction
from service.ingest.records.loaded_records import samples_in
from service.reports import calibration_files
from service.reports.commissioning_report import Outcome
from service.texts.not_tested_words import not_tested_sentences

_MOST_REMEDIES = 5
"""Remedies are tried repeatedly, since one refusal may follow another."""
_FOUND_FROM_THEM = "although they were found from them: the drive lacks something"
_AT_ONCE = 10_000
"""Number of samples between two reports of progress"""


def calibrated(job: AxisJob, outcome: Outcome, progress: CommissioningProgress) -> Outcome:
    """The outcome with thresholds, written into the folder; with ``shorten``, changes are made until there are some."""
    options, found, step = job.options, None, within("calibrate", progress)
    for _ in range(_MOST_REMEDIES):
        try:
            config, axis = as_identified(*as_found(job, outcome), job.records)
            found = calibrate_axis(config, axis, job.records, options, job.provenance, step)
            break
        except CalibrationError as error:
            remedy = _remedy_for(error, outcome, options)
            if remedy is None or not job.shorten:
                taken = "" if remedy is None else f"; --yes applies {remedy.words}"
                why = f"{error.reason}, {_FOUND_FROM_THEM}" if error.misfit else str(error)
                refusal = f"not calibrated: {why}{taken}"
                return replace(outcome, refusal=refusal, misfit=error.misfit, changes=error.changes)
            outcome, options = remedy.outcome, remedy.options
        except REFUSALS as error:
            return replace(outcome, refusal=f"not calibrated: {error}")
    if found is None:
        return replace(outcome, refusal="not calibrated: the records are too short, or move the axis too little")
    page, values = pages_of(job.axis_id)[1], f"{job.axis_id}-thresholds.toml"
    replace_text(job.folder / page, calibration_files.as_html(found))
    replace_text(job.folder / values, calibration_files.as_toml(found))
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


class _Remedy(NamedTuple):
    """Changes for another calibration."""

    words: str
    outcome: Outcome
    options: CalibrationOptions


def _remedy_for(error: CalibrationError, outcome: Outcome, options: CalibrationOptions) -> _Remedy | None:
    """Changes to try if these records do not suffice; None: only other records can help."""
    outcome = replace(outcome, notes=(*outcome.notes, f"{error}."))
    if error.budget_s is not None:
        budget_s = rounded_down(error.budget_s)
        return _Remedy(f"a budget of {budget_s:g} s", outcome, replace(options, budget_s=budget_s))
    if error.memory_s is not None:
        reason = "for a longer one the records are too short"
        changes = [Correction(("estimator", "memory_s"), error.memory_s, reason)]
        if error.joint_state:
            changes.append(Correction(("estimator", "joint_state"), True, f"with a memory of {error.memory_s:g} s"))
        words = ", ".join(change.change for change in changes)
        return _Remedy(words, replace(outcome, corrections=(*outcome.corrections, *changes)), options)
    left = tuple(name for name in outcome.watched if name not in error.without)
    if error.without and left:
        return _Remedy(f"monitor = {list(left)}", replace(outcome, watched=left), options)
    return None


# --- The test in its own records --------------------------------------------------------------------------------------


def tested(job: AxisJob, outcome: Outcome, progress: CommissioningProgress) -> Outcome:
    """Add the parameters that the daemon could not test in these records, as the axis temperature is unknown."""
    from service.pipeline.axes.axis_monitors import AxisMonitors

    config, axis = as_found(job, outcome)
    monitors, many = AxisMonitors([axis]), len(job.records)
    for number, record in enumerate(job.records):
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
