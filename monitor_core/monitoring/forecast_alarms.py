"""When a limit is near enough for a word: an alarm of its own kind, raised, updated and ended."""

from dataclasses import replace
from typing import NamedTuple

from monitor_core.detection.alarm import Alarm, Direction, Reach
from monitor_core.trend.forecast import Forecast
from monitor_core.trend.trend import Trend

SURE = 0.9
"""A drift that is less likely raises no alarm: something that wanders is now and then about to reach anything."""

OVER = 1.5
"""An alarm ends when the limit is so many times as far as it has to be to raise one."""


class Limit(NamedTuple):
    """A limit of a monitored parameter, and how the user calls it: that of Ja is one of 1/Ja, the other way round."""

    value: float
    """Of the monitored parameter, in its unit"""
    upper: bool
    """The monitored parameter must stay below"""
    name: str
    unit: str
    shown: float
    """As the user gave it"""
    above: bool
    """What the user named must stay below: it is reached from below"""


def reach(limit: Limit, f: Forecast) -> Reach:
    """A forecast with the name that the user has for it."""
    return Reach(limit.name, limit.unit, limit.shown, limit.above, f.state, f.low_us, f.high_us)


def watch(
    parameter: str,
    nominal: float,
    limit: Limit,
    trend: Trend,
    f: Forecast,
    before_us: int,
    now: Alarm | None,
) -> Alarm | None:
    """The alarm about a limit as it is by this forecast: new, updated or ended; None: there is none.

    Args:
        parameter: its name.
        nominal: its nominal value.
        limit: which.
        trend: of the parameter.
        f: when it reaches the limit.
        before_us: an alarm is raised when the interval begins within this time.
        now: the open alarm, if there is one.
    """
    size = trend.level - nominal
    if now is not None:
        near = _is_near(f, trend, OVER * before_us)
        ended_us = None if near else trend.time_us
        told = (reach(limit, f),)
        return replace(
            now, updated_us=trend.time_us, ended_us=ended_us, size=size, size_sd=trend.level_sd, reaches=told
        )
    drifts = trend.probability["drift"] + trend.probability["both"] >= SURE
    if not _is_near(f, trend, before_us) or not (drifts or f.state == "beyond"):
        return None
    direction: Direction = "up" if limit.upper else "down"
    onset_us = min(trend.change_us, trend.time_us)
    return Alarm(
        parameter=parameter,
        direction=direction,
        onset_us=onset_us,
        raised_us=trend.time_us,
        updated_us=trend.time_us,
        ended_us=None,
        size=size,
        size_sd=trend.level_sd,
        crossings=1,
        stage="named",
        kind="forecast",
        reaches=(reach(limit, f),),
    )


def _is_near(f: Forecast, trend: Trend, before_us: float) -> bool:
    return f.state == "beyond" or (f.state != "far" and f.low_us - trend.time_us <= before_us)
