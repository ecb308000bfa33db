"""The report of an identification as one HTML page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from monitor_core.identification import LEVEL, ParameterRow
from service.reports import identification_report as content
from service.reports.formats import percent
from service.reports.html import render, safe
from service.reports.identification_plots import bode_picture, residual_picture, trace_picture
from service.reports.identification_report import IdentificationReport

_LEAST, _MOST = 1e-4, 1.0
"""Standard deviations at the ends of their bars, which are logarithmic."""
_POOR = 0.1
_STRONG = 0.95


def as_html(report: IdentificationReport) -> str:
    """The whole page."""
    result = report.result
    rows, names = list(result.rows()), list(result.estimate.names)
    parameters = content.parameter_table(rows)
    return render(
        "identification.html",
        title=f"Identification of {report.axis_id}",
        report=report,
        predictor=content.predictor_words(report),
        key_figures=list(_key_figures(report)),
        parameters=[
            (row, cells, _bar(row), (row.relative_sd or 0.0) > _POOR)
            for row, cells in zip(rows, parameters.rows, strict=True)
        ],
        parameter_titles=list(parameters.titles),
        bar_ends=(percent(_LEAST), percent(_MOST)),
        slopes=list(content.slope_words(report)),
        masses=content.masses_table(result.growth) if result.growth else None,
        traces=list(report.traces()),
        fits=content.fits_table(report),
        trace_pictures=list(_trace_pictures(report)),
        bode_picture=safe(bode_picture(result.bode)),
        residual_picture=safe(residual_picture(report)),
        tests=list(content.residual_words(report)),
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


def _bar(row: ParameterRow) -> str | None:
    """Length of the bar of its relative standard deviation [%]; None: no bar."""
    sd = row.relative_sd
    if row.held or row.is_about_zero or sd is None or not math.isfinite(sd):
        return None
    share = math.log(max(sd, _LEAST) / _LEAST) / math.log(_MOST / _LEAST)
    return f"{100 * min(max(share, 0.03), 1):.0f}"


def _trace_pictures(report: IdentificationReport) -> Iterator[tuple[str, str]]:
    output = report.result.start.drive.output
    for k, (purpose, _, trace) in enumerate(report.traces()):
        yield f"{trace.name} ({purpose})", safe(trace_picture(trace, output, f"trace{k}"))


def _correlation(r: float) -> dict[str, Any]:
    if not np.isfinite(r):
        return {"value": None}
    kind = " ".join(["minus"] * (r < 0) + ["strong"] * (abs(r) > _STRONG))
    return {"value": f"{r:.2f}", "kind": kind, "opacity": f"{0.75 * abs(r):.2f}"}
