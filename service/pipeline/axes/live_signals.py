"""Torque, motion and predicted motion of the last seconds, for the axes that a page displays.

While nobody requests them, the worker does nothing.  While somebody does, the kernel also stores what it computes for
each sample, and the arrays of each block are kept as they are.
"""

from collections.abc import Callable, Collection, Mapping
from time import monotonic
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.monitoring import AxisTrace
from monitor_core.samples import SampleBlock

LENGTH_S = 10.0
"""Length of the kept signals [s]."""
PATIENCE_S = 5.0
"""Signals are kept for this time after the last request [s]."""


class LiveBlock(NamedTuple):
    """Samples of one axis; the arrays are shared and must not be changed."""

    t_us: NDArray[np.int64]  # (N,) us since 1970
    u: Floats  # (N,) motor torque, N m
    y: Floats  # (N,) measured motion, rad/s or rad
    yhat: Floats  # (N,) prediction of y by the kernel; NaN: there was none
    eps: Floats  # (N,) prediction error y - yhat of samples that updated the estimates, else NaN


class LiveSignals:
    """Keeps the latest blocks.  The worker adds them, other threads read them; neither waits for the other.

    Args:
        now_s: monotonic clock [s].
    """

    def __init__(self, now_s: Callable[[], float] = monotonic) -> None:
        self._now_s = now_s
        self._until_s: dict[str, float] = {}
        """By axis: end of the time for which its blocks are kept; changed by readers"""
        self._kept: Mapping[str, tuple[LiveBlock, ...]] = {}
        """Kept blocks by axis; the worker replaces the mapping in one assignment"""

    def look(self, axis_id: str) -> tuple[LiveBlock, ...]:
        """The kept blocks of an axis, in order of receipt; blocks are kept for another ``PATIENCE_S``.

        From any thread.
        """
        self._until_s[axis_id] = self._now_s() + PATIENCE_S
        return self._kept.get(axis_id, ())

    def observer(self) -> Callable[[str, SampleBlock, AxisTrace], None] | None:
        """The function to call with the samples of the next block; None: nobody needs them.  For the worker only."""
        if not self._until_s:
            return None
        now_s = self._now_s()
        ended = [axis_id for axis_id, until_s in self._until_s.copy().items() if until_s < now_s]
        for axis_id in ended:
            self._until_s.pop(axis_id)
        if ended:
            self.forget(ended)
        return self._take if self._until_s else None

    def forget(self, axis_ids: Collection[str]) -> None:
        """Drop the blocks of axes that are gone or have a new monitor.  For the worker only."""
        self._kept = {a: blocks for a, blocks in self._kept.items() if a not in axis_ids}

    def _take(self, axis_id: str, block: SampleBlock, trace: AxisTrace) -> None:
        if axis_id not in self._until_s or not block.size:
            return
        # The trace has the values of many axes; a view of one axis would keep all of it in memory.
        predicted, learned = trace.estimator.yhat.copy(), trace.estimator.eps.copy()
        new = LiveBlock(block.t_us, block.u, block.y, predicted, learned)
        oldest_us = int(block.t_us[-1]) - round(1e6 * LENGTH_S)
        kept = (old for old in self._kept.get(axis_id, ()) if oldest_us <= old.t_us[-1] <= block.t_us[-1])
        self._kept = {**self._kept, axis_id: (*kept, new)}
