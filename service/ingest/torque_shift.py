"""Corrects a torque that is sent some samples later than the motion that it caused."""

import numpy as np

from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig

_NEAR = 0.5
"""Tolerance of the time difference in intervals; outside it, samples in between are missing."""


class TorqueShift:
    """Combines each motion with the torque that is received ``late_samples`` samples later, block by block.

    The last samples wait for their torque.  A sample whose torque is missing is dropped and counted.
    """

    def __init__(self, config: AxisConfig) -> None:
        self._late, self._interval_us = config.torque.late_samples, 1e6 * config.sample_interval_s
        self._waiting: list[SampleBlock] = []
        self.unpaired = 0
        """Number of samples whose torque is missing"""

    def paired(self, block: SampleBlock) -> SampleBlock:
        """Take samples; returns those whose torque is now known, with that torque."""
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
