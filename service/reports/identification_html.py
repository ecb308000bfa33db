"""The report of an identification as one HTML page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from monitor_core.identification import LEVEL, ParameterRow, Slope
from service.reports.html import render, safe
from service.reports.identification_plots import bode_picture, residual_picture, trace_picture
from service.reports.identification_report import (
    MASSES_TITLES,
    IdentificationReport,
    deviation,
    masses_rows,
    number,
    predictor_words,
    relative,
    residual_words,
)
from service.reports.text_format import percent, plain

_LEAST, _MOST = 1e-4, 1.0
"""Standard deviations at the ends of their bars, which are logarithmic."""
_POOR = 0.1
_STRONG = 0.95
_NUMBERS = {
    *("value", "before", "change", "sd", "between", "is then between", "slope"),
    *("fit one step ahead", "fit of the simulation"),
}
"""Titles that stand over numbers."""


def as_html(report: IdentificationReport) -> str:
    """The whole page."""
    result = report.result
    rows, slopes = list(result.rows()), list(result.slopes())
    growth, names = result.growth, list(result.estimate.names)
    with_validation = growth is not None and any(model.validation for model in growth.models)
    return render(
        "identification.html",
        title=f"Identification of {report.axis_id}",
        report=report,
        predictor=predictor_words(report),
        key_figures=list(_key_figures(report)),
        NUMBERS=_NUMBERS,
        parameters=[_parameter(row) for row in rows],
        known_before=any(row.before is not None for row in rows if not row.held),
        bar_ends=(percent(_LEAST), percent(_MOST)),
        slopes=[_slope(s, result.estimate.drive.parameter(s.scheduled.parameter).unit) for s in slopes],
        references=_references(slopes),
        masses=list(masses_rows(growth)) if growth else [],
        masses_titles=MASSES_TITLES if with_validation else MASSES_TITLES[:-1],
        traces=list(report.traces()),
        trace_pictures=list(_trace_pictures(report)),
        bode_picture=safe(bode_picture(result.bode)),
        residual_picture=safe(residual_picture(report)),
        tests=list(residual_words(report)),
        names=names,
        correlations=[
            (name, [_correlation(float(r)) for r in result.estimate.correlation[i, :i]])
            for i, name in enumerate(names)
        ],
    )


def _key_figures(report: IdentificationReport) -> Iterator[tuple[str, str]]:
    result = report.result
    rows = [row for row in result.rows() if row.sd is not None]
    worst = max((row.relative_sd or 0.0 for row in rows if not row.is_about_zero), default=0.0)
    zero = ", ".join(row.name for row in rows if row.is_about_zero)
    yield f"{min(t.fit_simulation for t in result.estimation):.1f} %", "fit of the simulation"
    if result.validation:
        fit = min(trace.fit_simulation for trace in result.validation)
        yield f"{fit:.1f} %", "the same, on records kept aside"
    else:
        yield "-", "no record was kept aside to compare"
    yield percent(worst), f"largest standard deviation of a parameter{f'; about 0: {zero}' if zero else ''}"
    independent = result.estimate.independence.p_value >= 1 - LEVEL
    yield "yes" if independent else "no", "does the drive explain all that the torque does?"


def _parameter(row: ParameterRow) -> dict[str, Any]:
    bar = None if row.held or row.is_about_zero else _bar(row.relative_sd)
    return {
        "name": row.name,
        "held": row.held,
        "unit": row.unit,
        "meaning": row.meaning,
        "value": number(row.value, row.sd),
        "sd": deviation(row),
        "relative": relative(row),
        "bar": bar,
        "poor": bar is not None and (row.relative_sd or 0.0) > _POOR,
        "before": number(row.before),
        "change": "" if row.held else percent(row.change, signed=True),
    }


def _bar(sd: float | None) -> str | None:
    """Length of the bar [%]; None: no bar."""
    if sd is None or not math.isfinite(sd):
        return None
    share = math.log(max(sd, _LEAST) / _LEAST) / math.log(_MOST / _LEAST)
    return f"{100 * min(max(share, 0.03), 1):.0f}"


def _slope(s: Slope, unit: str) -> dict[str, str]:
    term = s.scheduled
    return {
        "parameter": term.parameter,
        "term": term.term,
        "between": f"{term.low:.4g} and {term.high:.4g}",
        "limits": f"{number(s.at(term.low))} and {number(s.at(term.high))}",
        "unit": unit,
        "slope": number(s.slope, s.sd),
        "sd": plain(s.sd, 2),
        "doubt": "" if s.is_significant else "cannot be told from none",
    }


def _references(slopes: list[Slope]) -> str:
    references = {s.scheduled.term: s.scheduled.reference for s in slopes}
    return ", ".join(f"{term} = {reference:g}" for term, reference in references.items())


def _trace_pictures(report: IdentificationReport) -> Iterator[tuple[str, str]]:
    output = report.result.start.drive.output
    for k, (purpose, _, trace) in enumerate(report.traces()):
        yield f"{trace.name} ({purpose})", safe(trace_picture(trace, output, f"trace{k}"))


def _correlation(r: float) -> dict[str, str | None]:
    if not np.isfinite(r):
        return {"value": None}
    kind = " ".join(["minus"] * (r < 0) + ["strong"] * (abs(r) > _STRONG))
    return {"value": f"{r:.2f}", "kind": kind, "opacity": f"{0.75 * abs(r):.2f}"}
