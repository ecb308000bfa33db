"""Times at the interfaces: microseconds since 1970 internally, ISO 8601 in UTC externally."""

import time
from datetime import UTC, datetime, timedelta

DATED_US = 10**15
"""Times before this one are from a record without dates."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


def now_us() -> int:
    """The present time, microseconds since 1970."""
    return time.time_ns() // 1000


def iso(t_us: int) -> str:
    """ISO 8601 with microseconds and Z, e.g. 2026-03-01T12:00:00.000000Z."""
    return (_EPOCH + t_us * _MICROSECOND).isoformat(timespec="microseconds").replace("+00:00", "Z")


def microseconds(moment: datetime | None) -> int | None:
    """Microseconds since 1970 of a datetime with a time zone."""
    return None if moment is None else (moment - _EPOCH) // _MICROSECOND
