"""Is the daemon alive, is it doing its work, and if not, why."""

from collections.abc import Iterator

from service.pipeline.snapshot import AxisSnapshot, BusSnapshot, Snapshot
from service.web.app_state import age_s, sample_age_s

OLDEST_SNAPSHOT_S = 10.0
"""The worker swaps in a snapshot about every second, with or without samples; an older one means it hangs."""

OLDEST_SAMPLE_S = 5.0
OLDEST_SAMPLE_INTERVALS = 10
"""An axis whose last sample is older than both is not being monitored."""


def is_alive(snapshot: Snapshot, now_us: int) -> bool:
    """Whether the worker still reports."""
    return age_s(snapshot.taken_us, now_us) <= OLDEST_SNAPSHOT_S


def reasons_not_ready(snapshot: Snapshot, now_us: int) -> list[str]:
    """Why the axes are not all being monitored now; empty when they are."""
    return list(_reasons(snapshot, now_us))


def _reasons(snapshot: Snapshot, now_us: int) -> Iterator[str]:
    if not is_alive(snapshot, now_us):
        yield f"the worker has not reported for {age_s(snapshot.taken_us, now_us):.0f} s"
    yield from (_of_bus(bus) for bus in snapshot.buses if not bus.up)
    for axis in snapshot.axes:
        reason = _of_axis(axis, now_us)
        if reason:
            yield reason


def _of_bus(bus: BusSnapshot) -> str:
    return f"bus {bus.name}: {bus.state}"


def _of_axis(axis: AxisSnapshot, now_us: int) -> str | None:
    age = sample_age_s(axis, now_us)
    if age is None:
        return f"{axis.id}: no sample yet"
    oldest_s = max(OLDEST_SAMPLE_S, OLDEST_SAMPLE_INTERVALS * axis.interval_s)
    return f"{axis.id}: no sample for {age:.0f} s" if age > oldest_s else None
