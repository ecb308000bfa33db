"""Another payload, told from a fault of one drive: the axes of a robot that carry it show it at the same time."""

from collections.abc import Iterable

from monitor_core.detection.alarm import Alarm, Direction
from monitor_core.detection.cusum.cusum_evidence import TORQUE_CONSTANT
from monitor_core.detection.multimodel.candidates import INERTIA, TORQUE_SCALE
from monitor_core.drive import LOAD

PAYLOAD_WITHIN_S = 600.0
"""Within this time the axes that carry another payload detect it: it took them up to 214 s (docs/validation.md)."""


def payload_change(alarm: Alarm) -> Direction | None:
    """The change of the payload that an alarm may be: up for a heavier one; None: it is none, or has no cause yet."""
    if alarm.stage != "named" or alarm.doubt or alarm.kind == "forecast":
        return None
    if alarm.parameter in (LOAD, INERTIA):
        return alarm.direction
    if alarm.parameter not in (TORQUE_CONSTANT, TORQUE_SCALE):
        return None
    if not any(LOAD in (cause.parameter, *cause.alike) for cause in alarm.causes):
        return None
    # A heavier weight needs more torque, as a weaker motor does.
    return "down" if alarm.direction == "up" else "up"


def same_payload(alarm: Alarm, others: Iterable[tuple[str, Alarm]]) -> tuple[str, ...]:
    """The axes whose alarms the same change of the payload explains, which is likelier than a fault of each drive.

    Args:
        alarm: of an axis.
        others: alarms of the other axes of its robot, each with its axis.
    """
    change = payload_change(alarm)
    if change is None:
        return ()
    within_us = PAYLOAD_WITHIN_S * 1e6
    near = ((axis, other) for axis, other in others if abs(other.raised_us - alarm.raised_us) <= within_us)
    return tuple(sorted({axis for axis, other in near if payload_change(other) == change}))
