"""The times of frames that follow a SYNC: what a CANopen drive sends then has been sampled at the SYNC.

All that is sent in one cycle gets the time of its SYNC: torque and motion in two PDOs belong together, and the wait of
a frame for the bus does not count.  A second frame after the same SYNC shows that one was lost: it keeps its own time.
"""

from __future__ import annotations

import numpy as np

from monitor_core.arrays import Ints
from service.can.frames import FrameBlock, FrameKey


class SyncCycle:
    """The SYNC of a bus, block by block."""

    def __init__(self, key: FrameKey) -> None:
        self.key = key
        self._places = np.zeros(0, np.int64)
        self._times_us = np.zeros(1, np.int64)
        """Of the last SYNC before the block, and of those in it"""
        self._begun = False
        """Whether there was a SYNC before the block"""
        self._answered, self._answering = set[FrameKey](), set[FrameKey]()
        """Messages that have come after the last SYNC before the block, and after the last one in it"""

    def take(self, frames: FrameBlock) -> int:
        """Look at the next block; returns how many SYNCs it has."""
        self._answered = self._answering | (set() if self._places.size else self._answered)
        self._answering = set()
        self._begun = self._begun or bool(self._places.size)
        self._places = np.flatnonzero(frames.ids == self.key.record_id)
        self._times_us = np.concatenate([self._times_us[-1:], frames.t_us[self._places]])
        return len(self._places)

    def times_us(self, key: FrameKey, frames: FrameBlock, places: Ints) -> Ints:
        """The times (N,) of the frames of one message, which are at these places (N,) of the block."""
        cycles = np.searchsorted(self._places, places)
        if cycles[-1] == len(self._places):
            self._answering.add(key)
        before = np.concatenate([[0 if key in self._answered else -1], cycles[:-1]])
        first = (cycles != before) & ((cycles > 0) | self._begun)
        return np.where(first, self._times_us[cycles], frames.t_us[places])
