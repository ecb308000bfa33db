"""The tables in the report of a replay, as HTML."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from monitor_core.detection import Alarm
from monitor_core.monitoring import ParameterStatus, Status
from service.reports.page import NUMBER, heads, legend, number_cell, sentences, table
from service.reports.replay_result import REASONS, Replayed, ReplayedAxis, dated, time_unit
from service.reports.text_format import escaped, percent, plain
from service.texts.alarm_texts import episode_words

_ARROWS = {"up": "↑ up", "down": "↓ down"}


def alarm_table(found: Replayed) -> str:
    """All alarms, axis by axis; empty where there is none."""
    rows = "".join(_alarm(axis, e) for axis in found.axes for e in axis.alarms)
    if not rows:
        return ""
    titles = ("axis", "parameter", "direction", "onset", "raised", "ended", "size ± sd", "unit", "of nominal")
    said = (
        "Onset: the likeliest time of the change, or, where that is not known, the last time at which g was zero."
        " Size: estimate minus nominal value when the alarm was updated last, with its standard deviation. Times count"
        " from the first sample of the axis, as in the pictures; below them UTC, where the record has dates."
    )
    words = sentences(f"{axis.id}: {_in_words(axis, e)}" for axis in found.axes for e in axis.alarms)
    return table(heads(titles, ("size ± sd", "of nominal")), rows) + words + legend(said)


def _in_words(axis: ReplayedAxis, e: Alarm) -> str:
    p = axis.quantities[e.parameter]
    return episode_words(e, p.nominal, p.unit)


def _alarm(axis: ReplayedAxis, e: Alarm) -> str:
    p, sized = axis.quantities[e.parameter], math.isfinite(e.size)
    share = percent(e.size / p.nominal, signed=True) if p.nominal and sized else "-"
    times = "".join(_time(axis, t) for t in (e.onset_us, e.raised_us, e.ended_us))
    size = number_cell(f"{plain(e.size, 3)} ± {plain(e.size_sd, 2)}" if sized else "-")
    return (
        f"<tr><th>{escaped(axis.id)}</th><th>{escaped(e.parameter)}</th><td>{_ARROWS[e.direction]}</td>{times}"
        f'{size}<td class="unit">{escaped(p.unit)}</td>{number_cell(share)}</tr>'
    )


def _time(axis: ReplayedAxis, t_us: int | None) -> str:
    if t_us is None:
        return "<td>still open</td>"
    line = axis.course.timeline
    here = time_unit(1e-6 * line.end_us).written(line.find(t_us))
    date = dated(t_us)
    below = f"<br><span class='quiet'>{date}</span>" if date else ""
    return f'<td class="when"><b>{here}</b>{below}</td>'


def parameter_table(axis: ReplayedAxis) -> str:
    """The monitored parameters at the end of the record."""
    of_bank = ("of the multi-model detector",) if axis.course.beside is not None else ()
    numbers = ("estimate", "sd", "change", "largest g / h", *of_bank, "alarms")
    rows = "".join(_parameter(axis, i, p) for i, p in enumerate(axis.status.parameters))
    return table(heads(("", "nominal", "unit", *numbers, "at the end"), ("nominal", *numbers)), rows)


def _parameter(axis: ReplayedAxis, i: int, p: ParameterStatus) -> str:
    known = math.isfinite(p.estimate)
    change = percent(p.estimate / p.nominal - 1, signed=True) if known and p.nominal else ""
    count = sum(e.parameter == p.name for e in axis.alarms)
    alarmed = " class='alarmed'" if p.status is Status.ALARM else ""
    bank = axis.course.beside
    of_bank = "" if bank is None else number_cell(f"{bank.largest(p.name):.2f}")
    return (
        f"<tr><th>{escaped(p.name)}</th>{number_cell(plain(p.nominal, 5))}<td class='unit'>{escaped(p.unit)}</td>"
        f"{number_cell(plain(p.estimate, 5) if known else 'invalid')}{number_cell(plain(p.standard_deviation, 2))}"
        f"{number_cell(change)}{number_cell(f'{axis.course.largest_g(i) / axis.course.h[i]:.2f}')}"
        f"{of_bank}{number_cell(str(count or ''))}<td{alarmed}>{escaped(str(p.status))}</td></tr>"
    )


def counter_table(axis: ReplayedAxis) -> str:
    """What became of the samples, and what never became one."""
    return _counters(
        (f"of {axis.status.samples} samples", axis.status.counters, axis.status.samples),
        ("no samples", axis.dropped, 0),
        ("clocks", axis.clock, 0),
    )


def frame_table(frames: Mapping[str, Mapping[str, int]]) -> str:
    """Frames that gave nothing, by bus and reason."""
    return _counters(*((bus, counts, 0) for bus, counts in frames.items()))


def _counters(*groups: tuple[str, Mapping[str, int], int]) -> str:
    """Title, counts by reason, and of how many, if that makes sense."""
    rows = "".join(row for group in groups for row in _group(*group))
    return table(heads(("", "number", "share", "reason", "that is"), ("number", "share")), rows)


def _group(title: str, counts: Mapping[str, int], whole: int) -> Iterator[str]:
    there = {reason: count for reason, count in counts.items() if count}
    none = ", ".join(reason for reason, count in counts.items() if not count)
    for k, (reason, count) in enumerate(there.items()):
        share = f"{100 * count / whole:.3g} %" if whole else ""
        yield (
            f"<tr><th>{escaped(title) if not k else ''}</th><td{NUMBER}>{count}</td>{number_cell(share)}"
            f"<td>{escaped(reason)}</td><td class='meaning'>{escaped(REASONS.get(reason, ''))}</td></tr>"
        )
    if none:
        first = "" if there else escaped(title)
        yield f"<tr class='held'><th>{first}</th><td{NUMBER}>0</td><td></td><td colspan='2'>{escaped(none)}</td></tr>"
