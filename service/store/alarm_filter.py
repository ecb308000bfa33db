"""Conditions on alarms: in SQL for the journal, and for alarms that the journal does not have yet."""

from dataclasses import dataclass
from typing import Literal

from monitor_core.monitoring import AlarmState
from service.store.alarm_statistics import ACTIVE, CHATTERING, STALE, STALE_S
from service.store.alarm_table import ColumnValue, RecordedAlarm

StateFilter = AlarmState | Literal["active", "stale", "chattering"]
"""A state, or: active (the cause is present), stale (active for more than 24 hours), chattering (raised three times
within ten minutes)."""


@dataclass(frozen=True, slots=True)
class AlarmFilter:
    """Conditions that an alarm must all meet; None: no such condition."""

    axis: str | None = None
    parameter: str | None = None
    active: bool | None = None
    """True: only alarms that have not ended or are latched; False: only others"""
    state: StateFilter | None = None
    since_us: int | None = None
    """Only alarms raised at this time or later"""
    until_us: int | None = None
    """Only alarms raised before this time"""

    def where(self, now_us: int) -> tuple[str, list[ColumnValue]]:
        """The SQL clause for the alarm table, empty without conditions, and its values."""
        given: dict[str, ColumnValue] = {
            "axis = ?": self.axis,
            "parameter = ?": self.parameter,
            "raised_us >= ?": self.since_us,
            "raised_us < ?": self.until_us,
        }
        conditions = [] if self.active is None else [ACTIVE if self.active else f"NOT {ACTIVE}"]
        match self.state:
            case "active":
                conditions.append(ACTIVE)
            case "chattering":
                conditions.append(CHATTERING)
            case "stale":
                given[STALE] = now_us - round(STALE_S * 1e6)
            case _:
                given["state = ?"] = self.state
        given = {condition: value for condition, value in given.items() if value is not None}
        conditions = [*given, *conditions]
        return f"WHERE {' AND '.join(conditions)}" if conditions else "", [*given.values()]

    def matches(self, a: RecordedAlarm, now_us: int) -> bool:
        """Whether an alarm meets the conditions; of chattering alarms only the journal knows."""
        shown = a.active and not a.life.hidden
        special = {
            "active": a.active,
            "stale": shown and a.since_us <= now_us - STALE_S * 1e6,
            "chattering": False,
        }
        return (
            self.axis in (None, a.axis)
            and self.parameter in (None, a.parameter)
            and self.active in (None, a.active)
            and (self.state is None or special.get(self.state, a.state == self.state))
            and (self.since_us is None or a.raised_us >= self.since_us)
            and (self.until_us is None or a.raised_us < self.until_us)
        )


EVERY_ALARM = AlarmFilter()
