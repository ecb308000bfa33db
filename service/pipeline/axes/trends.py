"""Long-term trends of all axes: takes readings, computes trends one at a time, saves and restores histories."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from monitor_core.drive import AxisModel
from monitor_core.monitoring import ParameterTrend, TrendMonitor
from monitor_core.trend import EstimateReading
from service.config import NamedAxis, limits_of
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.store.checkpoints import MonitorState


class AxisTrends(NamedTuple):
    """The trends of one axis: names of its parameters, their monitor, the key of the saved histories."""

    names: Sequence[str]
    monitor: TrendMonitor
    key: str


class Trends:
    """The trend monitors of all axes.

    Args:
        axes: the configured axes.
        models: their models.
        keys: keys of their saved histories.
    """

    def __init__(self, axes: Sequence[NamedAxis], models: Sequence[AxisModel], keys: Sequence[str]) -> None:
        self.axes = {
            axis.id: AxisTrends(model.monitored, _trend_monitor(axis, model), f"slow history 1 {key}")
            for axis, model, key in zip(axes, models, keys, strict=True)
        }
        """Trends by axis"""
        self._saved: dict[str, list[int]] = {}
        self._waiting: dict[tuple[str, int], None] = {}
        self.lost: dict[str, int] = dict.fromkeys(self.axes, 0)
        """Number of histories that could not be restored, by axis"""

    def change(self, axis_ids: Iterable[str], new: Trends) -> None:
        """Follow exactly these axes from now on.  Axes in ``new`` get its trends; the others keep theirs."""
        kept = set(axis_ids) - new.axes.keys()
        self.axes = {a: own for a, own in self.axes.items() if a in kept} | new.axes
        self.lost = {a: own for a, own in self.lost.items() if a in kept} | new.lost
        self._saved = {a: own for a, own in self._saved.items() if a in kept}
        self._waiting = {due: None for due in self._waiting if due[0] in kept}

    def take(self, axis_id: str, readings: Iterable[EstimateReading]) -> None:
        """Take readings of an axis; mark the trends whose histories grow."""
        monitor = self.axes[axis_id].monitor
        for reading in readings:
            if monitor.take(reading):
                self._waiting |= dict.fromkeys((axis_id, i) for i in monitor.due())

    def update(self, most: int | None = None) -> list[AxisAlarm]:
        """Compute at most ``most`` of the trends whose histories have grown (each takes some 10 ms).

        Returns the forecast alarms that were raised, updated or ended.
        """
        changed: list[AxisAlarm] = []
        for axis_id, i in list(self._waiting)[:most]:
            del self._waiting[axis_id, i]
            changed += [AxisAlarm(axis_id, alarm) for alarm in self.axes[axis_id].monitor.update(i)]
        return changed

    def for_axis(self, axis_id: str) -> tuple[ParameterTrend, ...]:
        """The latest computed trends of an axis."""
        return tuple(self.axes[axis_id].monitor.trends)

    def adopt(self, open_alarms: Iterable[AxisAlarm], now_us: int) -> list[AxisAlarm]:
        """Adopt open forecast alarms of the journal; returns those that end, as their limit is no longer configured."""
        forecasts: dict[str, list[AxisAlarm]] = {}
        for axis_alarm in open_alarms:
            if axis_alarm.alarm.kind == "forecast" and axis_alarm.axis_id in self.axes:
                forecasts.setdefault(axis_alarm.axis_id, []).append(axis_alarm)
        return [
            AxisAlarm(axis_id, alarm)
            for axis_id, found in forecasts.items()
            for alarm in self.axes[axis_id].monitor.adopt([trend.alarm for trend in found], now_us)
        ]

    def to_save(self) -> Iterator[MonitorState]:
        """The states to save: open entries always, completed entries only if there are new ones."""
        for axis_id, (names, monitor, key) in self.axes.items():
            histories = zip(names, monitor.histories, strict=True)
            yield MonitorState(
                gathered_id(axis_id), key, {name: history.open_to_array() for name, history in histories}
            )
            saved = self._saved.get(axis_id, [])
            for i, history in enumerate(monitor.histories):
                if saved[i : i + 1] != [monitor.closed[i]]:
                    entries = {"entries": history.closed_to_array()}
                    yield MonitorState(completed_id(axis_id, names[i]), key, entries)

    def saved(self) -> None:
        """Note that the states of ``to_save`` are on the disk."""
        self._saved = {axis_id: list(a.monitor.closed) for axis_id, a in self.axes.items()}

    def resume(self, lost: Iterable[str]) -> None:
        """Continue from restored histories; ``lost``: the axis of each history that could not be restored."""
        for axis_id, count in Counter(lost).items():
            self.lost[axis_id] += count
        for axis_id, axis in self.axes.items():
            axis.monitor.recompute_all()
            self._waiting |= dict.fromkeys((axis_id, i) for i in axis.monitor.due())
        self.saved()


def _trend_monitor(axis: NamedAxis, model: AxisModel) -> TrendMonitor:
    trend = axis.config.trend
    return TrendMonitor(model, limits_of(axis.config, model), trend.interval_s, round(trend.lead_time * 1e6))


def gathered_id(axis_id: str) -> str:
    """Name under which the open entries of all parameters of an axis are saved."""
    return f"{axis_id} (history being gathered)"


def completed_id(axis_id: str, parameter: str) -> str:
    """Name under which the completed entries of a parameter are saved."""
    return f"{axis_id} {parameter} (history)"
