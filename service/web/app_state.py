"""The part of the daemon that the web reads: the newest snapshot, the journal and a clock."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version

from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.store.journal import Journal
from service.texts.timestamps import now_us

VERSION = version("axiswatch")


@dataclass(frozen=True, slots=True)
class AppState:
    """``snapshot`` returns the newest snapshot; it must be cheap and may be called from any thread."""

    snapshot: Callable[[], Snapshot]
    journal: Journal
    now_us: Callable[[], int] = now_us


def age_s(t_us: int, now_us: int) -> float:
    """Time since ``t_us`` [s]; 0 if ``t_us`` comes from a clock that is ahead of this one."""
    return max(0, now_us - t_us) / 1e6


def sample_age_s(axis: AxisSnapshot, now_us: int) -> float | None:
    """Age of the last sample of an axis [s]; None before the first sample."""
    return None if axis.status.time_us is None else age_s(axis.status.time_us, now_us)
