"""The monitor of a plant that is not what its model says: what it raises, and how it names what breaks."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.operating_conditions import Conditions, Operating
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.alarm_versions import alarm_versions
from tests.core.mismatch_plant import INTERVAL_S, Block, MismatchPlant

FAULTS: Mapping[str, tuple[float, float]] = {"kT": (1.2, 60.0), "fc": (1.3, 60.0), "fm": (1.5, 300.0)}
"""Factor, and seconds of motion within which it is to be named."""
MOVING = 0.5
"""rad/s, a hundredth of the largest speed: slower, the axis stands."""


class FaultAlarm(NamedTuple):
    """An alarm, with seconds from the beginning of what was watched; ``named_s`` is infinite before it is named."""

    parameter: str
    direction: str
    raised_s: float
    named_s: float
    size: float
    """In sizes of the parameter"""
    first: str


@dataclass
class Watch:
    """The monitor of an axis as configured; it can be copied."""

    model: AxisModel
    settings: Settings
    conditions: Conditions
    monitor: AxisMonitor = field(init=False)

    def __post_init__(self) -> None:
        self.monitor = AxisMonitor(self.model, self.settings)

    def copy(self) -> Watch:
        other = Watch(self.model, self.settings, self.conditions)
        other.monitor.from_arrays(self.monitor.to_arrays())
        return other

    def take(self, block: Block) -> tuple[list[Alarm], Floats]:
        """What it raises or changes; and how far theta is off, in sizes (N, p)."""
        temperature = block.temperature[:, np.newaxis]
        shift, gate = Operating(self.model, self.conditions).take(block.t_us, block.y, temperature)
        episodes, trace = alarm_versions(self.monitor, SampleBlock(block.t_us, block.u, block.y, shift, gate))
        return episodes, (trace.theta - self.model.theta0 - shift) / self.model.scale


def after_fault(
    plant: MismatchPlant, watch: Watch, fault: Mapping[str, float], seconds: float
) -> FaultAlarm | None:
    """What the first named alarm says when the plant breaks now; None: there is none in so many seconds of motion.

    Plant and monitor stay as they are.
    """
    plant, watch, start_us = copy.deepcopy(plant), watch.copy(), 0
    moved_s, taken_s = 0.0, 0.0
    while moved_s < seconds:
        block = plant.take(1.0, fault)
        start_us = start_us or int(block.t_us[0])
        taken_s += 1.0
        for e in watch.take(block)[0]:
            if e.stage == "named":
                return alarm_of(e, watch.model, start_us, taken_s)
        moved_s += float(np.mean(np.abs(np.diff(block.y)) > MOVING * INTERVAL_S))
    return None


def alarm_of(e: Alarm, model: AxisModel, start_us: int, named_s: float) -> FaultAlarm:
    size = e.size / float(model.scale[model.monitored.index(e.parameter)])
    return FaultAlarm(e.parameter, e.direction, (e.raised_us - start_us) * 1e-6, named_s, size, e.first[0])


def right(name: str, alarm: FaultAlarm | None) -> bool:
    """Whether it names an increase of that parameter."""
    return alarm is not None and (alarm.parameter, alarm.direction) == (name, "up")
