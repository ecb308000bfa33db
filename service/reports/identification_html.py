"""The report of an identification as one HTML page, with its plots."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import OUTPUT_UNITS, Output
from monitor_core.identification import Bode, ComparedRecord, Correlation, FrequencyResponse, ParameterRow
from monitor_core.wording import percent
from service.reports import identification_tables as tables
from service.reports import plot_style as style
from service.reports.formats import render, safe
from service.reports.identification_report import IdentificationReport
from service.reports.outlook_words import watched_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis

_LEAST, _MOST = 1e-4, 1.0
"""Standard deviations at the ends of the logarithmic bars."""
_POOR = 0.1
_STRONG = 0.95


def as_html(report: IdentificationReport) -> str:
    """The complete HTML page."""
    result = report.result
    rows, labels = list(result.rows()), tables.slope_labels(report)
    names = [labels.get(name, name) for name in result.estimate.names]
    parameters = tables.parameter_table(rows)
    return render(
        "identification.html",
        verdict_line=tables.verdict_line(report),
        outlook=report.outlook,
        title=f"Identification of {report.axis_id}",
        report=report,
        predictor=tables.predictor_words(report),
        watched=watched_table(result),
        parameters=[
            (row, cells, _bar(row), (row.relative_sd or 0.0) > _POOR)
            for row, cells in zip(rows, parameters.rows, strict=True)
        ],
        parameter_titles=list(parameters.titles),
        bar_ends=(percent(_LEAST), percent(_MOST)),
        slopes=list(tables.slope_words(report)),
        masses=tables.masses_table(result.growth) if result.growth else None,
        traces=list(report.traces()),
        fits=tables.fits_table(report),
        trace_pictures=[
            (
                f"{tables.name_of(source, trace)} ({purpose})",
                safe(trace_picture(trace, result.start.drive.output, f"trace{k}")),
            )
            for k, (purpose, source, trace) in enumerate(report.traces())
        ],
        bode_picture=safe(bode_picture(result.bode)),
        residual_picture=safe(residual_picture(report)),
        tests=list(tables.residual_words(report)),
        names=names,
        correlations=[
            (name, [_correlation(float(r)) for r in result.estimate.correlation[i, :i]]) for i, name in enumerate(names)
        ],
    )


def _bar(row: ParameterRow) -> str | None:
    """Length of the bar for a relative standard deviation [%]; None: no bar."""
    sd = row.relative_sd
    if row.held or row.is_about_zero or sd is None or not math.isfinite(sd):
        return None
    share = math.log(max(sd, _LEAST) / _LEAST) / math.log(_MOST / _LEAST)
    return f"{100 * min(max(share, 0.03), 1):.0f}"


def _correlation(r: float) -> dict[str, Any]:
    if not np.isfinite(r):
        return {"value": None}
    kind = " ".join(["minus"] * (r < 0) + ["strong"] * (abs(r) > _STRONG))
    return {"value": f"{r:.2f}", "kind": kind, "opacity": f"{0.75 * abs(r):.2f}"}


# --- Plots: measurement and prediction, tests of the errors, Bode plot ------------------------------------------------


_ZOOM_S = 2.0
_SIGMAS = 2.0
_FLOOR_DB = 15.0
"""Space below and above the curve of the drive."""


def trace_picture(trace: ComparedRecord, output: Output, salt: str) -> str:
    """Plots of the whole record, of some seconds in detail, and of the errors."""
    quantity = f"{output} [{OUTPUT_UNITS[output]}]"
    with style.figure(7.4) as drawn:
        full, detail, run, ahead = drawn.subplots(4, 1, height_ratios=(2, 2, 1.1, 1.1))
        _lines(full, trace, slice(None))
        full.set(title="Whole record", ylabel=quantity)
        full.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2)
        part = _lively(trace)
        _lines(detail, trace, part)
        detail.set(title="In detail", ylabel=quantity, xlim=trace.t[part][[0, -1]])
        run.plot(trace.t, trace.y - trace.simulated, color=style.TEXT, lw=0.8)
        run.set(title="Errors of the simulation", ylabel="error")
        ahead.plot(trace.t, trace.y - trace.predicted, color=style.TEXT, lw=0.8)
        ahead.set(title="Errors one step ahead", ylabel="error", xlabel="time [s]")
        for axes in (full, run, ahead):
            axes.set_xlim(trace.t[0], trace.t[-1])
        return style.as_svg(drawn, f"{quantity} measured, predicted and simulated", salt)


def _lines(axes: Axes, trace: ComparedRecord, part: slice) -> None:
    t = trace.t[part]
    axes.plot(t, trace.y[part], **style.MEASURED, label="measured")
    axes.plot(t, trace.simulated[part], **style.ESTIMATE, label="simulated")
    axes.plot(t, trace.predicted[part], **style.DOWN, label="predicted one step ahead")


def _lively(trace: ComparedRecord) -> slice:
    """The seconds with the largest motion of the output."""
    h = float(np.median(np.diff(trace.t)))
    count = min(trace.t.size, max(20, round(_ZOOM_S / h)))
    moves = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(np.nan_to_num(trace.simulated), 2)))))
    if moves.size <= count:
        return slice(0, count)
    start = int(np.argmax(moves[count:] - moves[:-count]))
    return slice(start, start + count)


def residual_picture(report: IdentificationReport) -> str:
    """Autocorrelation of the prediction errors, and their correlation with the torque, with 99 % limits."""
    e = report.result.estimate
    with style.figure(2.9) as drawn:
        left, right = drawn.subplots(1, 2)
        _stems(left, e.whiteness, "Errors with earlier errors")
        _stems(right, e.independence, "Errors with earlier torque")
        return style.as_svg(drawn, "correlations of the prediction errors, with their limits", "residuals")


def _stems(axes: Axes, c: Correlation, title: str) -> None:
    for limit in (-c.limit, c.limit):
        axes.axhline(limit, **style.LIMIT)
    outside = np.abs(c.values) > c.limit
    for which, colour in ((~outside, style.BAND), (outside, style.TEXT)):
        axes.vlines(c.lags[which], 0, c.values[which], color=colour, lw=2)
    axes.axhline(0, color=style.QUIET, lw=0.8)
    largest = max(4 * c.limit, 1.15 * float(np.abs(c.values).max(initial=0.0)), 1e-3)
    axes.set(title=title, xlabel="lag [samples]", ylabel="correlation", ylim=(-largest, largest))
    axes.grid(axis="x", visible=False)


def bode_picture(bode: Bode) -> str:
    """Gain and phase from torque to speed over the excited band: drive with its band, black box, record."""
    from matplotlib.ticker import MultipleLocator

    with style.figure(6.2) as drawn:
        gain, phase = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        if bode.measured is not None:
            _measured(gain, phase, bode.measured, bode.drive)
        if bode.before is not None:
            _plain(gain, phase, bode.before, style.NOMINAL)
        if bode.black_box is not None:
            _plain(gain, phase, bode.black_box, style.DOTTED)
        _banded(gain, phase, bode.drive)
        lowest, highest = float(np.nanmin(bode.drive.db)), float(np.nanmax(bode.drive.db))
        gain.set(ylabel="gain [dB, rad/s per N m]", xscale="log", ylim=(lowest - _FLOOR_DB, highest + _FLOOR_DB))
        phase.set(ylabel="phase [degrees]", xlabel="frequency [rad/s]")
        phase.yaxis.set_major_locator(MultipleLocator(90))
        degrees = np.degrees(bode.drive.phase)
        phase.set_ylim(float(degrees.min()) - 60, float(degrees.max()) + 60)
        gain.set_xlim(_omega(bode.drive)[[0, -1]])
        hertz = gain.secondary_xaxis("top", functions=(lambda w: w / (2 * np.pi), lambda f: f * 2 * np.pi))
        hertz.set_xlabel("frequency [Hz]")
        for axis in (gain.xaxis, hertz.xaxis):
            _plain_decades(axis)
        gain.legend(loc="lower left")
        return style.as_svg(drawn, "frequency responses from torque to speed", "bode")


def _omega(response: FrequencyResponse) -> Floats:
    return 2 * np.pi * response.frequency_hz


def _banded(gain: Axes, phase: Axes, response: FrequencyResponse) -> None:
    w, degrees = _omega(response), np.degrees(response.phase)
    sd = np.degrees(_SIGMAS * response.sd_phase)
    for axes, low, high in ((gain, *response.band_db(_SIGMAS)), (phase, degrees - sd, degrees + sd)):
        axes.fill_between(w, low, high, color=style.BAND, alpha=0.45, lw=0)
    label = f"{response.name} (band: {_SIGMAS:g} standard deviations)"
    gain.plot(w, response.db, **style.ESTIMATE, label=label)
    phase.plot(w, degrees, **style.ESTIMATE)


def _plain(gain: Axes, phase: Axes, response: FrequencyResponse, look: style.LineStyle) -> None:
    gain.plot(_omega(response), response.db, **look, label=response.name)
    phase.plot(_omega(response), np.degrees(response.phase), **look)


def _measured(gain: Axes, phase: Axes, response: FrequencyResponse, near: FrequencyResponse) -> None:
    """Points with their deviations; the phase is shifted by whole turns to be nearest to that of the drive."""
    w = _omega(response)
    low, high = response.band_db(_SIGMAS)
    gain.vlines(w, low, high, color=style.BAND, lw=0.8, alpha=0.5)
    gain.plot(w, response.db, ".", color=style.BAND, ms=4, label=response.name)
    degrees = np.degrees(np.angle(response.G))
    expected = np.interp(w, _omega(near), np.degrees(near.phase))
    phase.plot(w, degrees + 360 * np.rint((expected - degrees) / 360), ".", color=style.BAND, ms=4)


def _plain_decades(axis: XAxis) -> None:
    """Axis labels 1, 2, 5, 10, 20, .. as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())
