"""The result of an identification in tables and sentences, as the terminal prints it and the page shows it."""

from collections.abc import Iterator
from typing import NamedTuple

from rich.console import Console
from rich.markup import escape
from rich.text import Text

from monitor_core.drive import OUTPUT_UNITS
from monitor_core.identification import (
    LEVEL,
    ComparedRecord,
    Growth,
    ParameterRow,
)
from monitor_core.wording import percent
from service.ingest.records.loaded_records import RecordOrigin
from service.reports.formats import TextTable, for_terminal, labelled, number, plain
from service.reports.identification_report import IdentificationReport
from service.reports.outlook_words import verdict_words

_LONGEST_LABEL = 40
"""Longest name of a slope in a table [characters]"""


def print_text(report: IdentificationReport, console: Console) -> None:
    """What can be monitored and the verdict first, then parameters, fits, tests, warnings."""
    console.print(Text(f"{report.axis_id}: {report.outlook}", style="bold"), soft_wrap=True)
    console.print(Text(f"{verdict_line(report)}\n", style="bold"), soft_wrap=True)
    result, rows = report.result, list(report.result.rows())
    held = {number: "dim" for number, row in enumerate(rows) if row.held}
    parameters = parameter_table(rows)
    title, right = (
        f"{report.axis_id}: {result.start.drive.name}",
        {*parameters.titles} - {"parameter", "unit"},
    )
    console.print(for_terminal(parameters, title, right, len(parameters.titles), held))
    for words in slope_words(report):
        console.print(escape(words), soft_wrap=True)
    console.print(f"Predictor: {escape(predictor_words(report))}\n", soft_wrap=True)
    fits = fits_table(report)
    console.print(for_terminal(fits, "Fit, 100 (1 - |y - yhat| / |y - mean y|)", fits.titles[2:], 0))
    if result.growth is not None:
        masses = masses_table(result.growth)
        best = {n: "bold" for n, row in enumerate(masses.rows) if row[0] == str(result.growth.recommended)}
        title = "Masses in a row; AIC and BIC above the least"
        console.print(for_terminal(masses, title, masses.titles, 0, best))
        console.print(f"{escape(' '.join(result.growth.words))}\n", soft_wrap=True)
    for test in residual_words(report):
        if test.passed:  # else it is among the warnings
            console.print(escape(test.words), soft_wrap=True)
    for words in (*report.warnings, *result.bode.words):
        console.print(labelled("Note", words), soft_wrap=True)


def parameter_table(rows: list[ParameterRow]) -> TextTable:
    """A row for each parameter; values known before are in the last two columns, if there are any."""
    cells = [
        (
            row.name,
            number(row.value, row.sd),
            row.unit,
            plain(row.sd, 2) if row.sd is not None else "held",
            "about 0" if row.is_about_zero else percent(row.relative_sd),
            number(row.before),
            "" if row.held else percent(row.change, signed=True),
        )
        for row in rows
    ]
    titles = ("parameter", "value", "unit", "sd", "sd", "before", "change")
    count = 7 if any(row.before is not None for row in rows if not row.held) else 5
    return TextTable(titles[:count], [row[:count] for row in cells])


def name_of(source: RecordOrigin, trace: ComparedRecord) -> str:
    """The name of a record, with the part of it that is used: several parts of a record have one name."""
    if source.used == source.samples:
        return trace.name
    return f"{trace.name}, {source.start_s:.4g} to {source.end_s:.4g} s"


def fits_table(report: IdentificationReport) -> TextTable:
    """A row for each record."""
    rows = [
        (name_of(source, trace), purpose, f"{trace.fit:.2f} %", f"{trace.fit_simulation:.2f} %")
        for purpose, source, trace in report.traces()
    ]
    return TextTable(("record", "for", "one step ahead", "simulated"), rows)


def masses_table(growth: Growth) -> TextTable:
    """A row for each number of masses; AIC and BIC relative to the best one."""
    titles = ("masses", "sum of squares", "AIC", "BIC", "one step ahead", "simulated", "kept aside")
    count = 7 if any(model.validation for model in growth.models) else 6
    least = [min(getattr(model, name) for model in growth.models) for name in ("aic", "bic")]
    rows = [
        (
            str(model.masses),
            plain(model.estimate.cost, 5),
            f"{model.aic - least[0]:+.0f}",
            f"{model.bic - least[1]:+.0f}",
            f"{min(model.estimate.fit):.2f} %",
            f"{min(model.estimate.fit_simulation):.2f} %",
            f"{min(model.validation):.2f} %" if model.validation else "",
        )
        for model in growth.models
    ]
    return TextTable(titles[:count], [row[:count] for row in rows])


def verdict_line(report: IdentificationReport) -> str:
    """Quality of the fit: the second line of every report."""
    verdict = report.result.verdict
    repeated = "" if verdict.repeats_s is None else " of one motion"
    return f"{report.axis_id}: {verdict.quality.value} fit{repeated}: {verdict_words(verdict)}."


class Tested(NamedTuple):
    """One test of the prediction errors."""

    passed: bool
    words: str


def residual_words(report: IdentificationReport) -> Iterator[Tested]:
    """The two tests of the prediction errors; those of output error need not be white."""
    e = report.result.estimate
    white, independent = (test.p_value >= 1 - LEVEL for test in (e.whiteness, e.independence))
    output_error = e.problem.predictor == "output-error"
    if output_error:
        verdict = "are white" if white else "are not white, which output error allows: what disturbs the axis is slow"
    elif white:
        verdict = "look like white noise, as they should"
    else:
        verdict = "are not white: the noise model is not right"
    yield Tested(white or output_error, f"The prediction errors {verdict} (p = {e.whiteness.p_value:.2g}).")
    if independent:
        verdict = "do not depend on past torque: the drive explains all that the torque does"
    else:
        verdict = "depend on past torque: the drive does not describe all that the record shows"
    yield Tested(independent, f"The prediction errors {verdict} (p = {e.independence.p_value:.2g}).")


def slope_words(report: IdentificationReport) -> Iterator[str]:
    """One sentence on each signal that a parameter follows, numbered as in ``slope_labels``."""
    labels = slope_labels(report)
    for s in report.result.slopes():
        f, unit = s.scheduled, report.result.estimate.drive.parameter(s.scheduled.parameter).unit
        ends = " and ".join(f"{number(s.at(x))} where it is {x:.4g}" for x in (f.low, f.high))
        doubt = "" if s.is_significant else ", which cannot be distinguished from none"
        slope = f"by {number(s.slope, s.sd)} {unit} for each 1 of it (sd {plain(s.sd, 2)}){doubt}"
        label = f"{labels[f.slope]}: " if f.slope in labels else ""
        yield f"{label}{f.parameter} follows {f.term}, {slope}: {number(s.value)} at {f.reference:g}, {ends}."


def slope_labels(report: IdentificationReport) -> dict[str, str]:
    """Numbers for all slopes, by their names, if one of these is too long for the head of a table; else empty."""
    names = [s.scheduled.slope for s in report.result.slopes()]
    if all(len(name) <= _LONGEST_LABEL for name in names):
        return {}
    return {name: f"slope {number}" for number, name in enumerate(names, 1)}


def predictor_words(report: IdentificationReport) -> str:
    """One line on the predictor."""
    e = report.result.estimate
    unit = OUTPUT_UNITS[e.drive.output]
    kind = "innovations form" if e.problem.predictor == "innovations" else "output error"
    delay = f", torque {1e3 * e.delay_s:.3g} ms late" if e.delay_s else ""
    return (
        f"{kind}, every {1e3 * e.interval_s:g} ms{delay}; prediction errors of {e.lam0**0.5:.3g} {unit} (standard"
        f" deviation), {e.iterations} evaluations"
    )
