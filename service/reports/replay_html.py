"""The report of a replay as one HTML page, with a picture of the times at which parameters were tested."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from monitor_core.wording import duration
from service.reports import plot_style as style
from service.reports import replay_report as content
from service.reports.formats import render, safe
from service.reports.replay_course import SIGMAS, ReplayCourse, runs_of
from service.reports.replay_plots import axis_pictures
from service.reports.replay_report import dated
from service.reports.replay_result import Replayed, ReplayedAxis
from service.reports.timeline import TimeUnit, time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REASONS: Mapping[str, str] = {
    "used": "learned from",
    "seeding": "taken to find how uncertain the first estimates are",
    "settling": "while the predictor settled, after its start or after lost samples",
    "gated": "while operating conditions forbade it, or were not known",
    "outlier": "far from their prediction, passed over",
    "starved": "while there was nothing to learn: the axis hardly moved",
    "started": "the predictor started with them",
    "gap": "after a gap, or a clock that was set: the predictor restarted",
    "not_finite": "not finite",
    "not_increasing": "not after the sample before",
    "diverged": "at which the prediction left the finite numbers",
    "projected": "at which a bound held an estimate (these are among the others, too)",
    "absurd": "beyond physical limits",
    "repeated": "the same again within half an interval",
    "out_of_order": "not after the last sample",
    "untimed": "the counter or the fitted clock contradicts the time of receipt",
    "unpaired": "torque or motion without its partner",
    "late": "arrived after its partner had been dropped",
    "missing": "missing samples",
    "ambiguous": "more than half a turn since the sample before: which way is not known",
    "unwanted": "no axis asks for them",
    "too_short": "shorter than their message",
    "undecodable": "contradict the description of the bus",
    "signal_absent": "of a multiplexed message, without the signal that was wanted",
    "unreadable": "damaged in the file",
    "not_a_frame": "events of a log, or lines that no reader knows",
    "other_bus": "of a channel that is no bus of the configuration",
    "clock_reanchored": "the time line of the samples restarted",
    "clock_set_back": "the clock of the receiver was set back",
}
"""Counters of samples, values, frames and clocks in words."""


def as_html(replayed: Replayed) -> str:
    """The complete HTML page."""
    first, more = replayed.records[0], len(replayed.records) - 1
    return render(
        "replay.html",
        title=f"Replay of {f'{first} and {more} more' if more else first}",
        replayed=replayed,
        outcome=_outcome(replayed),
        coverage=_coverage(replayed),
        tested_picture=safe(overview_picture(replayed.axes)),
        not_tested=[words for axis in replayed.axes for words in content.not_tested(axis)],
        notes=[note for axis in replayed.axes for note in axis.notes],
        estimates=content.estimates(replayed.axes),
        largest_g=content.largest_g(replayed.axes),
        alarms=content.alarm_table(replayed.axes),
        alarm_sentences=[words for axis in replayed.axes for words in content.alarm_sentences(axis)],
        axes=[_axis(axis, f"axis{k}") for k, axis in enumerate(replayed.axes)],
        reasons=REASONS,
        sigmas=f"{SIGMAS:g}",
    )


def _outcome(replayed: Replayed) -> tuple[str, str, str]:
    """Kind, first words and rest of the most important message."""
    count = sum(len(axis.alarms) for axis in replayed.axes)
    silent = [axis.id for axis in replayed.axes if not axis.status.samples]
    untested = [axis.id for axis in replayed.axes if axis.untested]
    rest = f" No samples of {', '.join(silent)}." if silent else ""
    rest += f" Not tested: parameters of {', '.join(untested)}." if untested else ""
    if count:
        alarmed = [axis.id for axis in replayed.axes if axis.alarms]
        return "bad", f"{count} alarm{_s(count)}", f"of {', '.join(alarmed)}.{rest}"
    if untested:
        about = content.of_what(replayed.axes)
        return "bad", "Not tested", f"are parameters of {', '.join(untested)}. No alarm{about}."
    return ("warn", "No alarm.", rest.strip()) if rest else ("", "No alarm.", "")


def _coverage(replayed: Replayed) -> str:
    """Amount of the samples, and how many of them were used."""
    samples = sum(axis.status.samples for axis in replayed.axes)
    used = sum(axis.status.counters["used"] for axis in replayed.axes)
    longest = max((1e-6 * _course(axis).timeline.end_us for axis in replayed.axes), default=0.0)
    dropped = sum(_without_missing(axis.snapshot.dropped) for axis in replayed.axes)
    dropped += sum(map(_without_missing, replayed.frames_dropped.values()))
    words = f"{duration(longest)} of samples, pauses left out; {100 * used / samples:.1f} % of {samples} were of use"
    return f"{words}, and {dropped} frames, values or rows gave no sample." if dropped else f"{words}."


def _without_missing(dropped: Mapping[str, int]) -> int:
    """Values that gave no sample; in a pause there may be millions that were never received."""
    return sum(count for reason, count in dropped.items() if reason != "missing")


def _s(count: int) -> str:
    return "" if count == 1 else "s"


def _course(axis: ReplayedAxis) -> ReplayCourse:
    assert axis.course is not None, "a page is drawn of a replay that collects courses"
    return axis.course


def _axis(axis: ReplayedAxis, salt: str) -> dict[str, Any]:
    course = _course(axis)
    return {
        "id": axis.id,
        "status": axis.status,
        "dropped": axis.snapshot.dropped,
        "clock": axis.snapshot.clock,
        "span": f"{_span(axis)}{_detectors(axis)}",
        "pictures": list(map(safe, axis_pictures(axis, course, salt))) if course.used else [],
        "multimodel": bool(course.causes),
        "trends": list(content.trend_sentences(axis)),
    }


def _span(axis: ReplayedAxis) -> str:
    line = _course(axis).timeline
    words = f"Drive {axis.snapshot.drive}. {duration(1e-6 * line.end_us)} of samples"
    start, end = (dated(t) for t in (line.start_us, axis.status.time_us))
    words += f", from {start} to {end} UTC" if start and end else ""
    return f"{words}, with {line.pauses} pause{_s(line.pauses)} cut out." if line.pauses else f"{words}."


def _detectors(axis: ReplayedAxis) -> str:
    """The detector that alarms, and the leading cause according to the detector in shadow mode."""
    text = ""
    for detector in axis.status.detectors:
        name = "multi-model detector" if detector.name == "multimodel" else "CUSUM tests"
        if detector.alarms:
            text += f" Alarms come from the {name}."
        elif detector.leading:
            text += f" The {name} ran in shadow mode; its strongest evidence at the end is that of {detector.leading}."
    return text


# --- A bar for each parameter of each axis, grey where it was not tested, with its alarms -----------------------------


_ROW, _FRAME = 0.26, 1.25
"""Heights of a row and of the margin around all rows [inches]."""
_HALF = 0.3
"""Half the height of a bar, in rows."""
_LINES = ("tested", "not tested", style.ALARM_OPEN, style.ONSET)
_TESTED, _NOT_TESTED, _, _ = _LINES


def overview_picture(axes: Sequence[ReplayedAxis]) -> str:
    """The bars of all axes that have samples, as an SVG element; empty: no axis has any."""
    rows = list(_rows(axes))
    if not rows:
        return ""
    longest_s = max(1e-6 * course.timeline.end_us for _, course, _ in rows)
    unit = time_unit(longest_s)
    with style.figure(_ROW * len(rows) + _FRAME) as drawn:
        panel = drawn.subplots(1, 1)
        for row, (axis, course, name) in enumerate(rows):
            _draw_tested(panel, row, course, name, unit)
            _draw_alarms(panel, row, axis, name, unit)
        panel.set_yticks(range(len(rows)), [f"{axis.snapshot.name} {name}" for axis, _, name in rows])
        tested = {(a.id, p.name): p.tested_s for a in axes for p in a.status.parameters}
        shares = panel.secondary_yaxis("right")
        words = [duration(tested[axis.id, name]) if tested[axis.id, name] else "never" for axis, _, name in rows]
        shares.set_yticks(range(len(rows)), words)
        shares.set_ylabel("tested for")
        for scale in (panel, shares):
            scale.tick_params(axis="y", length=0)
        panel.grid(axis="y", visible=False)
        end = max(longest_s, 1e-6) / unit.seconds
        panel.set(ylim=(len(rows) - 0.4, -0.6), xlim=(0.0, end))
        panel.set_xlabel(f"time since the first sample [{unit.name}]")
        style.legend_of(drawn, [panel], _LINES)
        return style.as_svg(drawn, "when each parameter was tested, and the alarms", "overview")


def _rows(axes: Sequence[ReplayedAxis]) -> Iterator[tuple[ReplayedAxis, ReplayCourse, str]]:
    for axis in axes:
        if axis.course is not None and axis.course.used:
            yield from ((axis, axis.course, p.name) for p in axis.status.parameters)


def _draw_tested(panel: Axes, row: int, course: ReplayCourse, name: str, unit: TimeUnit) -> None:
    """Hatched grey over the length of the record, covered by bars where the parameter was tested."""
    edges, place = course.edges / unit.seconds, (row - _HALF, 2 * _HALF)
    hatched: style.LineStyle = {"facecolor": style.PANEL, "edgecolor": style.QUIET, "hatch": "////", "lw": 0.5}
    panel.broken_barh([(0.0, float(edges[-1]))], place, **hatched, label=_NOT_TESTED)
    panel.broken_barh(list(runs_of(course.tested(name), edges)), place, color=style.BAND, lw=0, label=_TESTED)


def _draw_alarms(panel: Axes, row: int, axis: ReplayedAxis, name: str, unit: TimeUnit) -> None:
    for alarm in axis.alarm_spans([name], unit):
        bar, place = [(alarm.start, alarm.end - alarm.start)], (row - _HALF, 2 * _HALF)
        panel.broken_barh(bar, place, color=style.ALARM, lw=0, label=style.ALARM_OPEN)
        panel.text(alarm.start, row, f" {alarm.arrow}", color=style.PANEL, va="center", fontsize=8)
        if alarm.onset is not None:
            panel.plot(alarm.onset, [row - 0.42] * 2, "|-", color=style.TEXT, ms=6, label=style.ONSET)
