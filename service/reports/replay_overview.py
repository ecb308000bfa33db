"""What was tested when: a bar for each parameter of each axis, grey where it was not tested, with its alarms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from monitor_core.wording import duration
from service.reports.plot_style import (
    ALARM,
    ALARM_OPEN,
    BAND,
    ONSET,
    PANEL,
    QUIET,
    TEXT,
    as_svg,
    figure,
    legend_of,
)
from service.reports.replay_course import Course, TimeUnit, runs_of, time_unit
from service.reports.replay_result import ReplayedAxis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROW, _FRAME = 0.26, 1.25
"""Heights of a row and of what is around all of them, inches."""
_HALF = 0.3
"""Of the height of a bar, in rows."""
_LINES = ("tested", "not tested", ALARM_OPEN, ONSET)
_TESTED, _NOT_TESTED, _, _ = _LINES


def overview_picture(axes: Sequence[ReplayedAxis]) -> str:
    """The bars of all axes that have samples, as an SVG element; empty: none has."""
    rows = list(_rows(axes))
    if not rows:
        return ""
    longest_s = max(1e-6 * course.timeline.end_us for _, course, _ in rows)
    unit = time_unit(longest_s)
    with figure(_ROW * len(rows) + _FRAME) as drawn:
        panel = drawn.subplots(1, 1)
        for row, (axis, course, name) in enumerate(rows):
            _draw_tested(panel, row, course, name, unit)
            _draw_alarms(panel, row, axis, name, unit)
        panel.set_yticks(range(len(rows)), [f"{axis.snapshot.name} {name}" for axis, _, name in rows])
        tested = {(a.id, p.name): p.tested_s for a in axes for p in a.status.parameters}
        shares = panel.secondary_yaxis("right")
        words = [
            duration(tested[axis.id, name]) if tested[axis.id, name] else "never" for axis, _, name in rows
        ]
        shares.set_yticks(range(len(rows)), words)
        shares.set_ylabel("tested for")
        for scale in (panel, shares):
            scale.tick_params(axis="y", length=0)
        panel.grid(axis="y", visible=False)
        end = max(longest_s, 1e-6) / unit.seconds
        panel.set(ylim=(len(rows) - 0.4, -0.6), xlim=(0.0, end))
        panel.set_xlabel(f"time since the first sample [{unit.name}]")
        legend_of(drawn, [panel], _LINES)
        return as_svg(drawn, "when each parameter was tested, and the alarms", "overview")


def _rows(axes: Sequence[ReplayedAxis]) -> Iterator[tuple[ReplayedAxis, Course, str]]:
    for axis in axes:
        if axis.course is not None and axis.course.used:
            yield from ((axis, axis.course, p.name) for p in axis.status.parameters)


def _draw_tested(panel: Axes, row: int, course: Course, name: str, unit: TimeUnit) -> None:
    """Hatched grey over the length of the record, and over it where the parameter was tested."""
    edges, place = course.edges / unit.seconds, (row - _HALF, 2 * _HALF)
    all_of_it = [(0.0, float(edges[-1]))]
    panel.broken_barh(
        all_of_it, place, facecolor=PANEL, edgecolor=QUIET, hatch="////", lw=0.5, label=_NOT_TESTED
    )
    panel.broken_barh(list(runs_of(course.tested(name), edges)), place, color=BAND, lw=0, label=_TESTED)


def _draw_alarms(panel: Axes, row: int, axis: ReplayedAxis, name: str, unit: TimeUnit) -> None:
    for alarm in axis.alarm_spans([name], unit):
        bar, place = [(alarm.start, alarm.end - alarm.start)], (row - _HALF, 2 * _HALF)
        panel.broken_barh(bar, place, color=ALARM, lw=0, label=ALARM_OPEN)
        panel.text(alarm.start, row, f" {alarm.arrow}", color=PANEL, va="center", fontsize=8)
        if alarm.onset is not None:
            panel.plot(alarm.onset, [row - 0.42] * 2, "|-", color=TEXT, ms=6, label=ONSET)
