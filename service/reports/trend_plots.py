"""The slow course of a parameter: its history, what is made of it, and the forecast with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monitor_core.detection import Reach
from monitor_core.monitoring import ParameterTrend
from monitor_core.trend import COVERED, Trend, quantiles
from service.reports.plot_style import (
    ALARM,
    FOUND,
    INK,
    MEASURED,
    QUIET,
    add_percent,
    as_svg,
    figure,
    legend_of,
    with_unit,
)
from service.reports.replay_result import TimeUnit, time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANEL, _LEGEND = 2.3, 0.75
"""Heights, inches."""
_STEPS = 120
"""Points of the course in the past, and as many in the future."""
_BAND = (1 - COVERED) / 2, 0.5, (1 + COVERED) / 2
_LEAST_AHEAD, _MOST_AHEAD, _ROOM = 0.3, 4.0, 1.12
"""How far the future is drawn, in lengths of the history; beyond the last end of an interval."""
_BEYOND = 0.15
"""Room behind a limit that will be reached, in distances to it."""
_MANY = 150
"""More entries than this are drawn as dots alone."""
_ENTRY, _COURSE, _FAN = "entry of the history ± sd", "course", f"holds it with {100 * COVERED:.0f} %"
_NOMINAL, _LIMIT, _REACHED, _NOW = "nominal", "limit", "reached in this interval", "end of the record"
_ORDER = (_ENTRY, _COURSE, _FAN, _NOMINAL, _LIMIT, _REACHED, _NOW)


class _Line(NamedTuple):
    zero_us: int
    unit: TimeUnit
    end_s: float

    def at(self, t_us: int) -> float:
        return (t_us - self.zero_us) * 1e-6 / self.unit.seconds


def trend_picture(axis_id: str, trends: Sequence[ParameterTrend], meanings: Sequence[str], salt: str) -> str:
    """A panel for each parameter, one below the other, over one time; an SVG element."""
    line = _line(trends)
    with figure(_PANEL * len(trends) + _LEGEND) as drawn:
        grid = drawn.subplots(len(trends), 1, sharex=True, squeeze=False)
        for axes, trend, meaning in zip(grid[:, 0], trends, meanings, strict=True):
            _draw(axes, trend, line)
            axes.set_title(f"{trend.name}: {meaning}")
        last: Axes = grid[-1, 0]
        last.set(
            xlabel=f"time since the first entry of the history [{line.unit.name}]",
            xlim=(0, line.end_s / line.unit.seconds),
        )
        legend_of(drawn, list(grid[:, 0]), _ORDER, rows=2)
        names = ", ".join(trend.name for trend in trends)
        return as_svg(drawn, f"{axis_id}: slow course of {names}, with forecasts", salt)


def _line(trends: Sequence[ParameterTrend]) -> _Line:
    """From the first entry as far ahead as the intervals ask for."""
    known = [trend.trend for trend in trends if trend.trend is not None]
    start, now = min(t.since_us for t in known), max(t.time_us for t in known)
    length = 1e-6 * (now - start)
    ends = [t for trend in trends for r in trend.reaches for t in _ends(r)]
    ahead = max([_ROOM * 1e-6 * (t - now) for t in ends], default=0.0)
    end = length + float(np.clip(ahead, _LEAST_AHEAD * length, _MOST_AHEAD * length))
    return _Line(start, time_unit(end), end)


def _ends(r: Reach) -> tuple[int, ...]:
    """Times that are worth to be seen: not those before which nothing is foretold."""
    if r.state in ("far", "beyond"):
        return ()
    return (r.low_us,) if r.high_us is None else (r.low_us, r.high_us)


def _draw(axes: Axes, trend: ParameterTrend, line: _Line) -> None:
    assert trend.trend is not None
    _draw_entries(axes, trend, line)
    low, high = _draw_course(axes, trend.trend, line)
    axes.axhline(trend.nominal, color=INK, lw=1, ls=(0, (5, 3)), label=_NOMINAL)
    axes.axvline(line.at(trend.trend.time_us), color=QUIET, lw=1, ls=(0, (1, 1.5)), label=_NOW)
    whisker = float(np.median([e.variance for e in trend.entries])) ** 0.5
    seen = [low, high, trend.nominal, *(e.mean + way * whisker for e in trend.entries for way in (-1, 1))]
    for r in trend.reaches:
        limit = _draw_limit(axes, trend, r, line)
        beyond = _BEYOND * (limit - trend.trend.level) if r.state in ("ahead", "open") else 0.0
        seen.append(limit + beyond)
    room = 0.08 * (max(seen) - min(seen)) or 0.05 * abs(trend.nominal) or 1.0
    axes.set(ylabel=with_unit(trend.name, trend.unit), ylim=(min(seen) - room, max(seen) + room))
    if trend.nominal:
        add_percent(axes, trend.nominal)


def _draw_entries(axes: Axes, trend: ParameterTrend, line: _Line) -> None:
    t = [line.at(e.middle_us) for e in trend.entries]
    mean, sd = ([e.mean for e in trend.entries], [e.variance**0.5 for e in trend.entries])
    few = len(t) <= _MANY
    drawn = axes.errorbar(
        t,
        mean,
        sd if few else None,
        fmt="o",
        ms=3.2 if few else 1.8,
        mew=0,
        color=MEASURED,
        elinewidth=0.7,
        label=_ENTRY,
    )
    for whiskers in drawn[2]:
        whiskers.set_alpha(0.45)


def _draw_course(axes: Axes, t: Trend, line: _Line) -> tuple[float, float]:
    """In the past and in the future; returns the least and the largest value that it may have now."""
    m = t.mixture
    ahead = line.zero_us + line.end_s * 1e6
    past, future = np.linspace(m.begin, m.end, _STEPS), np.linspace(m.end, (ahead - m.zero_us) * 1e-6, _STEPS)
    for at, dashes, alpha, label in ((past, "-", 0.26, True), (future, (0, (4, 2)), 0.14, False)):
        low, middle, high = quantiles(m, at, _BAND)
        x = [line.at(m.zero_us + round(s * 1e6)) for s in at.tolist()]
        axes.fill_between(x, low, high, color=FOUND, alpha=alpha, lw=0, label=_FAN if label else None)
        axes.plot(x, middle, color=FOUND, lw=1.5, ls=dashes, label=_COURSE if label else None)
    low, _, high = quantiles(m, np.array([m.end]), _BAND)
    return float(low[0]), float(high[0])


def _draw_limit(axes: Axes, trend: ParameterTrend, r: Reach, line: _Line) -> float:
    """The limit, and on it the interval in which it is reached; returns it, in the parameter's unit."""
    level = r.limit if r.name == trend.name else 1 / r.limit  # that of Ja is one of 1/Ja
    axes.axhline(level, color=ALARM, lw=1.1, ls=(0, (5, 2)), label=_LIMIT)
    if r.state != "far":
        end = line.end_s / line.unit.seconds
        low, high = line.at(r.low_us), end if r.high_us is None else line.at(r.high_us)
        axes.plot(
            [max(low, 0.0), max(high, low)],
            [level, level],
            color=ALARM,
            lw=6,
            alpha=0.55,
            solid_capstyle="butt",
            zorder=4,
            label=_REACHED,
        )
    return level
