"""What the monitors report of an axis."""

from typing import NamedTuple

from monitor_core.detection.alarm import Alarm


class Change(NamedTuple):
    """An episode of an axis as it is now: raised, updated or ended."""

    axis_id: str
    alarm: Alarm
