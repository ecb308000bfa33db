"""The report of a replay as one HTML page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from monitor_core.detection import Alarm
from monitor_core.monitoring import ParameterStatus, Status
from monitor_core.trend import COVERED
from service.reports.formats import percent, plain, render, safe
from service.reports.replay_course import SIGMAS, Course
from service.reports.replay_plots import axis_pictures
from service.reports.replay_result import (
    REASONS,
    Replayed,
    ReplayedAxis,
    dated,
    duration,
    time_unit,
    trend_sentence,
)
from service.reports.trend_plots import trend_picture

_ARROWS = {"up": "↑ up", "down": "↓ down"}


def as_html(replayed: Replayed) -> str:
    """The whole page."""
    first, more = replayed.records[0], len(replayed.records) - 1
    return render(
        "replay.html",
        title=f"Replay of {f'{first} and {more} more' if more else first}",
        replayed=replayed,
        outcome=_outcome(replayed),
        key_figures=_key_figures(replayed),
        notes=[note for axis in replayed.axes for note in axis.notes],
        alarms=[_alarm(axis, alarm) for axis in replayed.axes for alarm in axis.alarms],
        axes=[_axis(axis, f"axis{k}") for k, axis in enumerate(replayed.axes)],
        frames=[_counters(bus, counts, 0) for bus, counts in replayed.frames_dropped.items()],
        sigmas=f"{SIGMAS:g}",
        covered=f"{100 * COVERED:.0f}",
    )


def _outcome(replayed: Replayed) -> tuple[str, str, str]:
    """Kind, first words and the rest of the first thing to read."""
    count = sum(len(axis.alarms) for axis in replayed.axes)
    silent = [axis.id for axis in replayed.axes if not axis.status.samples]
    idle = [axis.id for axis in replayed.axes if axis.status.samples and not axis.status.counters["used"]]
    rest = f" No samples of {', '.join(silent)}." if silent else ""
    rest += f" Nothing was learned of {', '.join(idle)}." if idle else ""
    if count:
        alarmed = [axis.id for axis in replayed.axes if axis.alarms]
        return "bad", f"{count} alarm{_s(count)}", f"of {', '.join(alarmed)}.{rest}"
    return ("warn", "No alarm.", rest.strip()) if rest else ("good", "No alarm.", "")


def _key_figures(replayed: Replayed) -> tuple[tuple[str, str], ...]:
    samples = sum(axis.status.samples for axis in replayed.axes)
    used = sum(axis.status.counters["used"] for axis in replayed.axes)
    longest = max((1e-6 * _course(axis).timeline.end_us for axis in replayed.axes), default=0.0)
    dropped = sum(_without_missing(axis.dropped) for axis in replayed.axes)
    dropped += sum(map(_without_missing, replayed.frames_dropped.values()))
    alarms, axes = sum(len(axis.alarms) for axis in replayed.axes), len(replayed.axes)
    return (
        (str(alarms), f"alarm{_s(alarms)}, on {axes} ax{'e' if axes > 1 else 'i'}s"),
        (duration(longest), "of samples; pauses do not count"),
        (f"{100 * used / samples:.1f} %", f"of {samples} samples were learned from"),
        (str(dropped), "frames, values or rows came and gave no sample"),
    )


def _without_missing(dropped: Mapping[str, int]) -> int:
    """What came and gave no sample: in a pause millions may never have come."""
    return sum(count for reason, count in dropped.items() if reason != "missing")


def _s(count: int) -> str:
    return "" if count == 1 else "s"


def _alarm(axis: ReplayedAxis, alarm: Alarm) -> dict[str, Any]:
    quantity, sized = axis.quantities[alarm.parameter], math.isfinite(alarm.size)
    share = percent(alarm.size / quantity.nominal, signed=True) if quantity.nominal and sized else "-"
    return {
        "axis": axis.id,
        "parameter": alarm.parameter,
        "direction": _ARROWS[alarm.direction],
        "times": [_time(axis, t) for t in (alarm.onset_us, alarm.raised_us, alarm.ended_us)],
        "size": f"{plain(alarm.size, 3)} ± {plain(alarm.size_sd, 2)}" if sized else "-",
        "unit": quantity.unit,
        "share": share,
        "words": f"{axis.id}: {axis.words(alarm)}",
    }


def _time(axis: ReplayedAxis, t_us: int | None) -> tuple[str | None, str]:
    if t_us is None:
        return None, ""
    line = _course(axis).timeline
    return time_unit(1e-6 * line.end_us).written(line.find(t_us)), dated(t_us)


def _axis(axis: ReplayedAxis, salt: str) -> dict[str, Any]:
    status, course, trends = axis.status, _course(axis), axis.known_trends
    beside = ("of the multi-model detector",) if course.beside is not None else ()
    meanings = {p.name: p.meaning for p in status.parameters}
    names = [meanings[trend.name] for trend in trends]
    parameters = enumerate(status.parameters if status.samples else ())
    return {
        "id": axis.id,
        "span": _span(axis),
        "detectors": _detectors(axis),
        "numbers": ("estimate", "sd", "change", "largest g / h", *beside, "alarms"),
        "parameters": [_parameter(axis, i, p) for i, p in parameters],
        "pictures": list(map(safe, axis_pictures(axis, course, salt))) if course.used else [],
        "multimodel": bool(beside),
        "trends": [trend_sentence(trend) for trend in trends],
        "trend_picture": safe(trend_picture(axis.id, trends, names, f"{salt}-trend")) if trends else "",
        "counters": [
            _counters(f"of {status.samples} samples", status.counters, status.samples),
            _counters("no samples", axis.dropped, 0),
            _counters("clocks", axis.clock, 0),
        ],
    }


def _course(axis: ReplayedAxis) -> Course:
    assert axis.course is not None, "a page is drawn of a replay that collects courses"
    return axis.course


def _parameter(axis: ReplayedAxis, i: int, p: ParameterStatus) -> dict[str, Any]:
    known, course = math.isfinite(p.estimate), _course(axis)
    alarms = sum(alarm.parameter == p.name for alarm in axis.alarms)
    numbers = [
        plain(p.estimate, 5) if known else "invalid",
        plain(p.standard_deviation, 2),
        percent(p.estimate / p.nominal - 1, signed=True) if known and p.nominal else "",
        f"{course.largest_g(i) / course.h[i]:.2f}",
        *([] if course.beside is None else [f"{course.beside.largest(p.name):.2f}"]),
        str(alarms or ""),
    ]
    return {
        "name": p.name,
        "nominal": plain(p.nominal, 5),
        "unit": p.unit,
        "numbers": numbers,
        "alarmed": p.status is Status.ALARM,
        "status": str(p.status),
    }


def _detectors(axis: ReplayedAxis) -> str:
    """The detector that alarms, and the leading cause of the detector in shadow mode."""
    text = ""
    for detector in axis.status.detectors:
        name = "multi-model detector" if detector.name == "multimodel" else "CUSUM tests"
        if detector.alarms:
            text += f" Alarms come from the {name}."
        elif detector.leading:
            text += f" The {name} ran in shadow mode; its strongest evidence at the end is that of {detector.leading}."
    return text


def _span(axis: ReplayedAxis) -> str:
    line = _course(axis).timeline
    words = f"Drive {axis.drive}. {duration(1e-6 * line.end_us)} of samples"
    start, end = (dated(t) for t in (line.start_us, axis.status.time_us))
    words += f", from {start} to {end} UTC" if start and end else ""
    return f"{words}, with {line.pauses} pause{_s(line.pauses)} cut out." if line.pauses else f"{words}."


def _counters(title: str, counts: Mapping[str, int], samples: int) -> dict[str, Any]:
    """Counts by reason, as shares of the samples if there are any; then the reasons that never occurred."""
    return {
        "title": title,
        "rows": list(_counter_rows(counts, samples)),
        "none": ", ".join(reason for reason, count in counts.items() if not count),
    }


def _counter_rows(counts: Mapping[str, int], samples: int) -> Iterator[dict[str, Any]]:
    for reason, count in counts.items():
        if count:
            share = f"{100 * count / samples:.3g} %" if samples else ""
            yield {"count": count, "share": share, "reason": reason, "meaning": REASONS.get(reason, "")}
