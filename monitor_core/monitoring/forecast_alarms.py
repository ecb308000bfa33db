"""Alarms about limits: a drift is about to reach a limit that the user has set, or has reached it."""

from dataclasses import replace
from typing import NamedTuple

from monitor_core.detection.alarm import Alarm, Direction, Reach
from monitor_core.trend.limit_forecast import Forecast
from monitor_core.trend.trend import Trend

MIN_DRIFT_PROBABILITY = 0.9
"""A less likely drift raises no alarm: a parameter that fluctuates is now and then about to reach any limit."""

HYSTERESIS = 1.5
"""An alarm ends when the limit is so many times as far away in time as it must be to raise one."""


class Limit(NamedTuple):
    """A limit of a monitored parameter, and its name for the user: one of Ja is one of 1/Ja, the other way round."""

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

    @property
    def direction(self) -> Direction:
        """Direction of a change that reaches the limit."""
        return "up" if self.upper else "down"


def reach(limit: Limit, f: Forecast) -> Reach:
    """A forecast under the user's name of the limit."""
    return Reach(limit.name, limit.unit, limit.shown, limit.above, f.state, f.low_us, f.high_us)


def forecast_alarm(
    parameter: str,
    nominal: float,
    limit: Limit,
    trend: Trend,
    f: Forecast,
    lead_time_us: int,
    now: Alarm | None,
) -> Alarm | None:
    """The alarm about a limit from this forecast: new, updated or ended; None: there is none.

    Args:
        parameter: its name.
        nominal: its nominal value.
        limit: the limit.
        trend: of the parameter.
        f: forecast of the time at which it reaches the limit.
        lead_time_us: an alarm is raised when the interval begins within this time.
        now: the open alarm, if there is one.
    """
    size = trend.level - nominal
    if now is not None:
        ended_us = None if _is_near(f, trend, HYSTERESIS * lead_time_us) else trend.time_us
        return replace(
            now,
            updated_us=trend.time_us,
            ended_us=ended_us,
            size=size,
            size_sd=trend.level_sd,
            reaches=(reach(limit, f),),
        )
    drifts = trend.probability["drift"] + trend.probability["both"] >= MIN_DRIFT_PROBABILITY
    if not _is_near(f, trend, lead_time_us) or not (drifts or f.state == "beyond"):
        return None
    return Alarm(
        parameter=parameter,
        direction=limit.direction,
        onset_us=min(trend.change_us, trend.time_us),
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


def _is_near(f: Forecast, trend: Trend, lead_time_us: float) -> bool:
    return f.state == "beyond" or (f.state != "far" and f.low_us - trend.time_us <= lead_time_us)
