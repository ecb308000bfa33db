"""The life of an alarm, from its events."""

from collections.abc import Iterable
from functools import reduce

from monitor_core.monitoring import AlarmEvent, AlarmLife, transition


def replayed(events: Iterable[tuple[AlarmEvent, int | None]]) -> AlarmLife:
    """The state after these events and ends of shelves, from the beginning."""
    return reduce(lambda life, event: transition(life, *event).after, events, AlarmLife())
