"""What a replay found, as its report needs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisStatus, ParameterTrend
from service.pipeline.alarms import Quantity
from service.reports.course import Course


class ReplayedAxis(NamedTuple):
    """One axis after its records."""

    id: str
    drive: str
    status: AxisStatus
    course: Course
    alarms: Sequence[Alarm]
    quantities: Mapping[str, Quantity]
    """Unit and nominal value of whatever its alarms name"""
    dropped: Mapping[str, int]
    """What never reached the monitor, by reason"""
    clock: Mapping[str, int]
    """How often its time line began anew, by cause"""
    trends: Sequence[ParameterTrend]
    """Slow courses, of parameters of which enough is known"""
    notes: Sequence[str]
    """What cannot be told, and what its time stamps say, in words"""


class Replayed(NamedTuple):
    """All axes, and where the samples come from."""

    axes: Sequence[ReplayedAxis]
    frames_dropped: Mapping[str, Mapping[str, int]]
    records: Sequence[str]
    config: str
    command: str
    version: str
    date: str
