"""Alarms and final estimates of a replay in words and tables, on the terminal and for the page; everything as JSON."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console

from monitor_core.monitoring import ParameterStatus, Status
from monitor_core.wording import duration, percent
from service.pipeline.axes.axis_pipeline import Heat
from service.reports.formats import TextTable, for_terminal, json_text, labelled, plain
from service.reports.replay_course import DOWN, EVIDENCE, UP
from service.reports.replay_result import Replayed, ReplayedAxis
from service.reports.timeline import time_unit
from service.store.alarm_table import RecordedAlarm
from service.texts.alarm_words import episode_words
from service.texts.instants import DATED_US, iso
from service.texts.not_tested_words import not_tested_sentences
from service.texts.trend_words import reach_words, trend_words
from service.web import views


def print_text(replayed: Replayed, console: Console) -> None:
    """Report: final estimates, alarms, trends, and remarks."""
    axes = replayed.axes
    for axis in axes:
        for words in not_tested(axis):
            console.print(labelled("Not tested", words, "bold red"), soft_wrap=True)
    for axis in axes:
        samples, gated = axis.status.samples, axis.status.counters["gated"]
        left_out = f", {percent(gated / samples)} of them excluded by operating conditions (gated)" if gated else ""
        console.print(f"{axis.id}: {samples} samples{left_out}")
        if axis.snapshot.heat is not None:
            words = heat_words(axis.snapshot.heat, axis.status.unjudged_s)
            console.print(f"{axis.id}: {words}", soft_wrap=True)
    console.print(for_terminal(estimates(axes), "Estimates at the end"))
    alarms = alarm_table(axes)
    still_open = [n for n, alarm in enumerate(alarm for a in axes for alarm in a.alarms) if alarm.active]
    if alarms.rows:
        console.print(for_terminal(alarms, "Alarms (times in UTC)", styles=dict.fromkeys(still_open, "red")))
    else:
        console.print(f"No alarms{of_what(axes)}.")
    for axis in axes:
        for kind, style, sentences in (
            ("Alarm", "bold red", alarm_sentences(axis)),
            ("Trend", "bold", (f"{axis.id}: {words}" for words in trend_sentences(axis))),
            ("Note", "bold yellow", axis.notes),
        ):
            for words in sentences:
                console.print(labelled(kind, words, style), soft_wrap=True)


# --- Sentences and tables ---------------------------------------------------------------------------------------------


def estimates(axes: Sequence[ReplayedAxis]) -> TextTable:
    """A row for each parameter."""
    rows = [(axis.id, *_parameter(p)) for axis in axes for p in axis.status.parameters]
    return TextTable(("axis", "parameter", "unit", "nominal", "estimate ± sd", "change", "status"), rows)


def not_tested(axis: ReplayedAxis) -> Iterator[str]:
    """Parameters that were not tested, the reasons, and what would be needed."""
    sentences = not_tested_sentences(axis.untested, axis.status, axis.snapshot.gated_by)
    return (f"{axis.id}: {words}" for words in sentences)


def heat_words(heat: Heat, unjudged_s: float = 0.0) -> str:
    """How warm an axis is at the end: "its heat is 12.3 W at the end, -2.1 W of it by a colder hall".

    ``unjudged_s``: time of motion in which it was not known [s].
    """
    unsure = f" ± {plain(heat.sd_w, 2)}" if heat.sd_w > 0 else ""
    hall = f", {heat.ambient_w:+.2g} W of it by a {'warmer' if heat.ambient_w > 0 else 'colder'} hall"
    known = "" if heat.known else ", not known yet"
    words = f"its heat is {plain(heat.heat_w, 3)}{unsure} W at the end{hall if heat.ambient_w else ''}{known}"
    if unjudged_s < _NOTICED_S:
        return words
    return (
        f"{words}. For {duration(unjudged_s)} of motion it was not known, so nothing was tested: a daemon with a"
        " checkpoint knows it, and where the record begins cold, --thermal cold"
    )


_NOTICED_S = 30.0
"""Time without tests that is worth a sentence [s]"""


def of_what(axes: Sequence[ReplayedAxis]) -> str:
    """The meaning of the absence of alarms; empty if everything was tested."""
    missing = sum(len(names) for axis in axes for names in axis.untested.values())
    if not missing:
        return ""
    some = missing < sum(len(axis.status.parameters) for axis in axes)
    return " of what was tested" if some else ": nothing was tested"


def largest_g(axes: Sequence[ReplayedAxis]) -> TextTable:
    """A row for each parameter: the largest g / h of both detectors, where the course is known."""
    rows = [
        (
            axis.id,
            name,
            f"{course.largest(UP, DOWN, name=name) / h:.2f}",
            f"{course.largest(EVIDENCE, name=name):.2f}" if course.causes else "",
        )
        for axis in axes
        if (course := axis.course) is not None
        for name, h in course.h.items()
    ]
    return TextTable(("axis", "parameter", "CUSUM", "multi-model"), rows)


def _parameter(p: ParameterStatus) -> tuple[str, ...]:
    unit, nominal = "" if p.unit == "1" else p.unit, plain(p.nominal, 5)
    status = f"not tested: {p.not_tested}" if p.not_tested and p.status is not Status.ALARM else str(p.status)
    if p.status in _NO_ESTIMATE:
        return p.name, unit, nominal, "none yet", "", status
    if math.isnan(p.estimate):
        return p.name, unit, nominal, "invalid", "", status
    change = percent(p.estimate / p.nominal - 1, signed=True) if p.nominal else ""
    estimate = f"{plain(p.estimate, 5)} ± {plain(p.standard_deviation, 2)}"
    return p.name, unit, nominal, estimate, change, status


_NO_ESTIMATE = (Status.WAITING, Status.SEEDING)
"""The estimate has not changed from the nominal value."""


def alarm_table(axes: Sequence[ReplayedAxis]) -> TextTable:
    """A row for each alarm."""
    rows = [
        (
            axis.id,
            alarm.parameter,
            _size(alarm),
            _onset(axis, alarm),
            _when(axis, alarm.raised_us),
            _when(axis, alarm.ended_us),
        )
        for axis in axes
        for alarm in axis.alarms
    ]
    return TextTable(("axis", "parameter", "size ± sd", "onset", "raised", "ended"), rows)


def _size(alarm: RecordedAlarm) -> str:
    if alarm.size is None or alarm.size_sd is None:
        return "not known" if alarm.active else "-"
    sign, unit = "+" if alarm.size > 0 else "", "" if alarm.unit == "1" else f" {alarm.unit}"
    share = f" ({percent(alarm.size / alarm.nominal, signed=True)})" if alarm.nominal else ""
    return f"{sign}{plain(alarm.size, 3)} ± {plain(alarm.size_sd, 2)}{unit}{share}"


def _onset(axis: ReplayedAxis, alarm: RecordedAlarm) -> str:
    """The onset, and the interval in which it lies if that is known; without its earlier end, the latest onset."""
    if alarm.onset_low_us is None and alarm.onset_high_us is not None:
        return f"before {_when(axis, alarm.onset_high_us)}"
    ends = (("-", alarm.onset_low_us), ("+", alarm.onset_high_us))
    away = [f"{sign}{abs(t_us - alarm.onset_us) / 1e6:.1f}" for sign, t_us in ends if t_us is not None]
    within = f" ({' '.join(away)} s)" if away else ""
    return f"{_when(axis, alarm.onset_us)}{within}"


def _when(axis: ReplayedAxis, t_us: int | None) -> str:
    """A time since the first sample, as in the pictures, and in UTC; each if it is known."""
    if t_us is None:
        return "open"
    date, line = dated(t_us), None if axis.course is None else axis.course.timeline
    place = None if line is None else line.find(t_us)
    if line is None or place is None:
        return date or f"{t_us / 1e6:.2f} s"
    since = time_unit(1e-6 * line.end_us).written(place)
    return f"{since} ({date})" if date else since


def dated(t_us: int | None) -> str:
    """A time in UTC to a tenth of a second; empty if the times of the record have no date."""
    return "" if t_us is None or t_us < DATED_US else iso(t_us)[:21].replace("T", " ")


def alarm_sentences(axis: ReplayedAxis) -> Iterator[str]:
    """The message of each alarm."""
    return (
        f"{axis.id}: {episode_words(alarm, alarm.nominal, alarm.unit, alarm.same_payload)}" for alarm in axis.alarms
    )


def trend_sentences(axis: ReplayedAxis) -> Iterator[str]:
    """The known trends, and when they reach limits, counted from the last entry."""
    for p in axis.snapshot.trends:
        if p.trend is not None:
            reached = [reach_words(r, p.entries[-1].end_us) for r in p.reaches]
            yield "; ".join([trend_words(p.name, p.unit, p.trend), *reached])


# --- JSON -------------------------------------------------------------------------------------------------------------


def as_json(replayed: Replayed) -> str:
    """All results, each as the daemon's API answers it."""
    return json_text({"axes": [_axis(axis) for axis in replayed.axes], "frames_dropped": replayed.frames_dropped})


def _axis(axis: ReplayedAxis) -> dict[str, Any]:
    now_us = axis.status.time_us or 0
    return {
        **views.axis(axis.snapshot, now_us).model_dump(exclude={"last_sample_age_s", "silent"}),
        "trends": [trend.model_dump() for trend in views.trend(axis.snapshot).parameters],
        "alarms": [views.alarm(alarm).model_dump() for alarm in axis.alarms],
        "not_tested_in_records": {name: str(reason) for reason, names in axis.untested.items() for name in names},
    }
