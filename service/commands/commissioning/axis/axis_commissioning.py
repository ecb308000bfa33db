"""Commissioning of one axis, step by step; all results are files in one folder.

A refusal stops this axis only.  The outcome is kept with a digest of everything on which it depends, and found again
only when the digest has changed.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from monitor_core.drive import split_name
from monitor_core.wording import listed
from service.commands.command_line.output_files import replace_text
from service.commands.commissioning.axis.axis_calibration import calibrated, tested
from service.commands.commissioning.axis.axis_identification import identified, identified_with_spring, other_program
from service.commands.commissioning.axis.axis_job import AxisJob, CommissioningProgress
from service.commands.commissioning.axis.coupling_search import with_coupling
from service.commands.commissioning.axis.load_search import LoadSearches
from service.commands.commissioning.signals.signal_proposals import Review
from service.config import AxisConfig
from service.config.written.commissioning_files import motion_file
from service.config.written.corrections import Correction
from service.ingest.records.axis_records import sha256_of
from service.ingest.records.record_ranges import wanted
from service.reports.commissioning_report import Outcome


def commission_axis(
    job: AxisJob, review: Review, progress: CommissioningProgress = lambda _phase, _work, _share: None
) -> Outcome:
    """Identify and calibrate an axis, unless both are done already with the same configuration and records.

    The steps, each of which adds to the outcome and writes its files:

    1. An axis with faults of its signals is refused.
    2. If the friction shows that the motor also moves with other axes, it is coupled with them.
    3. Identification gives nominal values; a motion is planned for what the records do not show.
    4. Calibration gives thresholds.  If one mass does not fit the records, the axis is identified with a spring, too.
    5. The axis is monitored in its own records: what could not be tested there is noted.

    ``job``: its configuration has the corrections of ``review``, the findings about its signals.
    """
    name = job.axis_id
    digest, earlier = _digest(job), earlier_result(job.folder, name)
    if earlier is not None and earlier.digest == digest:
        return earlier.outcome
    # Other files of the axis will be written, and may be all if this is interrupted.
    for written in (_kept_file(job.folder, name), job.folder / motion_file(name)):
        written.unlink(missing_ok=True)
    outcome = Outcome(name, corrections=review.corrections)
    if review.faults:
        return replace(outcome, refusal=f"not identified: {'; '.join(review.faults)}")
    job = job._replace(records=tuple(r for r in job.records if r not in review.standing))
    loads = LoadSearches(name, job.records, job.folder)
    job, outcome = with_coupling(job, replace(outcome, notes=tuple(_open_points(review))), loads, progress)
    before = outcome
    outcome = identified(job, before, loads, progress)
    if outcome.found is not None:
        outcome = calibrated(job, outcome, progress)
        if outcome.misfit:
            better = identified_with_spring(job, outcome, before, loads, progress)
            other = replace(outcome, refusal=f"{outcome.refusal}; configure another one")
            outcome = other if better is None else calibrated(job, better, progress)
        if outcome.changes and (motors := loads.search(job.text).motors_without_ratio):
            outcome = replace(outcome, refusal=f"{outcome.refusal}. {other_program(motors)}")
        if outcome.thresholds_file is not None:
            outcome = tested(job, outcome, progress)
        _, axis = job.configured()
        outcome = replace(outcome, notes=(*outcome.notes, *unmonitored_words(axis.config, outcome.watched)))
    kept = EarlierResult(digest, review.corrections, outcome)
    content = json.dumps({**kept._asdict(), "outcome": asdict(outcome)}, indent=1)
    replace_text(_kept_file(job.folder, name), content + "\n")
    return outcome


def _open_points(review: Review) -> Iterator[str]:
    """What the review of the signals leaves open, as sentences."""
    yield from (f"{words[0].upper()}{words[1:]}." for words in review.doubts)
    if review.unchecked:
        yield review.unchecked
    yield from (f"{record} is left out: the axis does not move in it." for record in review.standing)


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


# --- The result of an earlier call ------------------------------------------------------------------------------------


class EarlierResult(NamedTuple):
    """The outcome of an axis, as it is kept in the folder."""

    digest: str
    """Of everything on which it depends"""
    of_signals: tuple[Correction, ...]
    """Its first corrections, those of the signals of the axis"""
    outcome: Outcome


def earlier_result(folder: Path, axis_id: str) -> EarlierResult | None:
    """What an earlier call has found of an axis ("robot.axis"); None: nothing, or its files are not there any more."""
    try:
        content = json.loads(_kept_file(folder, axis_id).read_text(encoding="utf-8"))
        fields = content["outcome"]
        fields["corrections"] = _corrections(fields["corrections"])
        fields["smallest"] = tuple(tuple(row) for row in fields["smallest"])
        for name in ("watched", "untested", "notes", "pages", "lost", "excite"):
            fields[name] = tuple(fields[name])
        outcome = Outcome(**fields)
        found = EarlierResult(content["digest"], _corrections(content["of_signals"]), outcome)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    files = [f for f in (*outcome.pages, outcome.nominal_file, outcome.thresholds_file, outcome.motion) if f]
    return found if all((folder / name).exists() for name in files) else None


def _kept_file(folder: Path, axis_id: str) -> Path:
    return folder / f"{axis_id}.json"


def _corrections(rows: Iterable[Any]) -> tuple[Correction, ...]:
    return tuple(Correction(tuple(key), *rest) for key, *rest in rows)


def _digest(job: AxisJob) -> str:
    parts = [job.provenance.version, job.text, job.axis_id, repr(job.options), repr(job.shorten)]
    parts += [f"{record} {sha256_of(wanted(record).path)}" for record in job.records]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
