"""Corrects values that are received some samples later than the motion that they belong to.

A filtered torque is sent some samples after the motion that it caused.  Speed and acceleration of an axis, taken
from its angle, are known only when there are samples on both sides.
"""

from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig, FurtherSignalConfig
from service.ingest.motion_derivatives import MAX_ERROR, derivative_late

_TIME_TOLERANCE = 0.5
"""Tolerance of the time difference in intervals; outside it, samples in between are missing."""


class LateValues:
    """Combines each motion with the torque that is received ``late_samples`` samples later, and with derivatives.

    It takes block after block.  The last samples wait for their late values.  A sample whose torque is missing is
    dropped and counted.  ``signals`` are the auxiliary signals of the samples.
    """

    def __init__(self, config: AxisConfig, signals: Sequence[FurtherSignalConfig] = ()) -> None:
        self._late, self._interval_us = config.torque.late_samples, 1e6 * config.sample_interval_s
        self._derivative_late = derivative_late(config.sample_interval_s)
        self._derivatives = [place for place, source in enumerate(signals) if source.is_derivative]
        self._waits = max(self._late, self._derivative_late if self._derivatives else 0)
        self._waiting: list[SampleBlock] = []
        self.unpaired = 0
        """Number of samples whose torque is missing"""

    def paired(self, block: SampleBlock) -> SampleBlock:
        """Take samples; returns those whose late values are now known, with these."""
        if not self._waits:
            return block
        known = concatenate([*self._waiting, block])
        count = max(known.size - self._waits, 0)
        self._waiting = [known.select(slice(count, None))]
        motion, torque = known.select(slice(count)), known.select(slice(self._late, self._late + count))
        pairs = np.abs(self._behind(motion.t_us, torque.t_us) - self._late) < _TIME_TOLERANCE
        self.unpaired += int(np.count_nonzero(~pairs))
        return motion._replace(u=torque.u, signals=self._signals(known, count)).select(pairs)

    def _signals(self, known: SampleBlock, count: int) -> Floats | None:
        """The signals of the first samples (count, S), with the derivatives at their time."""
        if known.signals is None or not self._derivatives:
            return None if known.signals is None else known.signals[:count]
        later = slice(self._derivative_late, self._derivative_late + count)
        lost = self._behind(known.t_us[:count], known.t_us[later]) - self._derivative_late
        signals = known.signals[:count].copy()
        for place in self._derivatives:
            signals[:, place] = np.where(lost < MAX_ERROR, known.signals[later, place], np.nan)
        return signals

    def _behind(self, first: Ints, later: Ints) -> Floats:
        return np.asarray((later - first) / self._interval_us, np.float64)
