"""Results of a replay for each axis, collected while the records run."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm, AlarmKey, same_payload
from monitor_core.monitoring import AxisStatus, AxisTrace, NotTested
from monitor_core.samples import SampleBlock
from service.config import Config, NamedAxis
from service.ingest.records.record_files import FileRecord
from service.ingest.records.record_ranges import RecordRange
from service.ingest.samples.timestamp_jitter import NOT_KNOWN, Stamps, remarks
from service.pipeline.axes.axis_alarms import JournalQuantity, quantities
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.persistence.alarm_recording import as_recorded
from service.pipeline.snapshot import AxisSnapshot, Reception, make_axis_snapshot
from service.reports.formats import Provenance
from service.reports.replay_course import ReplayCourse
from service.reports.timeline import TimeUnit
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_table import RecordedAlarm

ARROWS = {"up": "\N{BLACK UP-POINTING TRIANGLE}", "down": "\N{BLACK DOWN-POINTING TRIANGLE}"}


class AlarmSpan(NamedTuple):
    """Position of an alarm on the time line of its axis, in a unit of time."""

    start: float
    """The onset, or the time of raising if the onset is not on the time line"""
    raised: float
    end: float
    """The end, or the last sample"""
    onset: Floats | None
    """The two ends of the interval in which the onset lies; None: not known"""
    arrow: str


class ReplayedAxis(NamedTuple):
    """The results of one axis."""

    snapshot: AxisSnapshot
    """State of the axis as the daemon would have published it"""
    alarms: Sequence[RecordedAlarm]
    """Alarms in the order in which they were raised"""
    notes: Sequence[str]
    """Remarks on what cannot be determined, and on the time stamps"""
    course: ReplayCourse | None
    """Course for the pictures; None: not to be drawn"""

    @property
    def untested(self) -> Mapping[NotTested, Sequence[str]]:
        """Parameters that were not tested for long enough to find a change, by reason."""
        return self.status.untested_so_far()

    @property
    def id(self) -> str:
        """Name of the axis as "robot.axis"."""
        return self.snapshot.id

    @property
    def status(self) -> AxisStatus:
        """The estimates at the end."""
        return self.snapshot.status

    def alarm_spans(self, names: Collection[str], unit: TimeUnit) -> Iterator[AlarmSpan]:
        """Positions of alarms with these causes, and of alarms without a parameter, such as a fault of a sensor."""
        if self.course is None:
            return
        line = self.course.timeline
        for alarm in self.alarms:
            raised, onset, end = (line.find(t) for t in (alarm.raised_us, alarm.onset_us, alarm.ended_us))
            if raised is None or (alarm.parameter not in names and alarm.parameter in self.course.h):
                continue
            start = raised if onset is None else onset
            end = max(1e-6 * line.end_us if end is None else end, start)
            ends = [t for t in map(line.find, (alarm.onset_low_us, alarm.onset_high_us)) if t is not None]
            onset_in = np.array(ends) / unit.seconds if len(ends) == 2 else None
            start, raised, end = start / unit.seconds, raised / unit.seconds, end / unit.seconds
            yield AlarmSpan(start, raised, end, onset_in, ARROWS[alarm.direction])


class Replayed(NamedTuple):
    """All axes, and the sources of the samples."""

    axes: Sequence[ReplayedAxis]
    frames_dropped: Mapping[str, Mapping[str, int]]
    records: Sequence[str]
    config: str
    provenance: Provenance

    @property
    def can_be_drawn(self) -> bool:
        """Whether any sample was used, of which the course was collected."""
        return any(axis.course is not None and axis.course.used for axis in self.axes)


class Replay:
    """Runs records through the monitors of the axes of a configuration, and collects the results.

    ``drawn``: also collect the course of each axis.
    """

    def __init__(self, monitors: AxisMonitors, config: Config, drawn: bool) -> None:
        self._monitors, self._config = monitors, config
        self._courses = {name: ReplayCourse(m) for name, m in monitors.by_id.items()} if drawn else {}
        self._alarms: dict[tuple[str, AlarmKey], Alarm] = {}
        self._dropped = {axis.id: Counter[str]() for axis in config.axes}
        self._clock = {axis.id: Counter[str]() for axis in config.axes}
        self._frames_dropped: dict[str, Counter[str]] = {}
        self._stamps: dict[str, Stamps] = {}
        self._quantities = quantities(monitors.by_id)

    def add(self, record: FileRecord | RecordRange, progress: Callable[[float], None]) -> None:
        """Run a record; the records before it have been run.

        Raises:
            RecordError: the record is damaged.
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
        """The results for these records with this configuration file."""
        axes = [self._axis(axis) for axis in self._config.axes]
        return Replayed(axes, self._frames_dropped, records, config, Provenance.now())

    def _axis(self, axis: NamedAxis) -> ReplayedAxis:
        monitored, stamps = self._monitors.axes[axis.id], self._stamps.get(axis.id, NOT_KNOWN)
        status = monitored.monitor.status()
        alarms = self._recorded(axis, status)
        received = Reception(self._dropped[axis.id], self._clock[axis.id], stamps)
        active = tuple(alarm for alarm in alarms if alarm.active)
        snapshot = make_axis_snapshot(monitored, self._monitors.trends, status, active, received)
        doubts = remarks(axis.config.sample_interval_s, stamps)
        outside = [
            f"at the end outside the conditions of the calibration: {words}" for words in snapshot.outside_calibration
        ]
        notes = [f"{axis.id}: {words}" for words in (*status.confounded, *outside, *doubts)]
        return ReplayedAxis(snapshot, alarms, notes, self._courses.get(axis.id))

    def _recorded(self, axis: NamedAxis, status: AxisStatus) -> list[RecordedAlarm]:
        """The alarms of an axis as in a journal, with unit and present nominal value of the parameter."""
        now = {(axis.id, p.name): JournalQuantity(p.unit, p.nominal) for p in status.parameters}
        known = {**self._quantities, **now}
        beside = {other.id for other in self._config.axes if other.robot == axis.robot} - {axis.id}
        others = [(owner, alarm) for (owner, _), alarm in self._alarms.items() if owner in beside]
        return [
            replace(
                as_recorded(AlarmEntry(axis.id, *known[axis.id, alarm.parameter], alarm), number),
                same_payload=same_payload(alarm, others),
            )
            for number, ((owner, _), alarm) in enumerate(self._alarms.items(), 1)
            if owner == axis.id
        ]
