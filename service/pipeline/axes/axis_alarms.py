"""Alarms of axes, with the units, nominal values and rules that the journal needs beside them."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from monitor_core.detection import Alarm, AlarmKey
from monitor_core.monitoring import AlarmRules, AxisMonitor
from service.config import NamedAxis


class AxisAlarm(NamedTuple):
    """An alarm of an axis that was raised, changed or ended, in its present form."""

    axis_id: str
    alarm: Alarm

    @property
    def key(self) -> tuple[str, AlarmKey]:
        """Identity of the alarm; it does not change with the alarm's state."""
        return self.axis_id, self.alarm.key


class JournalQuantity(NamedTuple):
    """Unit and nominal value of a cause, for the journal."""

    unit: str
    nominal: float


def quantities(monitors: Mapping[str, AxisMonitor]) -> dict[tuple[str, str], JournalQuantity]:
    """Units and nominal values of all causes that an alarm may name."""
    known = {
        (axis_id, p.name): JournalQuantity(p.unit, float(nominal))
        for axis_id, monitor in monitors.items()
        for p, nominal in zip(monitor.model.parameters, monitor.model.theta0, strict=True)
    }
    for axis_id, monitor in monitors.items():
        if monitor.multimodel is not None:
            for cause in monitor.multimodel.causes:
                nominal, unit, _ = monitor.multimodel.quantity(cause)
                known.setdefault((axis_id, cause), JournalQuantity(unit, nominal))
    return known


def alarm_groups(axes: Iterable[NamedAxis]) -> dict[str, str]:
    """The group of each axis.  In a group, the alarm that was raised first is marked as the first."""
    return {axis.id: axis.config.alarms.group or axis.robot for axis in axes}


def alarm_rules(axes: Iterable[NamedAxis], causes: Iterable[tuple[str, str]]) -> dict[tuple[str, str], AlarmRules]:
    """The configured alarm rules by axis and cause."""
    configured = {axis.id: axis.config for axis in axes}
    return {(i, cause): configured[i].alarms.rules(cause, configured[i].memory_s) for i, cause in causes}
