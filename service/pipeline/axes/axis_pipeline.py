"""One axis: its monitor, and the steps that its samples pass before the monitor."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from monitor_core.drive import AxisModel, Operating, friction_of
from monitor_core.modeling import FlatComponent
from monitor_core.monitoring import (
    NEVER,
    AxisMonitor,
    CalibratedRange,
    ConditionRange,
    ConditionTracker,
    PoseMap,
    UnrecordedHeat,
    WarmUp,
)
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.trend import EstimateReading
from monitor_core.wording import Sentence, joined, sentence
from service.config import NamedAxis, conditions_of
from service.config.drive_sources import model_of_axis
from service.ingest.samples.unwrap import AMBIGUOUS, MotionPoint, turns_of
from service.pipeline.axes.epoch_progress import EpochProgress


class Heat(NamedTuple):
    """Warm-up state of an axis: the friction power that would hold its temperature, and the standard deviation [W]."""

    heat_w: float
    sd_w: float
    known: bool
    """Whether it is known well enough to test the friction"""
    ambient_w: float = 0.0
    """The part of it due to a hall that is colder or warmer than in the records"""


@dataclass(frozen=True, slots=True)
class MonitoredDrive:
    """Model and settings with which an axis is monitored; they change only with the configuration and the epoch."""

    model: AxisModel
    settings: Settings
    components: tuple[FlatComponent, ...]
    """Components of the drive as drawn"""


class AxisPipeline:
    """An axis, from its received samples to the samples that its monitor takes."""

    def __init__(self, axis: NamedAxis, monitor: AxisMonitor) -> None:
        self.config, self.monitor, model = axis, monitor, monitor.model
        self.nominal = {p.name: (model.nominal[p.name], p.unit) for p in model.drive.parameters}
        """All nominal values of the model and their units, by name"""
        self.watched = MonitoredDrive(model, monitor.settings, model_of_axis(axis.config).components)
        """The drive as it is monitored"""
        self.causes = tuple(dict.fromkeys((*(p.name for p in model.parameters), *monitor.causes)))
        """Every cause that an alarm may name: the monitored parameters, then others"""
        self.epoch = EpochProgress(axis.epoch, axis.configured)
        """The epoch in force, and a learning or verification that is under way"""
        conditions, thresholds = conditions_of(axis), axis.config.model.thresholds_file
        operating = Operating(model, conditions)
        self.operating = operating if operating.needed else None
        """Its operating conditions; None: it has none"""
        thermal = None if self.operating is None else self.operating.thermal
        self._warm_up = None if self.operating is None or thermal is None else WarmUp(self.operating, monitor)
        self._outside = axis.config.detector.outside_calibration
        self._beyond_heat = any(math.isinf(schedule.margin) for schedule in conditions.schedules)
        friction = {name for names in friction_of(model.drive) for name in names}
        known = thermal is not None or any(schedule.name in friction for schedule in conditions.schedules)
        self.unrecorded_heat = None if known else UnrecordedHeat(monitor, self._outside == "wait")
        """The starts of its motion; None: a thermal law or a signal says what friction to expect"""
        self._calibrated: CalibratedRange | None = None
        if thresholds is not None and thresholds.range:
            there = [m for m in thresholds.poses if {*m.angles} <= {*conditions.columns}]
            poses = [PoseMap.from_hex(m.angles, m.known) for m in there]
            tracker = ConditionTracker(axis.config.output, monitor.settings, conditions.columns, poses)
            ranges = tuple(ConditionRange(r.condition, r.low, r.high) for r in thresholds.range)
            self._calibrated = CalibratedRange(ranges, tracker)
        self._turns = turns_of(axis.config)
        self._resumed = False

    def unwrapped(self, block: SampleBlock) -> SampleBlock:
        """The samples with a continuous angle, if the measured angle wraps after each turn."""
        if self._turns is None:
            return block
        if not self._resumed:  # at the first samples, a saved state has already been restored
            self._resumed = True
            if (motion := _motion(self.monitor)) is not None:
                self._turns.resume(motion)
        return self._turns.unwrapped(block)

    def part(self, block: SampleBlock) -> tuple[SampleBlock, SampleBlock | None]:
        """Prepare the first samples for the monitor; returns them, and the rest of the block or None.

        They get the nominal values and the gate that their operating conditions require.  With a thermal model the
        monitor must take them before the next part is prepared.
        """
        more: SampleBlock | None = None
        if self.unrecorded_heat is not None:
            block, more = self.unrecorded_heat.part(block)
        if self._warm_up is not None:
            block, more = self._warm_up.part(block)
        elif self.operating is not None:
            block = self.operating.conditioned(block)
        if self._calibrated is not None:
            inside = self._calibrated.take(block)
            block = block._replace(inside=inside.conditions)
            gate = inside.conditions if self._outside == "wait" else inside.poses
            if gate is not None:
                block = block._replace(gate=gate if block.gate is None else block.gate & gate)
        return block, more

    def for_trend(self, readings: Iterable[EstimateReading]) -> Iterable[EstimateReading]:
        """Readings for the long-term trend, in which no hall hides slow wear."""
        return readings if self._warm_up is None else self._warm_up.for_trend(readings)

    @property
    def dropped(self) -> Mapping[str, int]:
        """Number of samples refused before they reached the monitor, by reason."""
        return {} if self._turns is None else {AMBIGUOUS: self._turns.refused}

    @property
    def heat(self) -> Heat | None:
        """The warm-up state; None: the axis has no thermal model."""
        thermal = None if self.operating is None else self.operating.thermal
        return None if thermal is None else Heat(thermal.heat, thermal.sd, thermal.known, thermal.ambient)

    @property
    def outside_calibration(self) -> tuple[str, ...]:
        """Conditions of the last sample that are outside the range of the calibration, in words."""
        outside = () if self._calibrated is None else self._calibrated.outside
        if self._beyond_heat and self._warm_up is not None and self._warm_up.widened:
            wider = sentence("wider", "{why}: tested with a wider allowance", why=self._warm_up.widened)
            return (*outside, wider)
        return outside

    @property
    def gated_by(self) -> str:
        """The operating condition that kept the last sample from being used; empty: it was used."""
        reason = "" if self.operating is None else self.operating.reason
        if self._calibrated is None:
            return reason
        wait = self._outside == "wait"
        return lasting_gate(reason, joined(self.outside_calibration) if wait else self._calibrated.new_poses)


def lasting_gate(reason: str, outside: str) -> str:
    """What keeps the samples from being used: ``reason`` that held for the last one, or that it was ``outside``.

    An axis stands again and again, in new poses, too: these would keep the next samples from being used.
    """
    stands = isinstance(reason, Sentence) and reason.kind == "slow"
    return (outside or reason) if stands else (reason or outside)


def _motion(monitor: AxisMonitor) -> MotionPoint | None:
    """Predicted motion of an axis at its last sample; None: there was no sample."""
    state, lane = monitor.batch.state, monitor.lane
    if state.t[lane] == NEVER:
        return None
    A, _, C = monitor.model.matrices()
    angle, speed = float(C[0] @ state.x[:, lane]), float((C @ A)[0] @ state.x[:, lane])
    return MotionPoint(int(state.t[lane]), angle, speed * 1e-6)
