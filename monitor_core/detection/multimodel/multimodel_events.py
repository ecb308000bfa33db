"""Events of the multi-model detector: change detected, cause identified, cause ended.  Times in us since 1970.

``since_us`` is the time of the ``ChangeDetected`` that an event belongs to.
"""

from dataclasses import dataclass

from monitor_core.detection.multimodel.naming import Share


@dataclass(frozen=True, slots=True)
class Onset:
    """Onset of a change: its most likely time, and an interval of 90 % probability, us."""

    time_us: int
    earliest_us: int
    latest_us: int


@dataclass(frozen=True, slots=True)
class ChangeDetected:
    """A change was detected; its cause is not known yet."""

    time_us: int
    onset: Onset
    shares: tuple[Share, ...]


@dataclass(frozen=True, slots=True)
class CauseIdentified:
    """The cause is the first of ``shares``, with the total size of the active fault of that cause.

    ``certain``: its share is large enough; otherwise the others must be reported, too.
    """

    time_us: int
    since_us: int
    onset: Onset
    shares: tuple[Share, ...]
    certain: bool


@dataclass(frozen=True, slots=True)
class CauseEnded:
    """A named cause has ended; HEALTHY: the change did not last."""

    time_us: int
    since_us: int
    cause: str


Event = ChangeDetected | CauseIdentified | CauseEnded
