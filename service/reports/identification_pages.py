"""The tables of the report of an identification, and its picture of the drive, as HTML."""

from __future__ import annotations

import math

import numpy as np

from monitor_core.identification import Growth, ParameterRow, Slope
from service.ingest.identification_records import Source
from service.reports.identification_report import (
    MASSES_TITLES,
    IdentificationReport,
    deviation,
    masses_rows,
    number,
    relative,
)
from service.reports.page import heads, legend, listed, number_cell, table
from service.reports.text_format import escaped, percent, plain

_LEAST, _MOST = 1e-4, 1.0
"""Standard deviations at the ends of their bars, which are logarithmic."""
_POOR = 0.1
_STRONG = 0.95
_NOT_FOLLOWED = " These rows follow no signals: what those do is among their errors."
HELD = ' class="held"'
_RIGHT = {
    *("value", "before", "change", "sd", "between", "is then between", "slope"),
    *("fit one step ahead", "fit of the simulation"),
}
"""Titles that stand over numbers."""


def parameter_table(report: IdentificationReport) -> str:
    """All parameters, with bars of their standard deviations."""
    known = any(row.before is not None for row in report.result.rows() if not row.held)
    titles = ("", "value", "unit", "sd", "sd", "", *(("before", "change") if known else ()), "meaning")
    rows = "".join(_parameter(row, known) for row in report.result.rows())
    said = (
        f"sd: standard deviation; bars: it as part of the value, on a logarithmic scale from"
        f" {percent(_LEAST)} to {percent(_MOST)}."
    )
    return table(heads(titles, _RIGHT), rows) + legend(said)


def slope_table(report: IdentificationReport) -> str:
    """How parameters follow signals; empty where none does."""
    rows = "".join(
        _slope(one, report.result.estimate.drive.parameter(one.scheduled.parameter).unit)
        for one in report.result.slopes()
    )
    if not rows:
        return ""
    titles = ("", "follows", "between", "is then between", "unit", "slope", "sd", "")
    said = (
        "The values of parameters above hold where signals have their references:"
        f" {escaped(_references(report))}. The daemon follows the signals, of parameters that it monitors."
    )
    return table(heads(titles, _RIGHT), rows) + legend(said)


def _references(report: IdentificationReport) -> str:
    references = {one.scheduled.term: one.scheduled.reference for one in report.result.slopes()}
    return ", ".join(f"{term} = {reference:g}" for term, reference in references.items())


def _slope(s: Slope, unit: str) -> str:
    f = s.scheduled
    ends = number_cell(f"{f.low:.4g} and {f.high:.4g}") + number_cell(
        f"{number(s.at(f.low))} and {number(s.at(f.high))}"
    )
    doubt = "" if s.is_significant else "cannot be told from none"
    return (
        f"<tr><th>{escaped(f.parameter)}</th><td>{escaped(f.term)}</td>{ends}<td class='unit'>{escaped(unit)}</td>"
        f"{number_cell(number(s.slope, s.sd))}{number_cell(plain(s.sd, 2))}<td class='why'>{doubt}</td></tr>"
    )


def _parameter(row: ParameterRow, known: bool) -> str:
    if row.held:
        middle = f'<td colspan="3" class="why">held: {escaped(row.held)}</td>'
    else:
        middle = (
            f"{number_cell(deviation(row))}{number_cell(relative(row))}"
            f"<td>{'' if row.is_about_zero else _bar(row.relative_sd)}</td>"
        )
    before = ""
    if known:
        change = "" if row.held else percent(row.change, signed=True)
        before = f"{number_cell(number(row.before))}{number_cell(change)}"
    return (
        f"<tr{HELD if row.held else ''}><th>{escaped(row.name)}</th>{number_cell(number(row.value, row.sd))}"
        f'<td class="unit">{escaped(row.unit)}</td>{middle}{before}'
        f'<td class="meaning">{escaped(row.meaning)}</td></tr>'
    )


def _bar(sd: float | None) -> str:
    if sd is None or not math.isfinite(sd):
        return ""
    part = math.log(max(sd, _LEAST) / _LEAST) / math.log(_MOST / _LEAST)
    poor = " poor" if sd > _POOR else ""
    return f'<span class="bar{poor}"><i style="width: {100 * min(max(part, 0.03), 1):.0f}%"></i></span>'


def record_table(report: IdentificationReport) -> str:
    """What each record gave."""
    rows = "".join(
        f"<tr><th>{escaped(trace.name)}</th><td>{purpose}</td>{number_cell(f'{trace.fit:.2f} %')}"
        f"{number_cell(f'{trace.fit_simulation:.2f} %')}</tr>"
        for purpose, _, trace in report.traces()
    )
    titles = ("record", "for", "fit one step ahead", "fit of the simulation")
    said = (
        "Fit: 100 (1 - |y - yhat| / |y - mean y|). One step ahead the measured motion corrects the"
        " state at each sample; the simulation never looks at it again."
    )
    return table(heads(titles, _RIGHT), rows) + legend(said)


def masses_table(growth: Growth, follows: bool) -> str:
    """Rows of one, two, .. masses compared, what the records ask for stands out; ``follows``: the drive does so."""
    aside = any(one.validation for one in growth.models)
    titles = MASSES_TITLES if aside else MASSES_TITLES[:-1]
    rows = "".join(
        f"<tr{'' if row.wanted else HELD}>{''.join(number_cell(str(cell)) for cell in row[: len(titles)])}</tr>"
        for row in masses_rows(growth)
    )
    words = "".join(f"<p>{escaped(word)}</p>" for word in growth.words)
    said = (
        "Masses in a row, joined by springs and dampers, the motor first, each row fitted to the same"
        " records. AIC and BIC, above their least values, weigh the squared errors against the number of parameters;"
        f" BIC decides, and the fit to records kept aside.{_NOT_FOLLOWED if follows else ''}"
    )
    return words + table(heads(titles, titles), rows) + legend(said)


def correlation_table(report: IdentificationReport) -> str:
    """The whole matrix, coloured by size."""
    names, R = report.result.estimate.names, report.result.estimate.correlation
    rows = "".join(
        f"<tr><th>{escaped(name)}</th>{''.join(_correlation(float(r)) for r in R[i, :i])}"
        "<td class='quiet'>1</td></tr>"
        for i, name in enumerate(names)
    )
    said = (
        "Between two parameters whose estimates correlate near 1 or -1 these records can hardly tell:"
        " read an alarm of one as an alarm of both."
    )
    return table(heads(("", *names)), rows, "matrix") + legend(said)


def _correlation(r: float) -> str:
    if not np.isfinite(r):
        return "<td>?</td>"
    kind = " ".join(["minus"] * (r < 0) + ["strong"] * (abs(r) > _STRONG))
    return f'<td class="{kind}"><i style="opacity: {0.75 * abs(r):.2f}"></i><b>{r:.2f}</b></td>'


def provenance(report: IdentificationReport) -> str:
    """Records with their hashes, program, and how to do it again."""
    p = report.provenance
    sources = [source for _, source, _ in report.traces()]
    drawing = (
        f"<p>Drive drawn in {escaped(p.drawing[0])} <span class='hash'>{p.drawing[1]}</span></p>"
        if p.drawing
        else ""
    )
    started = (
        f"<p>{escaped(report.result.estimate.started_from)}</p>"
        if report.result.estimate.started_from
        else ""
    )
    program = f"<p>axiswatch {escaped(p.version)}, {escaped(p.date)}. To do it again:</p>"
    program += f"<pre>{escaped(p.command)}</pre>"
    return f"{listed(map(_source, sources))}{drawing}{started}{program}"


def _source(source: Source) -> str:
    return f"{escaped(source.words)}<br><span class='hash'>sha256 {source.sha256}</span>"
