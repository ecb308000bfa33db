"""What a multi-model detector has to say: something has changed; it is this; it is over.  Times in us since 1970.

``since_us`` is the time of the ``ChangeDetected`` that an event belongs to.
"""

from dataclasses import dataclass

from monitor_core.detection.multimodel.naming import Share


@dataclass(frozen=True, slots=True)
class Onset:
    """When a change began: its likeliest time, and an interval that holds it in 90 of 100, us."""

    time_us: int
    earliest_us: int
    latest_us: int


@dataclass(frozen=True, slots=True)
class ChangeDetected:
    """Something has changed; what, is not said yet."""

    time_us: int
    onset: Onset
    shares: tuple[Share, ...]


@dataclass(frozen=True, slots=True)
class CauseIdentified:
    """It is this: the first of ``shares``, with the whole size of what stands of that cause now.

    ``certain``: its share is large enough; else the others are to be told, too.
    """

    time_us: int
    since_us: int
    onset: Onset
    shares: tuple[Share, ...]
    certain: bool


@dataclass(frozen=True, slots=True)
class CauseEnded:
    """A cause that was named is over; HEALTHY: what changed was nothing that lasted."""

    time_us: int
    since_us: int
    cause: str


Event = ChangeDetected | CauseIdentified | CauseEnded
