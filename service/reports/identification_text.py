"""The result of an identification for the terminal."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from monitor_core.identification import Growth
from service.reports.identification_report import (
    MASSES_TITLES,
    IdentificationReport,
    deviation,
    masses_rows,
    number,
    predictor_words,
    relative,
    residual_words,
    slope_words,
)
from service.reports.text_format import percent


def print_text(report: IdentificationReport, console: Console) -> None:
    """Parameters, fits, tests, doubts."""
    console.print(_parameters(report))
    for words in slope_words(report):
        console.print(escape(words), soft_wrap=True)
    console.print(f"Predictor: {escape(predictor_words(report))}\n", soft_wrap=True)
    console.print(_fits(report))
    if report.result.growth is not None:
        console.print(_masses(report.result.growth))
        console.print(f"{escape(' '.join(report.result.growth.words))}\n", soft_wrap=True)
    for test in residual_words(report):
        if test.passed:  # else it is among the warnings
            console.print(escape(test.words), soft_wrap=True)
    for words in (*report.warnings, *report.result.bode.words):
        console.print(Text.assemble(("Note: ", "bold yellow"), words), soft_wrap=True)


def _parameters(report: IdentificationReport) -> Table:
    title = f"{report.axis_id}: {report.result.start.drive.name}"
    table = Table("parameter", title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    known = any(row.before is not None for row in report.result.rows() if not row.held)
    for name in ("value", "unit", "sd", "sd", *(("before", "change") if known else ())):
        table.add_column(name, justify="left" if name == "unit" else "right", no_wrap=True)
    for row in report.result.rows():
        style = "dim" if row.held else None
        cells = (
            row.name,
            number(row.value, row.sd),
            row.unit,
            "held" if row.held else deviation(row),
            relative(row),
            number(row.before),
            percent(row.change, signed=True) if not row.held else "",
        )
        table.add_row(*map(escape, cells if known else cells[:-2]), style=style)
    return table


def _masses(growth: Growth) -> Table:
    title = "Masses in a row; AIC and BIC above the least"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    titles = MASSES_TITLES if any(model.validation for model in growth.models) else MASSES_TITLES[:-1]
    for name in titles:
        table.add_column(name, justify="right")
    for row in masses_rows(growth):
        table.add_row(*map(str, row[: len(titles)]), style="bold" if row.wanted else None)
    return table


def _fits(report: IdentificationReport) -> Table:
    title = "Fit, 100 (1 - |y - yhat| / |y - mean y|)"
    table = Table("record", "for", title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for name in ("one step ahead", "simulated"):
        table.add_column(name, justify="right")
    for purpose, _, trace in report.traces():
        table.add_row(escape(trace.name), purpose, f"{trace.fit:.2f} %", f"{trace.fit_simulation:.2f} %")
    return table
