"""Saves the states of all monitors at intervals and at the end."""

from collections.abc import Callable, Iterator
from time import monotonic
from typing import Literal, NamedTuple

import structlog

from monitor_core.arrays import Arrays
from monitor_core.wording import sentence
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.axes.axis_pipeline import AxisPipeline
from service.pipeline.pauses import with_pauses
from service.store.checkpoints import Checkpoints, MonitorState
from service.store.database import StoreError

log = structlog.get_logger(__name__)

THERMAL_SCHEMA = "thermal schema=2"
"""Start of the key of a saved warm-up state.  The rest of the key is the thermal model, without its initial state and
its missing parameters."""
STARTS_SCHEMA = "starts schema=1"
"""Key of the saved starts of the motion, which belong to the robot and not to its model"""

StatePart = Literal["estimates", "multimodel", "thermal", "learning", "history"]


class SavedState(NamedTuple):
    """One separately saved state of an axis: its name and key, and how to save and restore it."""

    part: StatePart
    name: str
    key: str
    arrays: Callable[[], Arrays | None]
    """Returns the arrays to save; None: there is no state yet"""
    restore: Callable[[Arrays], None]


def states_of(axis: AxisPipeline) -> Iterator[SavedState]:
    """The saved states of an axis: estimates, evidence of the multi-model detector, learning window, warm-up state.

    An axis without a warm-up state has the starts of its motion instead.  All but these two belong to one epoch and
    have it in their keys.
    """
    axis_id, monitor, epoch = axis.config.id, axis.monitor, axis.epoch
    key = epoch.key(monitor.key)
    yield SavedState("estimates", axis_id, key, monitor.to_arrays, monitor.from_arrays)
    multimodel = monitor.multimodel
    if multimodel is not None:
        yield SavedState(
            "multimodel",
            f"{axis_id} (multi-model detector)",
            epoch.key(monitor.multimodel_key),
            multimodel.to_arrays,
            multimodel.from_arrays,
        )
    if epoch.learning is not None:
        number, window, _ = epoch.learning
        key = f"learning window 1 for epoch {number} of {window.length_s:g} s {monitor.key}"
        name = f"{axis_id} (learning window)"
        yield SavedState("learning", name, key, window.to_arrays, window.from_arrays)
    operating, starts = axis.operating, axis.unrecorded_heat
    if operating is not None and operating.thermal is not None:
        m = operating.thermal.model
        tau = " ".join(f"tau={tau_s}" for tau_s, _ in m.parts)
        key = f"{THERMAL_SCHEMA} {tau} fm={m.fm} fc={m.fc} largest={m.largest} ambient={m.ambient}"
        name = f"{axis_id} (warm-up state)"
        yield SavedState("thermal", name, key, operating.to_arrays, operating.from_arrays)
    if starts is not None:
        name = f"{axis_id} (starts of the motion)"
        yield SavedState("thermal", name, STARTS_SCHEMA, starts.to_arrays, starts.from_arrays)


class Checkpointer:
    """Saves the states of all monitors in one transaction, so that they belong to the same time.

    Args:
        checkpoints: the store.
        monitors: the monitors of all axes, with their long-term trends.
        interval_s: time between two checkpoints [s].
        now_us: wall clock.
    """

    def __init__(
        self,
        checkpoints: Checkpoints,
        monitors: AxisMonitors,
        interval_s: float,
        now_us: Callable[[], int],
    ) -> None:
        self.checkpoints, self._monitors, self._interval_s = checkpoints, monitors, interval_s
        self._now_us = now_us
        self._due = monotonic() + interval_s
        self.saved_us: int | None = None
        """Time of the last checkpoint, which may be from an earlier run [us]; None: there is none"""
        self.problem: str | None = None
        """Message to the operator: why the last checkpoint failed; None: it did not fail."""

    def save_soon(self) -> None:
        """Make the next checkpoint due now, as monitors have been replaced."""
        self._due = monotonic()

    def save_if_due(self) -> None:
        """Save when the interval is over."""
        if monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Save now; a failure is reported to the operator and retried after the interval."""
        self._due = monotonic() + self._interval_s
        now_us = self._now_us()
        states = [*with_pauses(self._states()), *with_pauses(self._monitors.trends.to_save())]
        try:
            self.checkpoints.save(states, now_us)
        except StoreError as error:
            if self.problem is None:
                log.error("checkpoint failed; retrying", reason=str(error))
            self.problem = sentence("not saved", "the state of the monitors cannot be saved: {why}", why=error.args[0])
            return
        if self.problem is not None:
            log.info("checkpoints are saved again")
        self.saved_us, self.problem = now_us, None
        self._monitors.trends.saved()

    def _states(self) -> Iterator[MonitorState]:
        for axis in self._monitors.axes.values():
            for state in states_of(axis):
                arrays = state.arrays()
                if arrays is not None:
                    yield MonitorState(state.name, state.key, arrays)
