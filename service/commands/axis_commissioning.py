"""The commissioning of one axis: its signals are checked, it is identified, it is calibrated; all into one folder.

A refusal ends the way of this axis, not of the others.  What was found is kept with digests of all that it depends on:
with the same it is not computed again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from service.commands.output_files import replace_text
from service.commands.signal_proposals import configured
from service.config.commissioned import Correction, commissioned, corrected, pages_of
from service.reports.commissioning_report import Outcome

if TYPE_CHECKING:
    from monitor_core.calibration import CalibrationOptions
    from service.reports.calibration_report import Calibration
    from service.reports.formats import Provenance


Progress = Callable[[str, str, float], None]
"""Called with the phase, "identify" or "calibrate", its present work, and how much of that is done, 0 to 1"""


class Order(NamedTuple):
    """What is asked for one axis; it can be sent to another process."""

    text: str
    """Of the configuration, valid in ``folder``"""
    axis_id: str
    records: tuple[str, ...]
    folder: Path
    options: CalibrationOptions
    provenance: Provenance
    shorten: bool
    """Where the records do not support the budget: take the longest that they do"""


# --- From the records to nominal values and thresholds ----------------------------------------------------------------


def commission_axis(
    order: Order,
    corrections: Sequence[Correction],
    progress: Progress = lambda _phase, _work, _share: None,
) -> Outcome:
    """Identify and calibrate an axis, unless that was done before with the same configuration and records."""
    name = order.axis_id
    text = corrected(order.text, name, corrections)
    digest = _digest(text, order)
    kept = order.folder / f"{name}.json"
    if (before := _read(kept, digest, order.folder)) is not None:
        return before
    first = Outcome(name, corrections=tuple(corrections))
    outcome = _identified(order, text, first, progress)
    if outcome.found is not None:
        outcome = _calibrated(order, text, outcome, progress)
    replace_text(kept, json.dumps({"digest": digest, "outcome": asdict(outcome)}, indent=1) + "\n")
    return outcome


def _identified(order: Order, text: str, outcome: Outcome, progress: Progress) -> Outcome:
    from service.commands.identification_task import Request, drawing_of, prepare
    from service.reports.identification_files import as_toml
    from service.reports.identification_html import as_html
    from service.reports.identification_report import outlook_words, verdict_line

    config, axis = configured(text, order.axis_id, order.folder)
    try:
        progress("identify", "reading the records", 0.0)
        task = prepare(config, axis, order.records, [], Request())
        provenance = order.provenance._replace(drawing=drawing_of(axis.config))
        report = task.run(provenance, _within("identify", progress))
    except _mistakes() as error:
        return replace(outcome, refusal=f"not identified: {error}")
    page, values = pages_of(axis.id)[0], f"{axis.id}-nominal.toml"
    replace_text(order.folder / page, as_html(report))
    outcome = replace(
        outcome,
        verdict=verdict_line(report).removeprefix(f"{axis.id}: ").capitalize(),
        outlook=outlook_words(report),
        notes=report.warnings,
        pages=(page,),
    )
    if report.rejection:
        return replace(outcome, refusal=f"not identified: {report.rejection}")
    replace_text(order.folder / values, as_toml(report))
    watched = tuple(w.name for w in report.result.watched if w.obstacle is None)
    refusal = "" if watched else outcome.outlook.removesuffix(".")
    return replace(outcome, nominal_file=values, watched=watched, refusal=refusal)


def _calibrated(order: Order, text: str, outcome: Outcome, progress: Progress) -> Outcome:
    from monitor_core.calibration import CalibrationError
    from service.commands.calibrate import calibrate_axis
    from service.reports.calibration_files import as_html, as_toml

    assert outcome.found is not None
    config, axis = configured(commissioned(text, {order.axis_id: outcome.found}), order.axis_id, order.folder)

    def calibrate(options: CalibrationOptions) -> Calibration:
        step = _within("calibrate", progress)
        return calibrate_axis(config, axis, order.records, options, order.provenance, step)

    options, notes = order.options, outcome.notes
    try:
        try:
            found = calibrate(options)
        except CalibrationError as error:
            if error.budget_s is None or not order.shorten:
                raise
            notes, options = (*notes, f"{error}."), replace(options, budget_s=_rounded(error.budget_s))
            found = calibrate(options)
    except _mistakes() as error:
        return replace(outcome, refusal=f"not calibrated: {error}")
    page, values = pages_of(order.axis_id)[1], f"{order.axis_id}-thresholds.toml"
    replace_text(order.folder / page, as_html(found))
    replace_text(order.folder / values, as_toml(found))
    first = found.detectors[0]
    return replace(
        outcome,
        notes=(*notes, *found.warnings),
        thresholds_file=values,
        budget_s=options.budget_s,
        promise=first.promise,
        within_s=found.result.within_s,
        smallest=tuple((name, *first.smallest(name)) for name in found.result.model.monitored),
        pages=(*outcome.pages, page),
    )


def _within(phase: str, progress: Progress) -> Callable[[str, float, float], None]:
    return lambda work, done, total: progress(phase, work, done / total if total else 0.0)


def _rounded(budget_s: float) -> float:
    """Two digits, downwards."""
    digits = float(f"{budget_s:.1e}")
    return digits if digits <= budget_s else float(f"{budget_s * 0.95:.1e}")


def _mistakes() -> tuple[type[Exception], ...]:
    from monitor_core.calibration import CalibrationError
    from monitor_core.identification import IdentificationError
    from monitor_core.modeling import ModelError
    from service.can.dbc import DbcError
    from service.can.user_errors import IngestError, RecordError
    from service.config import ConfigErrors
    from service.config.axis_settings import AxisError

    return (
        *(CalibrationError, IdentificationError, ModelError, DbcError, IngestError, RecordError),
        *(ConfigErrors, AxisError),
    )


# --- What was found before --------------------------------------------------------------------------------------------


def _digest(text: str, order: Order) -> str:
    from service.ingest.axis_records import sha256_of, wanted

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
        for name in ("watched", "notes", "pages"):
            fields[name] = tuple(fields[name])
        outcome = Outcome(**fields)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    files = [*outcome.pages, *(f for f in (outcome.nominal_file, outcome.thresholds_file) if f is not None)]
    return outcome if all((folder / name).exists() for name in files) else None
