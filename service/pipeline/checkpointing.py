"""Checkpoints of all monitors, at an interval and at the end."""

from collections.abc import Callable, Iterator, Mapping
from time import monotonic

import structlog

from monitor_core.monitoring import AxisMonitor
from service.pipeline.trends import Trends
from service.store.checkpoints import AxisState, Checkpoints
from service.store.database import StoreError

log = structlog.get_logger(__name__)


def multimodel_id(axis_id: str) -> str:
    """Name under which the state of the multi-model detector of an axis is saved."""
    return f"{axis_id} (multi-model detector)"


class Checkpointer:
    """Saves all monitors together, so that the saved states belong to one time.

    Args:
        checkpoints: the store.
        monitors: by axis.
        interval_s: time between two checkpoints [s].
        saved_us: time of the checkpoint that the monitors were restored from.
        now_us: wall clock.
        clock: seconds, for the interval.
        trends: the slow histories, saved with them.
    """

    def __init__(
        self,
        checkpoints: Checkpoints,
        monitors: Mapping[str, AxisMonitor],
        interval_s: float,
        saved_us: int | None,
        now_us: Callable[[], int],
        clock: Callable[[], float] = monotonic,
        trends: Trends | None = None,
    ) -> None:
        self._checkpoints, self._monitors, self._interval_s = checkpoints, monitors, interval_s
        self._now_us, self._clock, self._trends = now_us, clock, trends
        self._due = clock() + interval_s
        self.saved_us = saved_us
        self.problem: str | None = None
        """Why the last try failed, for the operator; None when it did not."""

    def save_if_due(self) -> None:
        """Save when the interval is over."""
        if self._clock() >= self._due:
            self.save()

    def save(self) -> None:
        """Save now; a failure is reported to the operator and retried after the interval."""
        self._due = self._clock() + self._interval_s
        now_us = self._now_us()
        states = [state for axis_id, m in self._monitors.items() for state in _states(axis_id, m)]
        parts = self._trends.to_save() if self._trends else ()
        states += [AxisState(part.name, part.key, part.arrays) for part in parts]
        try:
            self._checkpoints.save_many(states, now_us)
        except StoreError as error:
            self.problem = f"the state of the monitors cannot be saved: {error}"
            log.error("checkpoint failed", reason=str(error))
            return
        self.saved_us, self.problem = now_us, None
        if self._trends:
            self._trends.saved()


def _states(axis_id: str, monitor: AxisMonitor) -> Iterator[AxisState]:
    """State of the monitor, and of the multi-model detector once it has one."""
    yield AxisState(axis_id, monitor.key, monitor.to_arrays())
    if monitor.multimodel is not None and monitor.multimodel.made:
        state = monitor.multimodel.bank.to_arrays()
        yield AxisState(multimodel_id(axis_id), monitor.multimodel_key, state)
