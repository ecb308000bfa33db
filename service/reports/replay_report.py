"""Alarms and final estimates of a replay: tables on the terminal, and everything as JSON."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from monitor_core.detection import Alarm, Name, Reach
from monitor_core.monitoring import AxisStatus, ParameterStatus, ParameterTrend
from service.reports.formats import fields_of, json_text
from service.reports.replay_result import Replayed, ReplayedAxis, reached, trend_sentence
from service.texts import iso, maybe_iso, reach_words, trend_words

Json = dict[str, Any]


def print_text(replayed: Replayed, console: Console) -> None:
    """The estimates at the end, the alarms, trends, and what else is to be known."""
    console.print(_estimates(replayed))
    console.print(_alarms(replayed))
    for axis in replayed.axes:
        for trend in axis.known_trends:
            words = f"{axis.id}: {trend_sentence(trend)}"
            console.print(Text.assemble(("Trend: ", "bold"), words), soft_wrap=True)
    for axis in replayed.axes:
        for words in axis.notes:
            console.print(Text.assemble(("Note: ", "bold yellow"), words), soft_wrap=True)


def _estimates(replayed: Replayed) -> Table:
    columns = ("axis", "samples", "parameter", "unit", "nominal", "estimate", "change", "alarms")
    table = Table(*columns, title="Estimates at the end", title_justify="left")
    for axis in replayed.axes:
        for p in axis.status.parameters:
            count = sum(e.parameter == p.name for e in axis.alarms)
            table.add_row(*map(escape, (axis.id, _samples(axis.status), *_cells(p), str(count or ""))))
    return table


def _samples(status: AxisStatus) -> str:
    """Number of samples, and of those that operating conditions excluded."""
    gated = status.counters["gated"]
    return f"{status.samples}, {gated} gated" if gated else str(status.samples)


def _cells(p: ParameterStatus) -> tuple[str, ...]:
    unit, nominal = "" if p.unit == "1" else p.unit, f"{p.nominal:.4g}"
    if math.isnan(p.estimate):
        return p.name, unit, nominal, "invalid", ""
    estimate = f"{p.estimate:.4g} ± {p.standard_deviation:.1g}"
    return p.name, unit, nominal, estimate, _percent(p.estimate - p.nominal, p.nominal)


def _alarms(replayed: Replayed) -> Table:
    columns = ("axis", "parameter", "change", "onset", "raised", "ended")
    table = Table(*columns, title="Alarms (times in UTC)", title_justify="left", caption_justify="left")
    lines = list[str]()
    for axis in replayed.axes:
        for e in axis.alarms:
            share = _percent(e.size, axis.quantities[e.parameter].nominal)
            change = f"{e.size:+.3g} ± {e.size_sd:.1g} ({share})" if math.isfinite(e.size) else "-"
            times = (_onset(e), _short(e.raised_us), _short(e.ended_us))
            cells = (axis.id, e.parameter, change, *times)
            table.add_row(*map(escape, cells), style="red" if e.ended_us is None else None)
            lines.append(f"{axis.id}: {axis.words(e)}")
    table.caption = Text("\n".join(lines))
    if not table.row_count:
        table.add_row("none")
    return table


def _onset(e: Alarm) -> str:
    """The onset, with half the length of its interval where it is known."""
    if e.onset_low_us is None or e.onset_high_us is None:
        return _short(e.onset_us)
    return f"{_short(e.onset_us)} ± {(e.onset_high_us - e.onset_low_us) / 2e6:.1f} s"


def _short(t_us: int | None) -> str:
    """A time for people, to a tenth of a second."""
    return "open" if t_us is None else iso(t_us)[:21].replace("T", " ")


def _percent(change: float, nominal: float) -> str:
    return f"{100 * change / nominal:+.1f} %" if nominal else "-"


# --- JSON -------------------------------------------------------------------------------------------------------------


def as_json(replayed: Replayed) -> str:
    """All results; times are ISO 8601 UTC."""
    axes = [_axis(axis) for axis in replayed.axes]
    return json_text({"axes": axes, "frames_dropped": replayed.frames_dropped})


def _axis(axis: ReplayedAxis) -> Json:
    status = axis.status
    return {
        "id": axis.id,
        "samples": status.samples,
        "last_sample": maybe_iso(status.time_us),
        "innovation_variance": status.innovation_variance,
        "confounded": status.confounded,
        "gated_by": axis.gated_by or None,
        "counters": status.counters,
        "dropped": axis.dropped,
        "clock": axis.clock,
        "stamps": axis.stamps,
        "parameters": [_parameter(p) for p in status.parameters],
        "detectors": status.detectors,
        "trends": [_trend(p) for p in axis.trends],
        "alarms": [_alarm(e, axis) for e in axis.alarms],
    }


def _parameter(p: ParameterStatus) -> Json:
    return {
        "name": p.name,
        "unit": p.unit,
        "status": str(p.status),
        "observation": str(p.observation),
        "nominal": p.nominal,
        "estimate": p.estimate,
        "standard_deviation": p.standard_deviation,
        "p_diagonal": p.p_diagonal,
        "cusum_up": p.g_up,
        "cusum_down": p.g_down,
        "threshold": p.h,
    }


def _trend(p: ParameterTrend) -> Json:
    t = p.trend
    return {
        "parameter": p.name,
        "words": trend_words(p.name, p.unit, t),
        "entries": len(p.entries),
        "probability": None if t is None else t.probability,
        "slope_per_day": None if t is None else t.slope * 86400,
        "slope_per_day_sd": None if t is None else t.slope_sd * 86400,
        "limits": [_limit(r, words) for r, words in zip(p.reaches, reached(p), strict=True)],
    }


def _limit(r: Reach, words: str) -> Json:
    return {**_timed(r), "words": words}


def _alarm(e: Alarm, axis: ReplayedAxis) -> Json:
    reaches = [_limit(r, reach_words(r, e.updated_us)) for r in e.reaches]
    return {
        **_timed(e),
        "words": axis.words(e),
        "reaches": reaches,
        "past": [_timed(name) for name in e.past],
    }


def _timed(record: Alarm | Reach | Name) -> Json:
    """Its fields, with times such as onset_us written out as onset."""
    return {
        name.removesuffix("_us"): maybe_iso(value) if name.endswith("_us") else value
        for name, value in fields_of(record).items()
    }
