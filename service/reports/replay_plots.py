"""The paper's Figures 5 and 6 of a record: estimates with their bands, g with h, and what became of the samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.monitoring import DOUBTED, GATED, IDLE, SEED, SETTLE, TRACK, ParameterStatus
from service.reports import replay_course as rows
from service.reports.plot_style import (
    ALARM,
    BEFORE,
    FOUND,
    GRID,
    INK,
    OTHER,
    QUIET,
    SIMULATED,
    add_percent,
    as_svg,
    figure,
    legend_of,
    with_unit,
)
from service.reports.replay_course import SIGMAS, BankCourse, Course, Group, zigzag
from service.reports.replay_result import ReplayedAxis, TimeUnit, duration, time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_TOGETHER, MOST_WITH_BANK = 4, 3
"""Parameters in one picture: more would not fit a page of paper."""
_MOST_PAUSES, _MOST_NAMED = 60, 8
_ESTIMATE, _G, _FATE, _LEGEND = 1.75, 1.05, 0.2, 0.9
"""Heights, inches."""
_NARROWEST = 0.003
"""Of the whole length: what is shorter is drawn as wide as this, so that it can be seen."""
INCREASE, DECREASE, H = "g of an increase", "g of a decrease", "h"
_LINES = (
    *("estimate", f"± {SIGMAS:g} standard deviations", "nominal", "nominal ± ν"),
    *(INCREASE, DECREASE, H, "onset"),
    *("alarm raised", "alarm open", "nothing learned", "pause, cut out"),
)
"""In the order of the legend."""
_ESTIMATED, _BAND, _, _TOLERATED, _, _, _, _ONSET, _RAISED, _OPEN, _NOTHING, _PAUSE = _LINES
_FATES = (
    (SETTLE, "settling"),
    (SEED, "finding P(0)"),
    (GATED, "gated"),
    (IDLE, "nothing to learn"),
    (DOUBTED, "outliers"),
)
Marks = NDArray[np.bool_]


def axis_pictures(axis: ReplayedAxis, course: Course, salt: str) -> Iterator[str]:
    """Of each parameter theta with its band and g with h, below them what became of the samples; SVG elements."""
    parameters = range(len(axis.status.parameters))
    most = MOST_TOGETHER if course.beside is None else MOST_WITH_BANK
    for first in parameters[::most]:
        yield _picture(axis, course, parameters[first : first + most], f"{salt}-{first}")


def _picture(axis: ReplayedAxis, course: Course, chosen: Sequence[int], salt: str) -> str:
    unit = time_unit(1e-6 * course.timeline.end_us)
    fates = list(_fates(axis, course, chosen))
    of_each = [_ESTIMATE, _G] if course.beside is None else [_ESTIMATE, _G, _G]
    others = list[Group]()
    if course.beside is not None and chosen[-1] == len(axis.status.parameters) - 1:
        others = _others(course.beside, [p.name for p in axis.status.parameters])
    heights = of_each * len(chosen) + [_G] * bool(others) + [_FATE * (len(fates) + 1)] * bool(fates)
    with figure(sum(heights) + _LEGEND) as drawn:
        grid = drawn.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)
        panels: list[Axes] = list(grid[:, 0])
        for k, i in enumerate(chosen):
            own = panels[len(of_each) * k : len(of_each) * (k + 1)]
            _draw_parameter(own, axis, course, i, unit)
        if others and course.beside is not None:
            axes = panels[len(of_each) * len(chosen)]
            _draw_others(axes, course, course.beside, others, unit)
            _mark_alarms((axes,), axis, course, "", unit)
            _shade(axes, course, unit)
        if fates:
            _draw_fates(panels[-1], course, fates, unit)
        for axes in panels:
            _mark_pauses(axes, course, unit, named=axes is panels[0])
        panels[-1].set(xlabel=f"time since the first sample [{unit.name}]", xlim=_ends(course, unit))
        legend_of(drawn, panels, _LINES, rows=3)
        names = ", ".join(axis.status.parameters[i].name for i in chosen)
        return as_svg(drawn, f"{axis.id}: course of the estimates of {names}, and of g", salt)


def _draw_parameter(
    panels: Sequence[Axes], axis: ReplayedAxis, course: Course, i: int, unit: TimeUnit
) -> None:
    """The estimate, g of its tests, and that of the multi-model detector where there is one."""
    p = axis.status.parameters[i]
    _draw_estimate(panels[0], course, i, p, unit)
    _draw_g(panels[1], course, i, unit)
    if course.beside is not None:
        panels[1].set(ylabel="CUSUM\ng / h")
        _draw_evidence(panels[2], course, course.beside, p.name, unit)
    _mark_alarms(panels, axis, course, p.name, unit)
    for axes in panels:
        _shade(axes, course, unit)


def _ends(course: Course, unit: TimeUnit) -> tuple[float, float]:
    return 0.0, max(float(course.edges[-1]), 1e-6) / unit.seconds


# --- estimates and g ---------------------------------------------------------------------------------


def _draw_estimate(axes: Axes, course: Course, i: int, p: ParameterStatus, unit: TimeUnit) -> None:
    t = course.middles / unit.seconds
    band = course.low(rows.BELOW, i), course.high(rows.ABOVE, i)
    axes.fill_between(t, *band, color=FOUND, alpha=0.2, lw=0, label=_BAND)
    below, above = course.low(rows.TOLERATED_BELOW, i), course.high(rows.TOLERATED_ABOVE, i)
    axes.plot(t, below, color=BEFORE, lw=0.9, ls=(0, (1, 2)))
    axes.plot(t, above, color=BEFORE, lw=0.9, ls=(0, (1, 2)), label=_TOLERATED)
    axes.plot(
        *_ups_and_downs(course, rows.NOMINAL, i, unit), color=INK, lw=1, ls=(0, (5, 3)), label="nominal"
    )
    between = course.low(rows.ESTIMATE, i), course.high(rows.ESTIMATE, i)
    axes.fill_between(t, *between, color=FOUND, alpha=0.45, lw=0)
    axes.plot(t, course.mean(i), color=FOUND, lw=1.3, label=_ESTIMATED)
    axes.set(ylabel=with_unit(p.name, p.unit), ylim=_limits(course, i))
    axes.set_title(f"{p.name}: {p.meaning}")
    if p.nominal:
        add_percent(axes, p.nominal)


def _draw_g(axes: Axes, course: Course, i: int, unit: TimeUnit) -> None:
    h = float(course.h[i])
    (t, up), (_, down) = (_ups_and_downs(course, row, i, unit) for row in (rows.UP, rows.DOWN))
    top = _draw_directions(axes, (t, up / h), (t, down / h))
    axes.set(ylabel="g / h", ylim=(0, 1.15 * max(top, 1.0)))


def _ups_and_downs(course: Course, which: int, i: int, unit: TimeUnit) -> tuple[Floats, Floats]:
    return zigzag(course.middles / unit.seconds, course.low(which, i), course.high(which, i))


def _limits(course: Course, i: int) -> tuple[float, float]:
    """Of the panel: all of theta and theta_0, and of the bands what is usual (while P(0) is sought they are wide)."""
    learned = course.fate(TRACK) > 0
    usual: list[float] = []
    if learned.any():
        for row, values, share in (
            (rows.BELOW, course.low, 3),
            (rows.TOLERATED_BELOW, course.low, 10),
            (rows.ABOVE, course.high, 97),
            (rows.TOLERATED_ABOVE, course.high, 90),
        ):
            usual.append(float(np.nanpercentile(values(row, i)[learned], share)))
    for row in (rows.ESTIMATE, rows.NOMINAL):
        usual += [float(np.nanmin(course.low(row, i))), float(np.nanmax(course.high(row, i)))]
    low, high = min(usual), max(usual)
    room = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


# --- alarms, pauses, what was not learned from -------------------------------------------------------


def _mark_alarms(
    panels: Sequence[Axes], axis: ReplayedAxis, course: Course, name: str, unit: TimeUnit
) -> None:
    """Those of the parameter, and those of no parameter, such as a fault of a sensor."""
    line, names = course.timeline, {p.name for p in axis.status.parameters}
    for alarm in (entry for entry in axis.alarms if entry.parameter == name or entry.parameter not in names):
        onset, raised, ended = (line.find(t) for t in (alarm.onset_us, alarm.raised_us, alarm.ended_us))
        for axes in panels:
            if onset is not None:
                axes.axvline(onset / unit.seconds, color=ALARM, lw=1.1, ls=(0, (1, 1.5)), label=_ONSET)
            if raised is not None:
                axes.axvline(raised / unit.seconds, color=ALARM, lw=1.3, label=_RAISED)
                end = 1e-6 * line.end_us if ended is None else ended
                span = raised / unit.seconds, max(end, raised) / unit.seconds
                axes.axvspan(*span, color=ALARM, alpha=0.07, lw=0, label=_OPEN)


def _mark_pauses(axes: Axes, course: Course, unit: TimeUnit, named: bool) -> None:
    stretches = course.timeline.stretches[1:]
    for stretch in stretches if len(stretches) <= _MOST_PAUSES else ():
        at = 1e-6 * stretch.at / unit.seconds
        axes.axvline(at, color=QUIET, lw=1, ls=(0, (4, 2, 1, 2)), label=_PAUSE)
        if named and len(stretches) <= _MOST_NAMED:
            words = f"pause of {duration(stretch.pause_s)}" if stretch.pause_s > 0 else "clock set back"
            above = axes.get_xaxis_transform()
            axes.annotate(words, (at, 1.02), xycoords=above, fontsize=8, color=QUIET, ha="center")


def _shade(axes: Axes, course: Course, unit: TimeUnit) -> None:
    """Where nothing was learned: bins with samples, none of which was used."""
    runs = list(_runs(course.fate(TRACK) == 0, course, unit))
    if runs:
        transform = axes.get_xaxis_transform()
        axes.broken_barh(
            runs, (0, 1), color=GRID, alpha=0.55, lw=0, transform=transform, zorder=0, label=_NOTHING
        )


def _fates(axis: ReplayedAxis, course: Course, chosen: Sequence[int]) -> Iterator[tuple[str, Marks]]:
    """What kept from learning, of which there was any, and the bins with it."""
    names = [p.name for p in axis.status.parameters]
    for name, where in (
        ("no samples", course.gaps),
        *((name, course.fate(fate) > 0) for fate, name in _FATES),
        *((f"{names[i]} not observed", course.unseen(i) > 0) for i in chosen),
    ):
        if where.any():
            yield name, where


def _draw_fates(axes: Axes, course: Course, fates: Sequence[tuple[str, Marks]], unit: TimeUnit) -> None:
    for k, (_, where) in enumerate(fates):
        axes.broken_barh(list(_runs(where, course, unit)), (k - 0.32, 0.64), color=QUIET, lw=0)
    axes.set_yticks(range(len(fates)), [name for name, _ in fates], fontsize=8.5)
    axes.set(ylim=(len(fates) - 0.4, -0.6), title="What kept from learning")
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)


def _runs(where: Marks, course: Course, unit: TimeUnit) -> Iterator[tuple[float, float]]:
    """Start and width of each run of marked bins."""
    steps = np.diff(np.concatenate(([0], where.astype(np.int8), [0])))
    edges = course.edges / unit.seconds
    for start, end in zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True):
        yield float(edges[start]), max(float(edges[end] - edges[start]), _NARROWEST * float(edges[-1]))


# --- g / h of the multi-model detector: beside the CUSUM tests of a parameter, and of the other causes ----------------


Line = tuple[Floats, Floats]
_COLOURS = ((INK, "-"), (OTHER, "-"), (BEFORE, "-"), (SIMULATED, (0, (3, 1))), (FOUND, (0, (3, 1))))
"""Of the causes that are named in the panel: the likeliest ones."""
_WORTH_A_NAME = 0.3
"""g / h that a cause must have reached to be named."""
_LINEAR = 1.6
"""Up to here g / h is drawn as it is; beyond, its part above h by its logarithm, as after a change it grows fast."""


def _draw_directions(axes: Axes, increase: Line | None, decrease: Line | None) -> float:
    """g / h for an increase and for a decrease, and h; returns the largest."""
    top = 0.0
    for line, colour, dashes, label in (
        (increase, FOUND, "-", INCREASE),
        (decrease, SIMULATED, (0, (3, 1)), DECREASE),
    ):
        if line is not None:
            axes.plot(*line, color=colour, lw=1.2, ls=dashes, label=label)
            top = max(top, float(np.nanmax(line[1], initial=0.0)))
    axes.axhline(1, color=ALARM, lw=1, ls=(0, (5, 2)), label=H)
    return top


def _draw_evidence(axes: Axes, course: Course, bank: BankCourse, name: str, unit: TimeUnit) -> None:
    groups = (Group(name, way) for way in (1, -1))
    lines = (_evidence(course, bank, group, unit) if group in bank.groups else None for group in groups)
    _finish(axes, _draw_directions(axes, *lines))


def _others(bank: BankCourse, parameters: Sequence[str]) -> list[Group]:
    """Causes that are no parameter, that with the largest g first."""
    found = [group for group in bank.groups if group.cause not in parameters]
    return sorted(found, key=lambda group: -bank.largest(group.cause))


def _draw_others(
    axes: Axes, course: Course, bank: BankCourse, groups: Sequence[Group], unit: TimeUnit
) -> None:
    """The evidence for each of these causes; the largest ones are named."""
    named = [group for group in groups[: len(_COLOURS)] if bank.largest(group.cause) >= _WORTH_A_NAME]
    lines = []
    for k, group in reversed(list(enumerate(groups))):  # the largest is drawn last, over the others
        colour, dashes, width = (*_COLOURS[k], 1.2) if k < len(named) else (QUIET, "-", 0.6)
        lines += axes.plot(*_evidence(course, bank, group, unit), color=colour, ls=dashes, lw=width)
    names = [group.cause for group in named]
    axes.legend(
        lines[::-1][: len(names)],
        names,
        loc="lower right",
        bbox_to_anchor=(1, 0.97),
        ncols=len(_COLOURS),
        fontsize=8.5,
        handlelength=1.6,
        borderpad=0.1,
    )
    axes.set_title("other causes")
    axes.axhline(1, color=ALARM, lw=1, ls=(0, (5, 2)), label=H)
    _finish(axes, max(bank.largest(group.cause) for group in groups))


def _evidence(course: Course, bank: BankCourse, group: Group, unit: TimeUnit) -> Line:
    return zigzag(course.middles / unit.seconds, bank.low(group, course.used), bank.high(group, course.used))


def _finish(axes: Axes, top: float) -> None:
    axes.set(ylabel="multi-model\ng / h")
    if top <= _LINEAR:
        axes.set(ylim=(0, 1.15 * max(top, 1.0)))
        return
    axes.set_yscale("symlog", linthresh=1, linscale=0.8)
    ticks = [0.0, 1.0, *(10.0**k for k in range(1, int(np.log10(top)) + 1))]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    axes.set_ylim(0, 1.5 * top)
