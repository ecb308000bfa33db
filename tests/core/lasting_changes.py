"""Lasting changes of an axis that the model does not match: the alarms of each, with the truth beside them.

The axis is one of tests/core/mismatch.py, warm.  Its nominal values, noise and thresholds (one false alarm in 30 days)
are those that ``identify`` and ``calibrate`` found in a minute of excitation and ten minutes of operation.  The memory
is 1 s: the estimates scatter by a third of a change of 30 %.
"""

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from monitor_core.modeling.standard_drives import three_mass
from monitor_core.monitoring import AlarmChange, AxisMonitor, MonitoringOptions, recommended_settings
from monitor_core.samples import SampleBlock
from monitor_core.settings import Threshold
from tests.core.mismatch import INTERVAL_S, MismatchPlant, R, Truth, redrawn, true_size

PARAMETERS = ("kT", "fc", "fm")
CHANGES = (("kT", 1.2), ("kT", 0.8), ("fc", 1.3), ("fm", 1.5), ("fm", 1.3), ("fm", 0.5))
PLANT = (77, 0)
"""Seed of the values of the plant."""
FOUND = {
    "Jm": 0.01618442143,
    "Jg": 114.9144137,
    "Ja": 117.4996757,
    "kg": 328026.262,
    "ka": 142332.5207,
    "dg": 785.5314056,
    "da": 327.8540052,
    "fm": 0.03328434991,
    "fc": 0.8769195251,
    "tau0": 0.002376453775,
    "kT": 0.9922873626,
    "r": R,
}
GAIN = (0.008245884198, 0.000154599567, 328.3385916, 0.09974945282, 0.0006137554542, 0.991400076)
OPTIONS = MonitoringOptions(
    torque_noise=0.2605326108,
    output_noise=2.201614472e-05,
    gain=GAIN,
    innovation_variance=1.497261826e-06,
    memory_s=1.0,
)
THRESHOLDS = (
    Threshold(0.72488803, 145.4079147, 0.0, 0.002675215966),
    Threshold(0.6177889145, 420.7125322, 0.0, 0.008442696656),
    Threshold(0.6862637052, 471.0164013, 0.0, 0.01250358503),
)
SPEED_SCALE = 1.0
"""Of the model's Coulomb friction, rad/s; that of the plant is SLIDING_SPEED."""
WARM_S, HEALTHY_S, BLOCK_S = 60.0, 120.0, 5.0
"""It is warm after seconds, which an axis takes an hour for."""


@dataclass
class Course:
    """All that became of the alarms of one change, which began at ``begin_us`` and was repaired at ``repaired_us``."""

    parameter: str
    size: float
    """In the unit of the parameter"""
    begin_us: int
    repaired_us: int
    changes: list[AlarmChange] = field(default_factory=list)

    @property
    def alarms(self) -> list[Alarm]:
        """The last form of each alarm that was raised before the repair."""
        latest = {change.alarm.key: change.alarm for change in self.changes}
        return [alarm for alarm in latest.values() if alarm.raised_us <= self.repaired_us]

    @property
    def sized(self) -> Alarm | None:
        """Its alarm in the middle of the time between the name and the repair."""
        forms = [c.alarm for c in self.changes if c.alarm.parameter == self.parameter and c.alarm.ended_us is None]
        known = [a for a in forms if a.size is not None]
        return known[len(known) // 2] if known else None


def truth() -> Truth:
    return redrawn(np.random.default_rng(PLANT))


def monitor() -> AxisMonitor:
    model = AxisModel(three_mass("angle"), FOUND, PARAMETERS)
    return AxisMonitor(model, replace(recommended_settings(model, INTERVAL_S, OPTIONS), thresholds=THRESHOLDS))


def courses(
    seed: int, lasting_s: float, repaired_s: float, changes: Sequence[tuple[str, float]] = CHANGES
) -> Iterator[Course]:
    """Each of the changes, lasting for so long, from the same healthy minutes; then repaired for so long."""
    values = truth()
    for name, factor in changes:
        axis, watched = after_healthy_minutes(seed)
        begin_us = (watched.status().time_us or 0) + round(INTERVAL_S * 1e6)
        size = true_size(values, name, factor, FOUND["kT"], SPEED_SCALE)
        course = Course(name, size, begin_us, begin_us + round(lasting_s * 1e6))
        course.changes += _update(watched, axis, lasting_s, {name: factor})
        yield replace(course, changes=course.changes + _update(watched, axis, repaired_s))


def chattering(seed: int) -> list[AlarmChange]:
    """All that is reported of a change of kT by a fifth that comes and goes six times, and is then repaired."""
    changes = []
    axis, watched = after_healthy_minutes(seed)
    for _ in range(6):
        changes += _update(watched, axis, 20.0, {"kT": 1.2})
        changes += _update(watched, axis, 10.0)
    return changes + _update(watched, axis, 60.0)


def after_healthy_minutes(seed: int) -> tuple[MismatchPlant, AxisMonitor]:
    """A copy of the axis and its monitor."""
    plant, healthy = _healthy_minutes(seed)
    watched = monitor()
    watched.from_arrays(healthy.to_arrays())
    return copy.deepcopy(plant), watched


@lru_cache(1)
def _healthy_minutes(seed: int) -> tuple[MismatchPlant, AxisMonitor]:
    at_once = replace(truth(), warming_s=1.0)
    plant, healthy = MismatchPlant(at_once, np.random.default_rng(seed)), monitor()
    plant.take(WARM_S)
    assert not _update(healthy, plant, HEALTHY_S), "a false alarm"
    return plant, healthy


def _update(
    watched: AxisMonitor, axis: MismatchPlant, seconds: float, fault: dict[str, float] | None = None
) -> list[AlarmChange]:
    changes = []
    for _ in range(round(seconds / BLOCK_S)):
        t_us, u, y, _ = axis.take(BLOCK_S, fault)
        changes += watched.update(SampleBlock(t_us, u, y))
    return changes
