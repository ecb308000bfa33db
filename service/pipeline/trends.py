"""Long-term trends of all axes: fed with readings, computed one at a time, saved and restored."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.drive import AxisModel
from monitor_core.monitoring import ParameterTrend, TrendMonitor
from monitor_core.trend import Reading
from service.config import NamedAxis, limits_of
from service.pipeline.alarms import AxisAlarm
from service.store.array_files import Arrays


class SavedPart(NamedTuple):
    """A part of a history that is saved separately: its name, its key, and its arrays."""

    name: str
    key: str
    arrays: Arrays
    parameter: str = ""
    """Whose completed entries these are; empty: the entries that are being gathered, of all parameters"""


class _Axis(NamedTuple):
    names: Sequence[str]
    monitor: TrendMonitor
    key: str


class Trends:
    """The trend monitors of all axes.

    Args:
        axes: as configured.
        models: their models.
        keys: identities of their histories.
    """

    def __init__(self, axes: Sequence[NamedAxis], models: Sequence[AxisModel], keys: Sequence[str]) -> None:
        self._axes = {
            axis.id: _Axis(model.monitored, _trend_monitor(axis, model), f"slow history 1 {key}")
            for axis, model, key in zip(axes, models, keys, strict=True)
        }
        self._saved: dict[str, list[int]] = {}
        self._waiting: dict[tuple[str, int], None] = {}
        self.lost: dict[str, int] = dict.fromkeys(self._axes, 0)
        """Histories that could not be restored, by axis"""

    def take(self, axis_id: str, readings: Iterable[Reading]) -> None:
        """Take readings of an axis."""
        monitor = self._axes[axis_id].monitor
        for reading in readings:
            if monitor.take(reading):
                self._waiting |= dict.fromkeys((axis_id, i) for i in monitor.due())

    def update(self, most: int | None = None) -> list[AxisAlarm]:
        """Compute at most ``most`` of the trends whose histories have grown (a few hundredths of a second each).

        Returns the alarms about limits that were raised, updated or ended.
        """
        changed: list[AxisAlarm] = []
        for axis_id, i in list(self._waiting)[:most]:
            del self._waiting[axis_id, i]
            changed += [AxisAlarm(axis_id, alarm) for alarm in self._axes[axis_id].monitor.update(i)]
        return changed

    def for_axis(self, axis_id: str) -> tuple[ParameterTrend, ...]:
        """The trends of an axis, as last computed."""
        return tuple(self._axes[axis_id].monitor.trends)

    def adopt(self, open_alarms: Iterable[AxisAlarm], now_us: int) -> list[AxisAlarm]:
        """Adopt alarms about limits that are open in the journal; returns those that end, as their limit is gone."""
        forecasts: dict[str, list[AxisAlarm]] = {}
        for axis_alarm in open_alarms:
            if axis_alarm.alarm.kind == "forecast" and axis_alarm.axis_id in self._axes:
                forecasts.setdefault(axis_alarm.axis_id, []).append(axis_alarm)
        return [
            AxisAlarm(axis_id, alarm)
            for axis_id, found in forecasts.items()
            for alarm in self._axes[axis_id].monitor.adopt([trend.alarm for trend in found], now_us)
        ]

    def to_save(self) -> Iterator[SavedPart]:
        """The parts to save: open entries always, completed entries where there are new ones."""
        for axis_id, (names, monitor, key) in self._axes.items():
            histories = zip(names, monitor.histories, strict=True)
            gathered: Arrays = {name: history.open_to_array() for name, history in histories}
            yield SavedPart(_gathered(axis_id), key, gathered)
            saved = self._saved.get(axis_id, [])
            for i, history in enumerate(monitor.histories):
                if saved[i : i + 1] != [monitor.closed[i]]:
                    entries: Arrays = {"entries": history.closed_to_array()}
                    yield SavedPart(_completed(axis_id, names[i]), key, entries)

    def saved(self) -> None:
        """The parts of ``to_save`` are on the disk."""
        self._saved = {axis_id: list(a.monitor.closed) for axis_id, a in self._axes.items()}

    def to_load(self) -> Iterator[tuple[str, SavedPart]]:
        """Names and keys of all possible parts, with the axis."""
        for axis_id, (names, _, key) in self._axes.items():
            for name in names:
                yield axis_id, SavedPart(_completed(axis_id, name), key, {}, name)
            yield axis_id, SavedPart(_gathered(axis_id), key, {})

    def restore(self, found: Mapping[str, Arrays]) -> Iterator[tuple[str, str]]:
        """Continue from the found parts, by name; returns the names that cannot be used, and why."""
        useless = list(self._restored(found))
        self.saved()
        for axis_id, name, reason in useless:
            self.lost[axis_id] += 1
            yield name, reason

    def _restored(self, found: Mapping[str, Arrays]) -> Iterator[tuple[str, str, str]]:
        for axis_id, (names, monitor, _) in self._axes.items():
            opened = found.get(_gathered(axis_id), {})
            for parameter, history in zip(names, monitor.histories, strict=True):
                name = _completed(axis_id, parameter)
                gathered = np.asarray(opened.get(parameter, ()), float)
                try:
                    closed = found[name]["entries"] if name in found else history.closed_to_array()
                    history.restore(np.asarray(closed, float), gathered)
                except (KeyError, ValueError) as error:
                    yield axis_id, name, f"it does not fit this version ({error})"
            monitor.recompute_all()
            self._waiting |= dict.fromkeys((axis_id, i) for i in monitor.due())


def _trend_monitor(axis: NamedAxis, model: AxisModel) -> TrendMonitor:
    trend = axis.config.trend
    return TrendMonitor(model, limits_of(axis.config, model), trend.interval_s, round(trend.lead_time * 1e6))


def _gathered(axis_id: str) -> str:
    return f"{axis_id} (history being gathered)"


def _completed(axis_id: str, parameter: str) -> str:
    return f"{axis_id} {parameter} (history)"
