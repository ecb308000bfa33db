"""What the web sees of the daemon: the newest snapshot, the journal and a clock, all read only."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version

from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.store.journal import Journal
from service.web.times import now_us

VERSION = version("axiswatch")


@dataclass(frozen=True, slots=True)
class World:
    """``snapshot`` gives the newest snapshot; it must be cheap and may be called from any thread."""

    snapshot: Callable[[], Snapshot]
    journal: Journal
    now_us: Callable[[], int] = now_us


def age_s(t_us: int, now_us: int) -> float:
    """Time since ``t_us`` in seconds; a clock that is ahead of this one gives 0."""
    return max(0, now_us - t_us) / 1e6


def sample_age_s(axis: AxisSnapshot, now_us: int) -> float | None:
    """Age of the last sample of an axis in seconds, None before the first."""
    return None if axis.facts.time_us is None else age_s(axis.facts.time_us, now_us)
