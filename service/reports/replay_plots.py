"""The paper's Figures 5 and 6 for a record: estimates with their bands, g with h, and the fates of the samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.monitoring import DOUBTED, GATED, IDLE, SEED, SETTLE, TRACK, ParameterStatus
from monitor_core.wording import duration
from service.reports import plot_style as style
from service.reports import replay_course as kinds
from service.reports.replay_course import SIGMAS, ReplayCourse, runs_of
from service.reports.replay_result import ReplayedAxis
from service.reports.timeline import time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_TOGETHER = 4
"""Most parameters in one picture: more would not fit a page of paper."""
_MOST_PAUSES, _MOST_NAMED = 60, 8
_ESTIMATE, _G, _FATE, _LEGEND = 1.75, 1.05, 0.2, 0.9
"""Heights of the panels [inches]."""
_LINES = (
    *("estimate", f"± {SIGMAS:g} standard deviations", "nominal", "limits"),
    *("test for an increase", "test for a decrease", style.ALARM_OPEN, style.ONSET),
    *("alarm raised", "nothing learned", "pause, cut out"),
)
"""Fates of the samples in the order of the legend."""
_ESTIMATED, _BAND, _NOMINAL, _LIMIT, _UP, _DOWN, _, _, _RAISED, _NOTHING, _PAUSE = _LINES
_FATES = (
    (SETTLE, "settling"),
    (SEED, "first uncertainty"),
    (GATED, "gated"),
    (IDLE, "nothing to learn"),
    (DOUBTED, "outliers"),
)
_CAUSES = (
    (style.TEXT, "-"),
    (style.QUIET, (0, (5.3, 2))),
    (style.TEXT, (0, (1, 1.2))),
    (style.QUIET, (0, (6, 2, 1, 2))),
    (style.BAND, "-"),
)
"""Colours and dashes of the causes that a panel names: the likeliest ones."""
_WORTH_A_NAME = 0.3
"""Smallest g / h of a cause that is named."""
_LINEAR = 1.6
"""Up to this value g / h is drawn linearly; its part above h logarithmically, since it grows fast after a change."""


def axis_pictures(axis: ReplayedAxis, course: ReplayCourse, salt: str) -> Iterator[str]:
    """For each parameter theta with its band and g with h, below them the fates of the samples; SVG elements."""
    drawing, parameters = _Drawing(axis, course), axis.status.parameters
    for first in range(0, len(parameters), MOST_TOGETHER):
        chosen = parameters[first : first + MOST_TOGETHER]
        yield drawing.picture(chosen, chosen[-1] is parameters[-1], f"{salt}-{first}")


class _Drawing:
    """Pictures of an axis over the time line of its samples."""

    def __init__(self, axis: ReplayedAxis, course: ReplayCourse) -> None:
        self._axis, self._course = axis, course
        self._unit = time_unit(1e-6 * course.timeline.end_us)
        self._edges = course.edges / self._unit.seconds
        self._middles = (self._edges[:-1] + self._edges[1:]) / 2

    def picture(self, chosen: Sequence[ParameterStatus], is_last: bool, salt: str) -> str:
        """The panels of these parameters; the last picture also has the causes of the multi-model detector."""
        fates = list(self._fates(chosen))
        with_causes = is_last and bool(self._course.causes)
        heights = [_ESTIMATE, _G] * len(chosen) + [_G] * with_causes + [_FATE * (len(fates) + 1)] * bool(fates)
        with style.figure(sum(heights) + _LEGEND) as drawn:
            grid = drawn.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)
            panels: list[Axes] = list(grid[:, 0])
            for k, p in enumerate(chosen):
                own = panels[2 * k : 2 * k + 2]
                self._draw_estimate(own[0], p)
                self._draw_g(own[1], p.name)
                self._mark_alarms(own, p.name)
            if with_causes:
                axes = panels[2 * len(chosen)]
                self._draw_causes(axes)
                self._mark_alarms([axes], *self._course.causes)
            for axes in panels[: len(heights) - bool(fates)]:
                self._shade(axes)
            if fates:
                self._draw_fates(panels[-1], fates)
            for axes in panels:
                self._mark_pauses(axes, named=axes is panels[0])
            end = max(float(self._edges[-1]), 1e-6 / self._unit.seconds)
            panels[-1].set(xlabel=f"time since the first sample [{self._unit.name}]", xlim=(0.0, end))
            style.legend_of(drawn, panels, _LINES)
            names = ", ".join(p.name for p in chosen)
            return style.as_svg(drawn, f"{self._axis.id}: course of the estimates of {names}, and of their tests", salt)

    # --- estimates, g of the CUSUM tests, g of the multi-model detector ----------------------------------

    def _draw_estimate(self, axes: Axes, p: ParameterStatus) -> None:
        course, t = self._course, self._middles
        band = course.low(kinds.BELOW, p.name), course.high(kinds.ABOVE, p.name)
        axes.fill_between(t, *band, color=style.BAND, alpha=0.45, lw=0, label=_BAND)
        below, above = course.low(kinds.TOLERATED_BELOW, p.name), course.high(kinds.TOLERATED_ABOVE, p.name)
        axes.plot(t, below, **style.LIMIT)
        axes.plot(t, above, **style.LIMIT, label=_LIMIT)
        axes.plot(*self._zigzag(kinds.NOMINAL, p.name), **style.NOMINAL, label=_NOMINAL)
        between = course.low(kinds.ESTIMATE, p.name), course.high(kinds.ESTIMATE, p.name)
        axes.fill_between(t, *between, color=style.BAND, alpha=0.7, lw=0)
        axes.plot(t, course.mean(p.name), **style.ESTIMATE, label=_ESTIMATED)
        label = p.name if p.unit == "1" else f"{p.name} [{p.unit}]"
        axes.set(ylabel=label, ylim=self._limits(p.name))
        axes.set_title(f"{p.name}: {p.meaning}")
        if p.nominal:
            style.add_percent(axes, p.nominal)

    def _limits(self, name: str) -> tuple[float, float]:
        """Limits that show theta, theta_0, and the usual width of the bands (wide while P(0) is searched for)."""
        low, high, learned = self._course.low, self._course.high, self._course.fate(TRACK) > 0
        usual: list[float] = []
        if learned.any():
            for kind, values, share in (
                (kinds.BELOW, low, 3),
                (kinds.TOLERATED_BELOW, low, 10),
                (kinds.ABOVE, high, 97),
                (kinds.TOLERATED_ABOVE, high, 90),
            ):
                usual.append(float(np.nanpercentile(values(kind, name)[learned], share)))
        for kind in (kinds.ESTIMATE, kinds.NOMINAL):
            usual += [float(np.nanmin(low(kind, name))), float(np.nanmax(high(kind, name)))]
        least, most = min(usual), max(usual)
        room = 0.06 * (most - least) or 0.05 * abs(most) or 1.0
        return least - room, most + room

    def _draw_g(self, axes: Axes, name: str) -> None:
        h = self._course.h[name]
        for kind, look, label in ((kinds.UP, style.UP, _UP), (kinds.DOWN, style.DOWN, _DOWN)):
            t, g = self._zigzag(kind, name)
            axes.plot(t, g / h, **look, label=label)
        axes.axhline(1, **style.LIMIT, label=_LIMIT)
        top = self._course.largest(kinds.UP, kinds.DOWN, name=name) / h
        axes.set(ylabel="CUSUM\ntest", ylim=(0, 1.15 * max(top, 1.0)))

    def _draw_causes(self, axes: Axes) -> None:
        """The evidence for each cause; the largest values are named."""
        largest = {cause: self._course.largest(kinds.EVIDENCE, name=cause) for cause in self._course.causes}
        ranked = sorted(largest, key=lambda cause: -largest[cause])
        named = [cause for cause in ranked[: len(_CAUSES)] if largest[cause] >= _WORTH_A_NAME]
        lines = []
        for k, cause in reversed(list(enumerate(ranked))):  # the largest is drawn last, over the others
            colour, dashes, width = (*_CAUSES[k], 1.2) if cause in named else (style.QUIET, "-", 0.6)
            lines += axes.plot(*self._zigzag(kinds.EVIDENCE, cause), color=colour, ls=dashes, lw=width)
        axes.legend(
            lines[::-1][: len(named)],
            named,
            loc="lower right",
            bbox_to_anchor=(1, 0.97),
            ncols=len(_CAUSES),
            fontsize=8.5,
            handlelength=1.6,
            borderpad=0.1,
        )
        axes.axhline(1, **style.LIMIT, label=_LIMIT)
        axes.set(ylabel="multi-model\ntest", title="causes")
        top = largest[ranked[0]]
        if top <= _LINEAR:
            axes.set(ylim=(0, 1.15 * max(top, 1.0)))
            return
        axes.set_yscale("symlog", linthresh=1, linscale=0.8)
        ticks = [0.0, 1.0, *(10.0**k for k in range(1, int(np.log10(top)) + 1))]
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_yticks([], minor=True)
        axes.set_ylim(0, 1.5 * top)

    def _zigzag(self, kind: int, name: str) -> tuple[Floats, Floats]:
        """A line through the smallest and the largest value of each bin; downwards in one bin, upwards in the next."""
        both = np.stack([self._course.low(kind, name), self._course.high(kind, name)], axis=1)
        both[1::2] = both[1::2, ::-1]
        return np.repeat(self._middles, 2), both.ravel()

    # --- alarms, pauses, what was not learned from -------------------------------------------------------

    def _mark_alarms(self, panels: Sequence[Axes], *names: str) -> None:
        """An alarm as on the dashboard: a tinted span from onset to end, a bar and an arrow at its top."""
        for alarm in self._axis.alarm_spans(names, self._unit):
            for axes in panels:
                above, span = axes.get_xaxis_transform(), (alarm.start, alarm.end)
                axes.axvspan(*span, color=style.ALARM_BACK, alpha=0.6, lw=0, zorder=0.5, label=style.ALARM_OPEN)
                axes.plot(span, (1, 1), color=style.ALARM, lw=4, transform=above, solid_capstyle="butt")
                axes.axvline(alarm.start, color=style.ALARM, lw=1.3)
                axes.axvline(alarm.raised, color=style.ALARM, lw=1, ls=(0, (6, 2, 1, 2)), label=_RAISED)
                axes.text(alarm.start, 0.94, f" {alarm.arrow}", color=style.ALARM, va="top", transform=above)
                if alarm.onset is not None:
                    axes.plot(
                        alarm.onset,
                        (0.07, 0.07),
                        "|-",
                        color=style.ALARM,
                        ms=7,
                        transform=above,
                        label=style.ONSET,
                    )

    def _mark_pauses(self, axes: Axes, named: bool) -> None:
        stretches = self._course.timeline.stretches[1:]
        for stretch in stretches if len(stretches) <= _MOST_PAUSES else ():
            at = 1e-6 * stretch.at / self._unit.seconds
            axes.axvline(at, color=style.QUIET, lw=1, ls=(0, (4, 2, 1, 2)), label=_PAUSE)
            if named and len(stretches) <= _MOST_NAMED:
                words = f"pause of {duration(stretch.pause_s)}" if stretch.pause_s > 0 else "clock set back"
                above = axes.get_xaxis_transform()
                axes.annotate(words, (at, 1.02), xycoords=above, fontsize=8, color=style.QUIET, ha="center")

    def _shade(self, axes: Axes) -> None:
        """Bins without learning: they have samples, but none of them was used."""
        runs = list(runs_of(self._course.fate(TRACK) == 0, self._edges))
        if runs:
            transform = axes.get_xaxis_transform()
            axes.broken_barh(
                runs, (0, 1), color=style.ZONE, alpha=0.6, lw=0, transform=transform, zorder=0, label=_NOTHING
            )

    def _fates(self, chosen: Sequence[ParameterStatus]) -> Iterator[tuple[str, Bools]]:
        """The reasons that prevented learning, and the bins with each."""
        for name, where in (
            ("no samples", self._course.gaps),
            *((name, self._course.fate(fate) > 0) for fate, name in _FATES),
            *((f"{p.name} not observed", self._course.unseen(p.name) > 0) for p in chosen),
        ):
            if where.any():
                yield name, where

    def _draw_fates(self, axes: Axes, fates: Sequence[tuple[str, Bools]]) -> None:
        for k, (_, where) in enumerate(fates):
            axes.broken_barh(list(runs_of(where, self._edges)), (k - 0.32, 0.64), color=style.QUIET, lw=0)
        axes.set_yticks(range(len(fates)), [name for name, _ in fates], fontsize=8.5)
        axes.set(ylim=(len(fates) - 0.4, -0.6), title="What kept from learning")
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
