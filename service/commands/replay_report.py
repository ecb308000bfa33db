"""What a replay found: alarms and final estimates, as tables and as JSON."""

import json
import math
from collections.abc import Iterable, Iterator
from typing import Any

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from monitor_core.episodes import Episode
from monitor_core.facts import AxisFacts, ParameterFacts
from service.alarm_words import alarm_words
from service.config import Config
from service.ingest.records import Record
from service.ingest.stamps import Stamps, remarks
from service.monitoring.banks import Change, Monitors
from service.web.times import iso, maybe_iso

Json = dict[str, Any]


class Report:
    """Collects what happens during a replay."""

    def __init__(self, config: Config, monitors: Monitors) -> None:
        self.config, self.monitors = config, monitors
        self._alarms: dict[tuple[str, str, str, int], Change] = {}
        self.dropped: dict[str, dict[str, int]] = {axis.id: {} for axis in config.axes}
        self.frames_dropped: dict[str, dict[str, int]] = {}
        self.clock: dict[str, dict[str, int]] = {axis.id: {} for axis in config.axes}
        self.stamps: dict[str, Stamps] = {}

    def add(self, changes: Iterable[Change]) -> None:
        """Alarms that were raised, updated or ended."""
        for change in changes:
            e = change.episode
            self._alarms[change.axis_id, e.parameter, e.direction, e.raised_us] = change

    def add_dropped(self, record: Record) -> None:
        """What the record lost, and how the times of its samples were."""
        for axis_id, counts in record.axis_dropped.items():
            _count(self.dropped.setdefault(axis_id, {}), counts.items())
        for bus, counts in record.bus_dropped.items():
            _count(self.frames_dropped.setdefault(bus, {}), counts.items())

        for axis_id, events in record.axis_events.items():
            _count(self.clock[axis_id], events.items())
        self.stamps.update(record.axis_stamps)

    def dropped_of(self, axis_id: str) -> dict[str, int]:
        """What never reached the monitor of an axis, by reason."""
        return {**self.dropped[axis_id], **self.monitors.dropped(axis_id)}

    def alarms(self, axis_id: str) -> list[Episode]:
        """The alarms of an axis, in the order in which they were raised."""
        return [change.episode for change in self._alarms.values() if change.axis_id == axis_id]


def as_json(report: Report) -> str:
    """All of it; numbers that are not finite are null, times are ISO 8601 UTC."""
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
        facts = report.monitors.by_id[axis.id].facts()
        for p in facts.parameters:
            count = sum(e.parameter == p.name for e in report.alarms(axis.id))
            estimates.add_row(*map(escape, (axis.id, _samples(facts), *_cells(p), str(count or ""))))
    yield estimates
    yield _alarm_table(report)


def doubts(report: Report) -> Iterator[str]:
    """What cannot be told of an axis, in words."""
    for axis in report.config.axes:
        for words in report.monitors.by_id[axis.id].facts().confounded:
            yield f"{axis.id}: {words}"


def stamp_remarks(report: Report) -> Iterator[str]:
    """What the time stamps say about the configuration, in words."""
    for axis in report.config.axes:
        if axis.id in report.stamps:
            yield from remarks(axis.id, axis.config.sample_interval_s, report.stamps[axis.id])


def _samples(facts: AxisFacts) -> str:
    """How many there were, and of how many operating conditions forbade the use."""
    gated = facts.counters["gated"]
    return f"{facts.samples}, {gated} gated" if gated else str(facts.samples)


def _cells(p: ParameterFacts) -> tuple[str, ...]:
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
    said = list[str]()
    for axis in report.config.axes:
        known = {p.name: p for p in report.monitors.by_id[axis.id].facts().parameters}
        for e in report.alarms(axis.id):
            p = known[e.parameter]
            change = f"{e.size:+.3g} ± {e.size_sd:.1g} ({_percent(e.size, p.nominal)})"
            times = (_short(e.onset_us), _short(e.raised_us), _short(e.ended_us))
            cells = (axis.id, e.parameter, change, *times)
            table.add_row(*map(escape, cells), style="red" if e.ended_us is None else None)
            said.append(f"{axis.id}: {_said(e, p)}")
    table.caption = Text("\n".join(said))
    if not table.row_count:
        table.add_row("none")
    return table


def _axis(report: Report, axis_id: str) -> Json:
    facts = report.monitors.by_id[axis_id].facts()
    return {
        "id": axis_id,
        "samples": facts.samples,
        "last_sample": maybe_iso(facts.time_us),
        "innovation_variance": _number(facts.innovation_variance),
        "confounded": list(facts.confounded),
        "gated_by": report.monitors.waits_for(axis_id) or None,
        "counters": dict(facts.counters),
        "dropped": report.dropped_of(axis_id),
        "clock": report.clock[axis_id],
        "stamps": report.stamps[axis_id]._asdict() if axis_id in report.stamps else None,
        "parameters": [_parameter(p) for p in facts.parameters],
        "alarms": [_alarm(e, facts) for e in report.alarms(axis_id)],
    }


def _parameter(p: ParameterFacts) -> Json:
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


def _alarm(e: Episode, facts: AxisFacts) -> Json:
    return {
        "parameter": e.parameter,
        "direction": e.direction,
        "words": _said(e, next(p for p in facts.parameters if p.name == e.parameter)),
        "onset": iso(e.onset_us),
        "raised": iso(e.raised_us),
        "updated": iso(e.updated_us),
        "ended": maybe_iso(e.ended_us),
        "size": _number(e.size),
        "size_sd": _number(e.size_sd),
        "crossings": e.crossings,
    }


def _said(e: Episode, p: ParameterFacts) -> str:
    return alarm_words(e.parameter, e.size, p.nominal, p.unit)


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
