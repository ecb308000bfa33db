"""Plots of g / h of the multi-model detector: beside the CUSUM tests of a parameter, and of the other causes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from monitor_core.arrays import Floats
from service.reports.plot_style import ALARM, BEFORE, FOUND, INK, OTHER, QUIET, SIMULATED
from service.reports.replay_course import BankCourse, Course, Group
from service.reports.replay_result import TimeUnit
from service.reports.timeline import zigzag

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Line = tuple[Floats, Floats]
INCREASE, DECREASE, H = "g of an increase", "g of a decrease", "h"
_COLOURS = ((INK, "-"), (OTHER, "-"), (BEFORE, "-"), (SIMULATED, (0, (3, 1))), (FOUND, (0, (3, 1))))
"""Of the causes that are named in the panel: the likeliest ones."""
_WORTH_A_NAME = 0.3
"""g / h that a cause must have reached to be named."""
_LINEAR = 1.6
"""Up to here g / h is drawn as it is; beyond, its part above h by its logarithm, as after a change it grows fast."""


def draw_directions(axes: Axes, increase: Line | None, decrease: Line | None) -> float:
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


def draw_parameter(axes: Axes, course: Course, bank: BankCourse, name: str, unit: TimeUnit) -> None:
    """The evidence for an increase and for a decrease of a parameter."""
    groups = (Group(name, way) for way in (1, -1))
    lines = (_line(course, bank, group, unit) if group in bank.groups else None for group in groups)
    _finish(axes, draw_directions(axes, *lines))


def others(bank: BankCourse, parameters: Sequence[str]) -> list[Group]:
    """Causes that are no parameter, that with the largest g first."""
    found = [group for group in bank.groups if group.cause not in parameters]
    return sorted(found, key=lambda group: -bank.largest(group.cause))


def draw_others(
    axes: Axes, course: Course, bank: BankCourse, groups: Sequence[Group], unit: TimeUnit
) -> None:
    """The evidence for each of these causes; the largest ones are named."""
    named = [group for group in groups[: len(_COLOURS)] if bank.largest(group.cause) >= _WORTH_A_NAME]
    lines = []
    for k, group in reversed(list(enumerate(groups))):  # the largest is drawn last, over the others
        colour, dashes, width = (*_COLOURS[k], 1.2) if k < len(named) else (QUIET, "-", 0.6)
        lines += axes.plot(*_line(course, bank, group, unit), color=colour, ls=dashes, lw=width)
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


def _line(course: Course, bank: BankCourse, group: Group, unit: TimeUnit) -> Line:
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
