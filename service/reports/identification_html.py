"""The result of an identification as one page that needs nothing else: for the screen, light or dark, and for paper."""

from __future__ import annotations

from collections.abc import Iterator

from monitor_core.identification import LEVEL
from service.reports.identification_pages import (
    correlation_table,
    masses_table,
    parameter_table,
    provenance,
    record_table,
    slope_table,
)
from service.reports.identification_plots import bode_picture, residual_picture, trace_picture
from service.reports.identification_report import IdentificationReport, predictor_words, residual_words
from service.reports.page import document, legend, section, sentences, tiles, verdict
from service.reports.text_format import escaped, percent


def as_html(report: IdentificationReport) -> str:
    """The whole page."""
    title = f"Identification of {report.axis_id}"
    return document(title, _subtitle(report), _verdict(report), _tiles(report), *_sections(report))


def _sections(report: IdentificationReport) -> Iterator[str]:
    doubts = (*report.warnings, *report.result.bode.words)
    if doubts:
        yield section("What to look at", sentences(doubts))
    yield section("Parameters", parameter_table(report))
    if report.result.scheduled:
        yield section("What follows measured signals", slope_table(report))
    if report.result.growth is not None:
        yield section("How many masses", masses_table(report.result.growth, bool(report.result.scheduled)))
    yield section("Measured and predicted", record_table(report), *_traces(report))
    yield section("Frequency response", *_bode(report))
    yield section(
        "Prediction errors",
        *(f"<p>{escaped(test.words)}</p>" for test in residual_words(report)),
        *_residuals(report),
    )
    yield section("Correlations of the estimates", correlation_table(report))
    yield section("Where it comes from", provenance(report))


def _subtitle(report: IdentificationReport) -> str:
    p = report.provenance
    drive = f"drive {report.result.start.drive.name}, {predictor_words(report)}"
    return f"{escaped(drive)}<br>{escaped(p.date[:10])}, axiswatch {escaped(p.version)}"


def _verdict(report: IdentificationReport) -> str:
    why_not = report.rejection
    if why_not:
        return verdict("bad", "No nominal values:", f"{why_not}.")
    if report.warnings:
        count = len(report.warnings)
        words = f"with {count} thing{'s' if count > 1 else ''} to look at first, below."
        return verdict("warn", "Nominal values found,", words)
    return verdict("good", "Nominal values found,", "and nothing speaks against them.")


def _tiles(report: IdentificationReport) -> str:
    e = report.result.estimate
    rows = [row for row in report.result.rows() if row.sd is not None]
    worst = max((row.relative_sd or 0.0 for row in rows if not row.is_about_zero), default=0.0)
    zero = ", ".join(row.name for row in rows if row.is_about_zero)
    validation = min((trace.fit_simulation for trace in report.result.validation), default=None)
    of = [
        (f"{min(t.fit_simulation for t in report.result.estimation):.1f} %", "fit of the simulation"),
        ("-", "no record was kept aside to compare")
        if validation is None
        else (f"{validation:.1f} %", "the same, on records kept aside"),
        (
            percent(worst),
            f"largest standard deviation of a parameter{f'; about 0: {escaped(zero)}' if zero else ''}",
        ),
        (
            "yes" if e.independence.p_value >= 1 - LEVEL else "no",
            "does the drive explain all that the torque does?",
        ),
    ]
    return tiles(of)


def _traces(report: IdentificationReport) -> Iterator[str]:
    output = report.result.start.drive.output
    for number, (purpose, trace) in enumerate(
        [("estimation", t) for t in report.result.estimation]
        + [("validation", t) for t in report.result.validation]
    ):
        caption = escaped(f"{trace.name} ({purpose})")
        picture = trace_picture(trace, output, f"trace{number}")
        yield f"<figure><figcaption>{caption}</figcaption>{picture}</figure>"


def _bode(report: IdentificationReport) -> Iterator[str]:
    yield f"<figure>{bode_picture(report.result.bode)}</figure>"
    yield legend(
        "From torque to speed, over the band in which the records have torque. The black box (ARX)"
        " and the response of the record know nothing of masses and springs: where the drive lies on them, its"
        " structure is right. Coulomb friction acts on them, not on the drive's curve."
    )


def _residuals(report: IdentificationReport) -> Iterator[str]:
    yield f"<figure>{residual_picture(report)}</figure>"
    yield legend(
        "Shaded: where 99 of 100 values lie if there is nothing left to explain. Negative lags on the"
        " right show feedback from the motion to the torque."
    )
