"""A torque that is sent later than the motion that it has caused: each motion gets the torque that belongs to it."""

import numpy as np

from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig

_NEAR = 0.5
"""Of an interval: where the times are farther apart, samples between are missing."""


class TorqueShift:
    """The samples of an axis with the torque that comes ``late_samples`` later, block by block.

    The last samples wait for their torque.  One whose torque is missing is left out, and counted.
    """

    def __init__(self, config: AxisConfig) -> None:
        self._late, self._interval_us = config.torque.late_samples, 1e6 * config.sample_interval_s
        self._waiting: list[SampleBlock] = []
        self.unpaired = 0
        """Samples whose torque is missing"""

    def paired(self, block: SampleBlock) -> SampleBlock:
        """The samples whose torque is now known."""
        if not self._late:
            return block
        known = concatenate([*self._waiting, block])
        paired = max(known.size - self._late, 0)
        self._waiting = [known.select(slice(paired, None))]
        motion, torque = known.select(slice(paired)), known.select(slice(self._late, None))
        apart = (torque.t_us - motion.t_us) / self._interval_us - self._late
        pairs = np.abs(apart) < _NEAR
        self.unpaired += int(np.count_nonzero(~pairs))
        return motion._replace(u=torque.u).select(pairs)
