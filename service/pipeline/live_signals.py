"""Torque, motion and its prediction over the last seconds, of the axes that somebody looks at.

While nobody looks, the worker does nothing for it.  While somebody does, the kernel also writes down what it computes
for each sample, and the arrays of each block are kept, not copied sample by sample.
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
"""So long a time is kept."""
PATIENCE_S = 5.0
"""For so long after the last question somebody counts as looking."""


class LiveBlock(NamedTuple):
    """Samples of one axis; nobody may change the arrays."""

    t_us: NDArray[np.int64]  # (N,) us since 1970
    u: Floats  # (N,) motor torque, N m
    y: Floats  # (N,) measured motion, rad/s or rad
    yhat: Floats  # (N,) its prediction by the kernel; NaN: there was none
    eps: Floats  # (N,) y - yhat where something was learned from it, else NaN


class LiveSignals:
    """The worker adds blocks, other threads read them; neither waits for the other.

    Args:
        now_s: a clock that is never set back.
    """

    def __init__(self, now_s: Callable[[], float] = monotonic) -> None:
        self._now_s = now_s
        self._until_s: dict[str, float] = {}
        """Until when somebody looks at an axis; changed by readers"""
        self._kept: Mapping[str, tuple[LiveBlock, ...]] = {}
        """Replaced by the worker in one assignment"""

    def look(self, axis_id: str) -> tuple[LiveBlock, ...]:
        """The blocks of an axis, in the order of their receipt; from now on it is looked at.  From any thread."""
        self._until_s[axis_id] = self._now_s() + PATIENCE_S
        return self._kept.get(axis_id, ())

    def observer(self) -> Callable[[str, SampleBlock, AxisTrace], None] | None:
        """What is to get the samples of the next block; None: nobody looks.  By the worker only."""
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
        """Drop the blocks of axes that are gone, or are monitored by another model.  By the worker only."""
        self._kept = {a: blocks for a, blocks in self._kept.items() if a not in axis_ids}

    def _take(self, axis_id: str, block: SampleBlock, trace: AxisTrace) -> None:
        if axis_id not in self._until_s or not block.size:
            return
        # The trace is that of many axes: a part of it would keep all of it.
        predicted, learned = trace.estimator.yhat.copy(), trace.estimator.eps.copy()
        new = LiveBlock(block.t_us, block.u, block.y, predicted, learned)
        oldest_us = int(block.t_us[-1]) - round(1e6 * LENGTH_S)
        kept = (old for old in self._kept.get(axis_id, ()) if oldest_us <= old.t_us[-1] <= block.t_us[-1])
        self._kept = {**self._kept, axis_id: (*kept, new)}
