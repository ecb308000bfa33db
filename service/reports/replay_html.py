"""The report of a replay as one HTML page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from monitor_core.wording import duration
from service.reports import replay_report as content
from service.reports.formats import render, safe
from service.reports.replay_course import SIGMAS, Course
from service.reports.replay_overview import overview_picture
from service.reports.replay_plots import axis_pictures
from service.reports.replay_report import dated
from service.reports.replay_result import Replayed, ReplayedAxis

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
    "missing": "samples that never came",
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
"""Of counters of samples, values, frames and clocks."""


def as_html(replayed: Replayed) -> str:
    """The whole page."""
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
    """Kind, first words and the rest of the first thing to read."""
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
    """How much there was, and how much of it was of use."""
    samples = sum(axis.status.samples for axis in replayed.axes)
    used = sum(axis.status.counters["used"] for axis in replayed.axes)
    longest = max((1e-6 * _course(axis).timeline.end_us for axis in replayed.axes), default=0.0)
    dropped = sum(_without_missing(axis.snapshot.dropped) for axis in replayed.axes)
    dropped += sum(map(_without_missing, replayed.frames_dropped.values()))
    words = f"{duration(longest)} of samples, pauses left out; {100 * used / samples:.1f} % of {samples} were of use"
    return f"{words}, and {dropped} frames, values or rows gave no sample." if dropped else f"{words}."


def _without_missing(dropped: Mapping[str, int]) -> int:
    """What came and gave no sample: in a pause millions may never have come."""
    return sum(count for reason, count in dropped.items() if reason != "missing")


def _s(count: int) -> str:
    return "" if count == 1 else "s"


def _course(axis: ReplayedAxis) -> Course:
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
    """The detector that alarms, and the leading cause of the detector in shadow mode."""
    text = ""
    for detector in axis.status.detectors:
        name = "multi-model detector" if detector.name == "multimodel" else "CUSUM tests"
        if detector.alarms:
            text += f" Alarms come from the {name}."
        elif detector.leading:
            text += f" The {name} ran in shadow mode; its strongest evidence at the end is that of {detector.leading}."
    return text
