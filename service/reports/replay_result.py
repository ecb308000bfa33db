"""What a replay found of each axis, collected while the records run, as its reports need it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from monitor_core.detection import Alarm, AlarmKey
from monitor_core.monitoring import AxisStatus, AxisTrace, ParameterTrend
from monitor_core.samples import SampleBlock
from service.config import Config, NamedAxis
from service.ingest.records import Record
from service.ingest.timestamp_jitter import Stamps, remarks
from service.pipeline.alarms import Quantity, quantities
from service.pipeline.axis_monitors import AxisMonitors
from service.reports.formats import Provenance, plain
from service.reports.replay_course import Course
from service.texts import DATED_US, episode_words, iso, reach_words, trend_words


class ReplayedAxis(NamedTuple):
    """One axis after its records."""

    id: str
    drive: str
    status: AxisStatus
    gated_by: str
    alarms: Sequence[Alarm]
    """In the order in which they were raised"""
    quantities: Mapping[str, Quantity]
    """Unit and nominal value of whatever its alarms may name; of parameters the present one"""
    dropped: Mapping[str, int]
    """What never reached the monitor, by reason"""
    clock: Mapping[str, int]
    """How often its time line restarted, by cause"""
    stamps: Stamps | None
    trends: Sequence[ParameterTrend]
    notes: Sequence[str]
    """What cannot be determined, and what its time stamps say, in words"""
    course: Course | None
    """None: it is not to be drawn"""

    @property
    def known_trends(self) -> list[ParameterTrend]:
        """Slow courses of parameters of which enough is known."""
        return [trend for trend in self.trends if trend.trend is not None]

    def words(self, alarm: Alarm) -> str:
        """An alarm in a sentence."""
        quantity = self.quantities[alarm.parameter]
        return episode_words(alarm, quantity.nominal, quantity.unit)


class Replayed(NamedTuple):
    """All axes, and where the samples come from."""

    axes: Sequence[ReplayedAxis]
    frames_dropped: Mapping[str, Mapping[str, int]]
    records: Sequence[str]
    config: str
    provenance: Provenance


class Replay:
    """Runs records through monitors, and collects what there is to tell.

    Args:
        monitors: of the axes of ``config``.
        config: the configuration.
        drawn: also collect the course of each axis.
    """

    def __init__(self, monitors: AxisMonitors, config: Config, drawn: bool) -> None:
        self._monitors, self._config = monitors, config
        self._courses = {name: Course(m) for name, m in monitors.by_id.items()} if drawn else {}
        self._alarms: dict[tuple[str, AlarmKey], Alarm] = {}
        self._dropped = {axis.id: Counter[str]() for axis in config.axes}
        self._clock = {axis.id: Counter[str]() for axis in config.axes}
        self._frames_dropped: dict[str, Counter[str]] = {}
        self._stamps: dict[str, Stamps] = {}
        self._quantities = quantities(monitors.by_id)

    def add(self, record: Record, progress: Callable[[float], None]) -> None:
        """Run a record, after those before it.

        Raises:
            RecordError: it is damaged.
        """
        for step in record.steps():
            changes = self._monitors.update(step.samples, self._see if self._courses else None)
            for axis_id, alarm in (*changes, *self._monitors.trends.update()):
                self._alarms[axis_id, alarm.key] = alarm
            progress(step.done)
        quality = record.quality
        for own, counted in (
            (self._dropped, quality.axis_dropped),
            (self._frames_dropped, quality.bus_dropped),
            (self._clock, quality.axis_events),
        ):
            for name, counts in counted.items():
                own.setdefault(name, Counter()).update(counts)
        self._stamps.update(quality.axis_stamps)

    def _see(self, axis_id: str, block: SampleBlock, trace: AxisTrace) -> None:
        self._courses[axis_id].take(block.t_us, trace.estimator, trace.crossings, trace.multimodel)

    def result(self, records: Sequence[str], config: str) -> Replayed:
        """What was found in these records with this file of configuration."""
        axes = [self._axis(axis) for axis in self._config.axes]
        return Replayed(axes, self._frames_dropped, records, config, Provenance.now())

    def _axis(self, axis: NamedAxis) -> ReplayedAxis:
        monitor, stamps = self._monitors.by_id[axis.id], self._stamps.get(axis.id)
        status = monitor.status()
        known = {name: quantity for (owner, name), quantity in self._quantities.items() if owner == axis.id}
        now = {p.name: Quantity(p.unit, p.nominal) for p in status.parameters}
        doubts = () if stamps is None else remarks(axis.id, axis.config.sample_interval_s, stamps)
        return ReplayedAxis(
            id=axis.id,
            drive=monitor.model.drive.name,
            status=status,
            gated_by=self._monitors.waits_for(axis.id),
            alarms=[alarm for (owner, _), alarm in self._alarms.items() if owner == axis.id],
            quantities={**known, **now},
            dropped={**self._dropped[axis.id], **self._monitors.dropped(axis.id)},
            clock=self._clock[axis.id],
            stamps=stamps,
            trends=self._monitors.trends.for_axis(axis.id),
            notes=[*(f"{axis.id}: {words}" for words in status.confounded), *doubts],
            course=self._courses.get(axis.id),
        )


# --- Times and reasons of a replay in words ---------------------------------------------------------------------------


def reached(trend: ParameterTrend) -> Iterator[str]:
    """When its limits are reached, counted from the end of the record."""
    now_us = trend.entries[-1].end_us if trend.entries else 0
    return (reach_words(reach, now_us) for reach in trend.reaches)


def trend_sentence(trend: ParameterTrend) -> str:
    """The trend of a parameter, and when its limits are reached."""
    return "; ".join([trend_words(trend.name, trend.unit, trend.trend), *reached(trend)])


REASONS: Mapping[str, str] = {
    "used": "learned from",
    "seeding": "taken to find P(0)",
    "settling": "while the predictor settled, after its start or after lost samples",
    "gated": "while operating conditions forbade it, or were not known",
    "outlier": "far from their prediction, passed over",
    "starved": "while there was nothing to learn: the axis hardly moved",
    "started": "the predictor started with them",
    "gap": "after a gap, or a clock that was set: the predictor restarted",
    "not_finite": "not finite",
    "not_increasing": "not after the sample before",
    "diverged": "at which the prediction left the finite numbers",
    "projected": "at which a bound held an estimate (these are among the others, too)",
    "absurd": "beyond physical limits",
    "repeated": "the same again within half an interval",
    "out_of_order": "not after the last sample",
    "untimed": "the counter or the fitted clock contradicts the time of receipt",
    "unpaired": "torque or motion without its partner",
    "late": "arrived after its partner had been dropped",
    "missing": "samples that never came",
    "ambiguous": "more than half a turn since the sample before: which way is not known",
    "unwanted": "no axis asks for them",
    "too_short": "shorter than their message",
    "undecodable": "contradict the DBC file",
    "signal_absent": "of a multiplexed message, without the signal that was wanted",
    "other_bus": "of a bus that the configuration does not have",
    "clock_reanchored": "the time line of the samples restarted",
    "clock_set_back": "the clock of the receiver was set back",
}
"""Of counters of samples, values, frames and clocks."""


class TimeUnit(NamedTuple):
    """In which times of a record are written."""

    name: str
    seconds: float

    def written(self, s: float | None) -> str:
        """A time to four digits at least, such as 5.21 s."""
        if s is None:
            return ""
        value = s / self.seconds
        return f"{value:.{2 if value < 1000 else 0}f} {self.name}"


def time_unit(length_s: float) -> TimeUnit:
    """That of a record of such a length."""
    for name, seconds, most in (("s", 1.0, 600.0), ("min", 60.0, 4 * 3600.0), ("h", 3600.0, 4 * 86400.0)):
        if length_s <= most:
            return TimeUnit(name, seconds)
    return TimeUnit("d", 86400.0)


def duration(s: float) -> str:
    """A time such as 10 s, 3 h or 4 d, to two digits."""
    for name, seconds, most in (("s", 1.0, 120.0), ("min", 60.0, 7200.0), ("h", 3600.0, 172800.0)):
        if abs(s) <= most:
            return f"{plain(abs(s) / seconds, 2)} {name}"
    return f"{plain(abs(s) / 86400, 2)} d"


def dated(t_us: int | None) -> str:
    """A time in UTC to a tenth of a second; empty where the times of the record have no date."""
    return "" if t_us is None or t_us < DATED_US else iso(t_us)[:21].replace("T", " ")
