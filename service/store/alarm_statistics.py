"""Alarm load of an operator, by EEMUA 191 and ISA-18.2: rates, stale, chattering and first-out alarms."""

import sqlite3
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from monitor_core.monitoring import ACTIVE_STATES, HIDDEN_STATES, AlarmState, Priority

STALE_S = 86400.0
"""An alarm that has been active and not hidden for longer is stale (ISA-18.2: 24 hours)."""
CHATTERING_TIMES = 3
CHATTERING_S = 600.0
"""An alarm that is raised this often within this time chatters.  ISA-18.2 suggests three times in one minute.  Here an
alarm ends only after three memory lengths without a crossing, so three alarms hardly fit into a minute."""
RATE_S = 600.0
"""EEMUA 191 counts alarms in ten minutes: a mean of one is acceptable, more than ten are a flood."""
FLOOD = 10
MOST_FREQUENT = 10

FIRST_OUT_S = 600.0
"""Alarms of a group of axes belong together if each is raised within this time after another: an axis that seldom moves
detects late what another axis has detected at once."""

_ACTIVE_NAMES, _HIDDEN_NAMES = (
    f"({', '.join(repr(str(state)) for state in states)})" for states in (ACTIVE_STATES, HIDDEN_STATES)
)
ACTIVE = f"coalesce(returns_to, state) IN {_ACTIVE_NAMES}"
"""SQL condition: the cause is present, or the alarm is latched"""
_SHOWN = f"state IN {_ACTIVE_NAMES}"
STALE = f"{_SHOWN} AND coalesce(reopened_us, raised_us) <= ?"
"""SQL condition; its value is the time before which the alarm was raised"""
CHATTERING = f"""id IN (SELECT alarm_id FROM (
    SELECT t.alarm_id, t.at_us - lag(t.at_us, {CHATTERING_TIMES - 1}) OVER (
        PARTITION BY axis, parameter, direction ORDER BY t.at_us) AS span_us
    FROM alarm_transition t JOIN alarm a ON a.id = t.alarm_id WHERE t.event = 'raise'
) WHERE span_us <= {round(CHATTERING_S * 1e6)})"""
"""SQL condition: the alarm is the third with its name within ten minutes"""

GROUP = "axis_group"
"""SQL function: the group of an axis, by default its robot"""
_SAME_GROUP = f"{GROUP}(other.axis) = {GROUP}(alarm.axis)"
_WITHIN_US = round(FIRST_OUT_S * 1e6)
FOLLOWS = f"""CASE WHEN alarm.{_SHOWN} THEN (
    SELECT other.id FROM alarm other
    WHERE other.raised_us BETWEEN alarm.raised_us - {_WITHIN_US} AND alarm.raised_us AND {_SAME_GROUP}
    AND (other.raised_us, other.id) < (alarm.raised_us, alarm.id)
    AND coalesce(other.ended_us, alarm.raised_us) >= alarm.raised_us
    AND other.state NOT IN {_HIDDEN_NAMES}
    ORDER BY other.raised_us, other.id LIMIT 1
) END"""
"""SQL column: for an active alarm that is not hidden, the first alarm of its group that was open when it was raised.

The order is that of raising, as on an annunciator: onsets are estimates, and their intervals overlap in a cascade."""
FOLLOWED = f"""alarm.{_SHOWN} AND EXISTS (
    SELECT 1 FROM alarm other
    WHERE other.raised_us BETWEEN alarm.raised_us AND alarm.raised_us + {_WITHIN_US}
    AND other.axis <> alarm.axis AND other.{_SHOWN} AND {_SAME_GROUP}
    AND (other.raised_us, other.id) > (alarm.raised_us, alarm.id)
)"""
"""SQL column: whether another axis of the group has an alarm that was raised soon after this one"""


class Frequency(NamedTuple):
    """How often alarms with the same axis, parameter and direction were raised."""

    axis: str
    parameter: str
    direction: str
    alarms: int


class StateCount(NamedTuple):
    """Number of alarms in a state other than normal."""

    state: AlarmState
    priority: Priority
    alarms: int


class AlarmStatistics(NamedTuple):
    """Alarms raised in a period.  A shelved or suppressed alarm counts as raised, but not as announced."""

    since_us: int
    until_us: int
    raised: int
    announced: int
    mean_per_ten_minutes: float
    most_in_ten_minutes: int
    most_at_us: int | None
    """Start of the ten minutes with the most alarms"""
    flood_share: float
    """Share of the ten-minute intervals with more than ten alarms"""
    most_frequent: tuple[Frequency, ...]
    states: tuple[StateCount, ...]
    """Present number of alarms by state"""


def statistics(connection: sqlite3.Connection, since_us: int, until_us: int) -> AlarmStatistics:
    """Alarms raised at or after ``since_us`` and before ``until_us``."""
    rows = connection.execute(
        "SELECT t.at_us, t.to_state, axis, parameter, direction FROM alarm_transition t"
        " JOIN alarm a ON a.id = t.alarm_id WHERE t.event = 'raise' AND t.at_us >= ? AND t.at_us < ?",
        [since_us, until_us],
    ).fetchall()
    announced = [at_us for at_us, state, *_ in rows if state == AlarmState.UNACKNOWLEDGED]
    width_us = round(RATE_S * 1e6)
    bins = Counter((at_us - since_us) // width_us for at_us in announced)
    fullest, most = min(bins.items(), key=lambda found: (-found[1], found[0]), default=(None, 0))
    number = max(1.0, (until_us - since_us) / width_us)
    return AlarmStatistics(
        since_us,
        until_us,
        raised=len(rows),
        announced=len(announced),
        mean_per_ten_minutes=len(announced) / number,
        most_in_ten_minutes=most,
        most_at_us=None if fullest is None else since_us + fullest * width_us,
        flood_share=sum(count > FLOOD for count in bins.values()) / number,
        most_frequent=_most_frequent(tuple(name) for _, _, *name in rows),
        states=tuple(state_counts(connection)),
    )


def _most_frequent(names: Iterable[tuple[str, ...]]) -> tuple[Frequency, ...]:
    counts = sorted(Counter(names).items(), key=lambda found: (-found[1], found[0]))[:MOST_FREQUENT]
    return tuple(Frequency(axis, parameter, direction, count) for (axis, parameter, direction), count in counts)


def state_counts(connection: sqlite3.Connection) -> list[StateCount]:
    """Number of alarms by state and priority, without normal alarms."""
    query = "SELECT state, priority, count(*) FROM alarm WHERE state <> 'normal' GROUP BY state, priority"
    return [StateCount(AlarmState(state), priority, n) for state, priority, n in connection.execute(query)]
