"""Results of a replay: alarms and final estimates, as tables and as JSON."""

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from monitor_core.detection import Alarm, AlarmKey, Name, Reach
from monitor_core.monitoring import AxisStatus, DetectorStatus, ParameterStatus, ParameterTrend
from service.config import Config, NamedAxis
from service.ingest.records import Record
from service.ingest.timestamp_jitter import Stamps, remarks
from service.pipeline.alarms import AxisAlarm, Quantity, quantities
from service.pipeline.axis_monitors import AxisMonitors
from service.texts.alarm_texts import episode_words
from service.texts.timestamps import iso, maybe_iso
from service.texts.trend_texts import reach_words, trend_words

Json = dict[str, Any]


class Report:
    """Collects the results of a replay."""

    def __init__(self, config: Config, monitors: AxisMonitors) -> None:
        self.config, self.monitors = config, monitors
        self._alarms: dict[tuple[str, AlarmKey], AxisAlarm] = {}
        self.dropped: dict[str, dict[str, int]] = {axis.id: {} for axis in config.axes}
        self.frames_dropped: dict[str, dict[str, int]] = {}
        self.clock: dict[str, dict[str, int]] = {axis.id: {} for axis in config.axes}
        self.stamps: dict[str, Stamps] = {}
        self.quantities = quantities(monitors.by_id)
        """Unit and nominal value of whatever an alarm may name, by axis and name"""

    def add(self, changes: Iterable[AxisAlarm]) -> None:
        """Add alarms that were raised, updated or ended."""
        for change in changes:
            self._alarms[change.axis_id, change.alarm.key] = change

    def add_dropped(self, record: Record) -> None:
        """Add the drops of a record and its time stamps."""
        quality = record.quality
        for axis_id, counts in quality.axis_dropped.items():
            _count(self.dropped.setdefault(axis_id, {}), counts.items())
        for bus, counts in quality.bus_dropped.items():
            _count(self.frames_dropped.setdefault(bus, {}), counts.items())
        for axis_id, events in quality.axis_events.items():
            _count(self.clock[axis_id], events.items())
        self.stamps.update(quality.axis_stamps)

    def dropped_of(self, axis_id: str) -> dict[str, int]:
        """Drops before the monitor of an axis, by reason."""
        return {**self.dropped[axis_id], **self.monitors.dropped(axis_id)}

    def quantity(self, axis_id: str, name: str) -> Quantity:
        """Unit and present nominal value of a parameter, or of another cause."""
        known = self.monitors.by_id[axis_id].status().parameters
        now = next((Quantity(p.unit, p.nominal) for p in known if p.name == name), None)
        return now or self.quantities[axis_id, name]

    def alarms(self, axis_id: str) -> list[Alarm]:
        """The alarms of an axis, in the order in which they were raised."""
        return [change.alarm for change in self._alarms.values() if change.axis_id == axis_id]


def as_json(report: Report) -> str:
    """All results; numbers that are not finite are null, times are ISO 8601 UTC."""
    content = {
        "axes": [_axis(report, axis.id) for axis in report.config.axes],
        "frames_dropped": report.frames_dropped,
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def tables(report: Report) -> Iterator[Table]:
    """The estimates at the end, and the alarms."""
    columns = ("axis", "samples", "parameter", "unit", "nominal", "estimate", "change", "alarms")
    estimates = Table(*columns, title="Estimates at the end", title_justify="left")
    for axis in report.config.axes:
        status = report.monitors.by_id[axis.id].status()
        for p in status.parameters:
            count = sum(e.parameter == p.name for e in report.alarms(axis.id))
            estimates.add_row(*map(escape, (axis.id, _samples(status), *_cells(p), str(count or ""))))
    yield estimates
    yield _alarm_table(report)


def doubts(report: Report) -> Iterator[str]:
    """What could not be determined of the axes, in words."""
    for axis in report.config.axes:
        for words in report.monitors.by_id[axis.id].status().confounded:
            yield f"{axis.id}: {words}"


def trends(report: Report) -> Iterator[str]:
    """Long-term trends of axes with records that are long enough, in words."""
    for axis in report.config.axes:
        for p in report.monitors.trends.for_axis(axis.id):
            if p.trend is not None:
                yield "; ".join([f"{axis.id}: {trend_words(p.name, p.unit, p.trend)}", *_reached(p)])


def _reached(p: ParameterTrend) -> Iterator[str]:
    now_us = p.entries[-1].end_us if p.entries else 0
    return (reach_words(r, now_us) for r in p.reaches)


def stamp_remarks(report: Report) -> Iterator[str]:
    """Recommendations for the configuration from the time stamps, in words."""
    for axis in report.config.axes:
        yield from remarks_of(report, axis)


def remarks_of(report: Report, axis: NamedAxis) -> Iterable[str]:
    """Recommendations from the time stamps of one axis."""
    stamps = report.stamps.get(axis.id)
    return () if stamps is None else remarks(axis.id, axis.config.sample_interval_s, stamps)


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


def _alarm_table(report: Report) -> Table:
    table = Table(
        "axis",
        "parameter",
        "change",
        "onset",
        "raised",
        "ended",
        title="Alarms (times in UTC)",
        title_justify="left",
        caption_justify="left",
    )
    lines = list[str]()
    for axis in report.config.axes:
        for e in report.alarms(axis.id):
            p = report.quantity(axis.id, e.parameter)
            sized = f"{e.size:+.3g} ± {e.size_sd:.1g} ({_percent(e.size, p.nominal)})"
            change = sized if math.isfinite(e.size) else "-"
            times = (_onset(e), _short(e.raised_us), _short(e.ended_us))
            cells = (axis.id, e.parameter, change, *times)
            table.add_row(*map(escape, cells), style="red" if e.ended_us is None else None)
            lines.append(f"{axis.id}: {_sentence(e, p)}")
    table.caption = Text("\n".join(lines))
    if not table.row_count:
        table.add_row("none")
    return table


def _axis(report: Report, axis_id: str) -> Json:
    status = report.monitors.by_id[axis_id].status()
    return {
        "id": axis_id,
        "samples": status.samples,
        "last_sample": maybe_iso(status.time_us),
        "innovation_variance": _number(status.innovation_variance),
        "confounded": list(status.confounded),
        "gated_by": report.monitors.waits_for(axis_id) or None,
        "counters": dict(status.counters),
        "dropped": report.dropped_of(axis_id),
        "clock": report.clock[axis_id],
        "stamps": report.stamps[axis_id]._asdict() if axis_id in report.stamps else None,
        "parameters": [_parameter(p) for p in status.parameters],
        "detectors": [_detector(d) for d in status.detectors],
        "trends": [_trend(p) for p in report.monitors.trends.for_axis(axis_id)],
        "alarms": [_alarm(e, report.quantity(axis_id, e.parameter)) for e in report.alarms(axis_id)],
    }


def _detector(d: DetectorStatus) -> Json:
    return {**asdict(d), "evidence": _number(d.evidence)}


def _parameter(p: ParameterStatus) -> Json:
    numbers = {
        "nominal": p.nominal,
        "estimate": p.estimate,
        "standard_deviation": p.standard_deviation,
        "p_diagonal": p.p_diagonal,
        "cusum_up": p.g_up,
        "cusum_down": p.g_down,
        "threshold": p.h,
    }
    named: Json = {"name": p.name, "unit": p.unit, "status": str(p.status), "observation": str(p.observation)}
    return named | {name: _number(value) for name, value in numbers.items()}


def _trend(p: ParameterTrend) -> Json:
    t = p.trend
    return {
        "parameter": p.name,
        "words": trend_words(p.name, p.unit, t),
        "entries": len(p.entries),
        "probability": None if t is None else t.probability,
        "slope_per_day": None if t is None else t.slope * 86400,
        "slope_per_day_sd": None if t is None else t.slope_sd * 86400,
        "limits": [_limit(r, words) for r, words in zip(p.reaches, _reached(p), strict=True)],
    }


def _limit(r: Reach, words: str) -> Json:
    times = {"low": iso(r.low_us), "high": maybe_iso(r.high_us)}
    return {"name": r.name, "limit": r.limit, "unit": r.unit, "state": r.state, **times, "words": words}


def _alarm(e: Alarm, quantity: Quantity) -> Json:
    return {
        "parameter": e.parameter,
        "direction": e.direction,
        "words": _sentence(e, quantity),
        "stage": e.stage,
        "causes": [cause._asdict() for cause in e.causes],
        "doubt": e.doubt,
        "kind": e.kind,
        "reaches": [_limit(r, reach_words(r, e.updated_us)) for r in e.reaches],
        "onset": iso(e.onset_us),
        "onset_low": maybe_iso(e.onset_low_us),
        "onset_high": maybe_iso(e.onset_high_us),
        "raised": iso(e.raised_us),
        "updated": iso(e.updated_us),
        "ended": maybe_iso(e.ended_us),
        "size": _number(e.size),
        "size_sd": _number(e.size_sd),
        "crossings": e.crossings,
        "past": [_name(name) for name in e.past],
    }


def _name(name: Name) -> Json:
    return {
        "until": iso(name.until_us),
        "stage": name.stage,
        "parameter": name.parameter,
        "direction": name.direction,
    }


def _sentence(e: Alarm, quantity: Quantity) -> str:
    return episode_words(e, quantity.nominal, quantity.unit)


def _onset(e: Alarm) -> str:
    """The onset, with half the length of its interval where it is known."""
    if e.onset_low_us is None or e.onset_high_us is None:
        return _short(e.onset_us)
    return f"{_short(e.onset_us)} ± {(e.onset_high_us - e.onset_low_us) / 2e6:.1f} s"


def _short(t_us: int | None) -> str:
    """A time for people, to a tenth of a second."""
    return "open" if t_us is None else iso(t_us)[:21].replace("T", " ")


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _percent(change: float, nominal: float) -> str:
    return f"{100 * change / nominal:+.1f} %" if nominal else "-"


def _count(into: dict[str, int], counts: Iterable[tuple[str, int]]) -> None:
    for reason, number in counts:
        into[reason] = into.get(reason, 0) + number
