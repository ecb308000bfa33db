"""Long-term trends of one axis, computed from readings: trends, forecasts, and alarms about limits."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from monitor_core.detection.alarm import Alarm, Direction, Reach
from monitor_core.drive.axis_model import AxisModel
from monitor_core.trend.entries import EstimateReading, HistoryEntry
from monitor_core.trend.limit_forecast import Forecast, forecast
from monitor_core.trend.slow_history import HOUR_S, SlowHistory
from monitor_core.trend.trend import Trend, trend_of

MIN_GROWTH = 50
"""A trend is computed again when its history has grown by this fraction of its length (one part in 50)."""

MIN_DRIFT_PROBABILITY = 0.9
"""A less likely drift raises no alarm: a parameter that fluctuates seems to approach a limit now and then."""

HYSTERESIS = 1.5
"""An alarm ends when the time until the limit is longer than the lead time by this factor."""


class ParameterLimit(NamedTuple):
    """A limit of a monitored parameter, and as the user gave it: an upper limit of Ja is a lower limit of 1/Ja."""

    value: float
    """The limit of the monitored parameter, in its unit"""
    upper: bool
    """True: the monitored parameter must stay below the limit"""
    name: str
    """Name of the quantity as the user gave it"""
    unit: str
    shown: float
    """The limit as the user gave it"""
    above: bool
    """True: the quantity that the user named must stay below the limit"""

    @property
    def direction(self) -> Direction:
        """Direction of a change that reaches the limit."""
        return "up" if self.upper else "down"


@dataclass(frozen=True, slots=True)
class ParameterTrend:
    """The long-term trend of one parameter."""

    name: str
    unit: str
    nominal: float
    hour_s: float
    """Time in operation per entry [s]"""
    entries: tuple[HistoryEntry, ...] = ()
    trend: Trend | None = None
    """None: there is too little data yet"""
    reaches: tuple[Reach, ...] = ()
    """Forecasts of the times at which its limits are reached"""


class TrendMonitor:
    """Histories and trends of the monitored parameters of one axis, and the alarms about their limits.

    ``limits``: limits by parameter.  An alarm is raised when a limit may be reached within ``lead_time_us``.
    ``hour_s``: time in operation [s] per entry of the histories.
    """

    def __init__(
        self,
        model: AxisModel,
        limits: Mapping[str, Sequence[ParameterLimit]],
        hour_s: float = HOUR_S,
        lead_time_us: int = 0,
    ) -> None:
        self._scale, self._limits, self._lead_time_us = model.scale, limits, lead_time_us
        self.histories = tuple(SlowHistory(hour_s) for _ in model.monitored)
        self.closed = [0] * len(model.monitored)
        """Number of entries completed since the start, by parameter"""
        self.trends = [
            ParameterTrend(p.name, p.unit, float(nominal), hour_s)
            for p, nominal in zip(model.parameters, model.theta0, strict=True)
        ]
        """Trends of the parameters, as computed last"""
        self._computed = [0] * len(model.monitored)
        self._open: dict[tuple[str, Direction], Alarm] = {}

    def take(self, reading: EstimateReading) -> bool:
        """Add a reading to the histories of the parameters that it knows; returns whether an entry was completed."""
        before = sum(self.closed)
        for i, history in enumerate(self.histories):
            if reading.known[i]:
                value, variance = reading.value[i], reading.variance[i]
                self.closed[i] += history.take(reading.time_us, value, variance, reading.span_s, reading.correlation)
        return sum(self.closed) != before

    def due(self) -> list[int]:
        """Indices of the parameters whose trends must be computed again."""
        return [i for i in range(len(self.closed)) if self._has_grown(i)]

    def recompute_all(self) -> None:
        """Mark all trends as due, as after a restart."""
        self._computed = [-1] * len(self.closed)

    def update(self, i: int) -> list[Alarm]:
        """Compute the trend of parameter i; returns the alarms about its limits that were raised, updated or ended."""
        self._computed[i] = self.closed[i]
        last, entries = self.trends[i], self.histories[i].entries
        trend = trend_of(entries, float(self._scale[i]), last.hour_s)
        changed, reaches = [], []
        for limit in self._limits.get(last.name, ()) if trend is not None else ():
            assert trend is not None
            f = forecast(trend, limit.value, limit.upper)
            reaches.append(Reach(limit.name, limit.unit, limit.shown, limit.above, f.state, f.low_us, f.high_us))
            alarm = self._alarm(last, limit, trend, f, reaches[-1])
            if alarm is not None:
                changed.append(alarm)
                if alarm.ended_us is None:
                    self._open[last.name, limit.direction] = alarm
        self.trends[i] = replace(last, entries=entries, trend=trend, reaches=tuple(reaches))
        return changed

    def _alarm(
        self, last: ParameterTrend, limit: ParameterLimit, trend: Trend, f: Forecast, reach: Reach
    ) -> Alarm | None:
        """The new, updated or ended alarm about a limit after this forecast; None: there is no alarm."""
        alarm, size = self._open.pop((last.name, limit.direction), None), trend.level - last.nominal
        if alarm is not None:
            near = _is_near(f, trend, HYSTERESIS * self._lead_time_us)
            alarm = replace(alarm, updated_us=trend.time_us, ended_us=None if near else trend.time_us)
            return replace(alarm, size=size, size_sd=trend.level_sd, reaches=(reach,))
        drifts = trend.probability["drift"] + trend.probability["both"] >= MIN_DRIFT_PROBABILITY
        if not _is_near(f, trend, self._lead_time_us) or not (drifts or f.state == "beyond"):
            return None
        return Alarm(
            parameter=last.name,
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
            reaches=(reach,),
        )

    def adopt(self, open_alarms: Iterable[Alarm], now_us: int) -> list[Alarm]:
        """Adopt open alarms about limits; returns those that end because their limit no longer exists."""
        ended = []
        for alarm in open_alarms:
            if any(limit.direction == alarm.direction for limit in self._limits.get(alarm.parameter, ())):
                self._open[alarm.parameter, alarm.direction] = alarm
            else:
                ended.append(replace(alarm, ended_us=max(now_us, alarm.updated_us)))
        return ended

    def _has_grown(self, i: int) -> bool:
        if self._computed[i] < 0:
            return bool(self.histories[i].entries)
        new = self.closed[i] - self._computed[i]
        return new > 0 and new * MIN_GROWTH >= len(self.histories[i].entries)


def _is_near(f: Forecast, trend: Trend, lead_time_us: float) -> bool:
    return f.state == "beyond" or (f.state != "far" and f.low_us - trend.time_us <= lead_time_us)
