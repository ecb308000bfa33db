"""Audit trail: who has changed what and when, for alarms, axes and epochs."""

import sqlite3
from typing import Literal, NamedTuple

from service.store.alarm_transitions import CONFIGURATION, SERVICE

Subject = Literal["alarm", "epoch", "service"]
"""service: an axis is taken out of service, or returned to service"""


class AuditEntry(NamedTuple):
    """A change.  ``(at_us, subject, id)`` is its place in the order of all changes."""

    at_us: int
    subject: Subject
    id: int
    who: str
    event: str
    axis: str
    number: int
    """Number of the alarm, or of the epoch of the axis; otherwise 0"""
    parameter: str
    """Parameter of the alarm; otherwise empty"""
    comment: str
    work_order: str


Place = tuple[int, str, int]
_QUERY = f"""
    SELECT {", ".join(AuditEntry._fields)} FROM (
        SELECT t.at_us, 'alarm' AS subject, t.id, t.who, t.event, a.axis, t.alarm_id AS number, a.parameter,
            t.comment, t.work_order
        FROM alarm_transition t JOIN alarm a ON a.id = t.alarm_id
        WHERE t.who NOT IN ('{SERVICE}', '{CONFIGURATION}')
        UNION ALL
        SELECT at_us, 'epoch', id, who, event, axis, number, '', comment, work_order
        FROM epoch_event WHERE who <> '{SERVICE}'
        UNION ALL
        SELECT at_us, 'service', id, who, event, axis, 0, '', comment, work_order FROM axis_service)
    WHERE (at_us, subject, id) < (?, ?, ?) ORDER BY at_us DESC, subject DESC, id DESC LIMIT ?
"""
_LATEST: Place = (2**63 - 1, "", 0)


def audited(connection: sqlite3.Connection, limit: int, after: Place | None) -> list[AuditEntry]:
    """The latest changes, newest first; ``after``: only changes older than this place.

    Changes that the daemon makes on its own are left out, and so is the hiding of alarms by configured rules.
    """
    return [AuditEntry(*row) for row in connection.execute(_QUERY, [*(after or _LATEST), limit])]
