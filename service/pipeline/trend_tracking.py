"""The slow courses of all axes: fed with readings, looked at one at a time, saved and put back."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monitor_core.detection.alarm import Alarm, Direction, Reach
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring.forecast_alarms import Limit, reach, watch
from monitor_core.trend.axis_trends import AxisHistory
from monitor_core.trend.entries import Entry, Reading
from monitor_core.trend.forecast import forecast
from monitor_core.trend.trend import Trend, trend_of
from service.config import NamedAxis, limits_of
from service.pipeline.axis_change import Change
from service.store.array_files import Arrays


@dataclass(frozen=True, slots=True)
class ParameterTrend:
    """The slow course of one parameter, as far as it is known."""

    name: str
    unit: str
    nominal: float
    hour_s: float
    """Time in operation of an entry [s]"""
    entries: tuple[Entry, ...] = ()
    trend: Trend | None = None
    """None: there is too little yet"""
    reaches: tuple[Reach, ...] = ()
    """When its limits are reached"""


class Part(NamedTuple):
    """What is saved by itself: its name, what it belongs to, and what it is made of."""

    name: str
    key: str
    arrays: Arrays
    parameter: str = ""
    """Whose closed entries these are; empty: what is being gathered, of all parameters"""


class _Axis(NamedTuple):
    model: AxisModel
    history: AxisHistory
    limits: Mapping[str, tuple[Limit, ...]]
    hour_s: float
    before_us: int
    key: str


class Trends:
    """The slow histories of all axes, what they say, and the alarms about their limits.

    Args:
        axes: as configured.
        models: their models.
        keys: what their histories belong to.
    """

    def __init__(self, axes: Sequence[NamedAxis], models: Sequence[AxisModel], keys: Sequence[str]) -> None:
        self._axes = {
            axis.id: _Axis(
                model,
                AxisHistory(model.monitored, axis.config.trend.interval_s),
                limits_of(axis.config, model),
                axis.config.trend.interval_s,
                round(axis.config.trend.lead_time * 1e6),
                f"slow history 1 {key}",
            )
            for axis, model, key in zip(axes, models, keys, strict=True)
        }
        self._shown = {
            axis_id: [
                ParameterTrend(p.name, p.unit, float(nominal), a.hour_s)
                for p, nominal in zip(a.model.parameters, a.model.theta0, strict=True)
            ]
            for axis_id, a in self._axes.items()
        }
        self._open: dict[tuple[str, str, Direction], Alarm] = {}
        self._saved: dict[str, list[int]] = {}
        self._waiting: dict[tuple[str, int], None] = {}
        self.lost: dict[str, int] = dict.fromkeys(self._axes, 0)
        """Histories, or what was being gathered, that could not be put back, by axis"""

    def take(self, axis_id: str, reading: Reading) -> None:
        """Take a reading of an axis."""
        history = self._axes[axis_id].history
        before = sum(history.closed)
        history.take(reading)
        if sum(history.closed) != before:
            self._waiting |= dict.fromkeys((axis_id, i) for i in history.due())

    def look(self, most: int | None = None) -> list[Change]:
        """Look at so many of the courses that have grown (a few hundredths of a second each), or at all of them.

        Returns the alarms about limits that were raised, updated or ended.
        """
        changes: list[Change] = []
        for axis_id, i in list(self._waiting)[:most]:
            del self._waiting[axis_id, i]
            changes += self._look(axis_id, i)
        return changes

    def of(self, axis_id: str) -> tuple[ParameterTrend, ...]:
        """The slow courses of an axis, as they were looked at last."""
        return tuple(self._shown[axis_id])

    def _look(self, axis_id: str, i: int) -> Iterator[Change]:
        a, shown = self._axes[axis_id], self._shown[axis_id]
        a.history.look(i)
        entries = a.history.slow[i].entries
        trend = trend_of(entries, float(a.model.scale[i]), a.hour_s)
        limits = a.limits.get(shown[i].name, ())
        reaches = []
        for limit in limits if trend is not None else ():
            assert trend is not None
            f = forecast(trend, limit.value, limit.upper)
            reaches.append(reach(limit, f))
            way: Direction = "up" if limit.upper else "down"
            key = axis_id, shown[i].name, way
            now = self._open.get(key)
            episode = watch(shown[i].name, shown[i].nominal, limit, trend, f, a.before_us, now)
            if episode is not None:
                self._keep(key, episode)
                yield Change(axis_id, episode)
        shown[i] = replace(shown[i], entries=entries, trend=trend, reaches=tuple(reaches))

    def _keep(self, key: tuple[str, str, Direction], episode: Alarm) -> None:
        self._open.pop(key, None)
        if episode.ended_us is None:
            self._open[key] = episode

    def adopt(self, open_alarms: Iterable[Change], now_us: int) -> list[Change]:
        """Alarms about limits that are open in the journal; returns those that end, as their limit is gone."""
        ended = []
        for axis_id, e in open_alarms:
            if e.kind != "forecast" or axis_id not in self._axes:
                continue
            limits = self._axes[axis_id].limits.get(e.parameter, ())
            if any(limit.upper == (e.direction == "up") for limit in limits):
                self._open[axis_id, e.parameter, e.direction] = e
            else:
                ended.append(Change(axis_id, replace(e, ended_us=max(now_us, e.updated_us))))
        return ended

    def to_save(self) -> Iterator[Part]:
        """What has to be saved: what is being gathered always, what is closed where there is more of it."""
        for axis_id, a in self._axes.items():
            opened: Arrays = {
                name: slow.open_to_array() for name, slow in zip(a.history.names, a.history.slow, strict=True)
            }
            yield Part(_gathered(axis_id), a.key, opened)
            saved = self._saved.get(axis_id, [])
            for i, slow in enumerate(a.history.slow):
                if saved[i : i + 1] != [a.history.closed[i]]:
                    yield Part(_closed(axis_id, a, i), a.key, {"entries": slow.closed_to_array()})

    def saved(self) -> None:
        """What ``to_save`` gave is on the disk."""
        self._saved = {axis_id: list(a.history.closed) for axis_id, a in self._axes.items()}

    def to_load(self) -> Iterator[tuple[str, Part]]:
        """Names and keys of all that there may be, with the axis."""
        for axis_id, a in self._axes.items():
            for i in range(len(a.history.slow)):
                yield axis_id, Part(_closed(axis_id, a, i), a.key, {}, a.model.monitored[i])
            yield axis_id, Part(_gathered(axis_id), a.key, {})

    def restore(self, found: Mapping[str, Arrays]) -> Iterator[tuple[str, str]]:
        """Go on from what was found, by the names of ``to_load``; returns the names that are of no use, and why."""
        useless = list(self._put_back(found))
        self.saved()
        for axis_id, name, reason in useless:
            self.lost[axis_id] += 1
            yield name, reason

    def _put_back(self, found: Mapping[str, Arrays]) -> Iterator[tuple[str, str, str]]:
        for axis_id, a in self._axes.items():
            opened = found.get(_gathered(axis_id), {})
            for i, slow in enumerate(a.history.slow):
                name = _closed(axis_id, a, i)
                gathered = np.asarray(opened.get(a.history.names[i], ()), float)
                try:
                    closed = found[name]["entries"] if name in found else slow.closed_to_array()
                    slow.restore(np.asarray(closed, float), gathered)
                except (KeyError, ValueError) as error:
                    yield axis_id, name, f"it does not fit this version ({error})"
            a.history.look_again()
            self._waiting |= dict.fromkeys((axis_id, i) for i in a.history.due())


def _gathered(axis_id: str) -> str:
    return f"{axis_id} (history being gathered)"


def _closed(axis_id: str, a: _Axis, i: int) -> str:
    return f"{axis_id} {a.model.monitored[i]} (history)"
