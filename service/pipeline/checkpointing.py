"""Checkpoints of all monitors, at an interval and at the end."""

from collections.abc import Callable, Iterator, Mapping
from time import monotonic
from typing import Literal, NamedTuple

import structlog

from monitor_core.monitoring import Arrays, AxisMonitor
from service.pipeline.trends import Trends
from service.store.checkpoints import AxisState, Checkpoints
from service.store.database import StoreError

log = structlog.get_logger(__name__)

Part = Literal["estimates", "multimodel", "history"]


class SavedState(NamedTuple):
    """A state of an axis that is saved separately: its name and key, its arrays, and what restores it."""

    part: Part
    name: str
    key: str
    arrays: Callable[[], Arrays | None]
    """None: there is none yet"""
    restore: Callable[[Arrays], None]


def states_of(axis_id: str, monitor: AxisMonitor) -> Iterator[SavedState]:
    """The states of a monitor: estimates, and the evidence of its multi-model detector."""
    yield SavedState("estimates", axis_id, monitor.key, monitor.to_arrays, monitor.from_arrays)
    multimodel = monitor.multimodel
    if multimodel is not None:
        yield SavedState(
            "multimodel",
            f"{axis_id} (multi-model detector)",
            monitor.multimodel_key,
            lambda: multimodel.bank.to_arrays() if multimodel.made else None,
            lambda arrays: multimodel.bank.from_arrays(arrays),
        )


class Checkpointer:
    """Saves all monitors together, so that the saved states belong to one time.

    Args:
        checkpoints: the store.
        monitors: by axis.
        interval_s: time between two checkpoints [s].
        saved_us: time of the checkpoint that the monitors were restored from.
        now_us: wall clock.
        trends: the slow histories, saved with them.
    """

    def __init__(
        self,
        checkpoints: Checkpoints,
        monitors: Mapping[str, AxisMonitor],
        interval_s: float,
        saved_us: int | None,
        now_us: Callable[[], int],
        trends: Trends | None = None,
    ) -> None:
        self._checkpoints, self._monitors, self._interval_s = checkpoints, monitors, interval_s
        self._now_us, self._trends = now_us, trends
        self._due = monotonic() + interval_s
        self.saved_us = saved_us
        self.problem: str | None = None
        """Why the last try failed, for the operator; None when it did not."""

    def save_if_due(self) -> None:
        """Save when the interval is over."""
        if monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Save now; a failure is reported to the operator and retried after the interval."""
        self._due = monotonic() + self._interval_s
        now_us = self._now_us()
        states = [*self._states(), *(self._trends.to_save() if self._trends else ())]
        try:
            self._checkpoints.save(states, now_us)
        except StoreError as error:
            self.problem = f"the state of the monitors cannot be saved: {error}"
            log.error("checkpoint failed", reason=str(error))
            return
        self.saved_us, self.problem = now_us, None
        if self._trends:
            self._trends.saved()

    def _states(self) -> Iterator[AxisState]:
        for axis_id, monitor in self._monitors.items():
            for state in states_of(axis_id, monitor):
                arrays = state.arrays()
                if arrays is not None:
                    yield AxisState(state.name, state.key, arrays)
