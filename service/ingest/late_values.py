"""Values that come later than the motion they belong to: each motion gets its own torque, and its own accelerations.

A filtered torque is sent some samples after the motion that it has caused.  The acceleration of another axis is known
only when samples on both sides of it are there.
"""

from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig, FurtherSignalConfig
from service.ingest.quantities import ACCELERATION_LATE, HOLDS

_NEAR = 0.5
"""Of an interval: where the times are farther apart, samples between are missing."""


class LateValues:
    """The samples of an axis with the torque that comes ``late_samples`` later, and accelerations, block by block.

    The last samples wait for what is late.  One whose torque is missing is left out, and counted.
    ``signals`` are those that the samples carry.
    """

    def __init__(self, config: AxisConfig, signals: Sequence[FurtherSignalConfig] = ()) -> None:
        self._late, self._interval_us = config.torque.late_samples, 1e6 * config.sample_interval_s
        self._accelerations = [place for place, source in enumerate(signals) if source.acceleration]
        self._waits = max(self._late, ACCELERATION_LATE if self._accelerations else 0)
        self._waiting: list[SampleBlock] = []
        self.unpaired = 0
        """Samples whose torque is missing"""

    def paired(self, block: SampleBlock) -> SampleBlock:
        """The samples of which all is now known."""
        if not self._waits:
            return block
        known = concatenate([*self._waiting, block])
        count = max(known.size - self._waits, 0)
        self._waiting = [known.select(slice(count, None))]
        motion, torque = known.select(slice(count)), known.select(slice(self._late, self._late + count))
        pairs = np.abs(self._behind(motion.t_us, torque.t_us) - self._late) < _NEAR
        self.unpaired += int(np.count_nonzero(~pairs))
        return motion._replace(u=torque.u, signals=self._signals(known, count)).select(pairs)

    def _signals(self, known: SampleBlock, count: int) -> Floats | None:
        """The signals of the first samples (count, S), with the accelerations at their time."""
        if known.signals is None or not self._accelerations:
            return None if known.signals is None else known.signals[:count]
        later = slice(ACCELERATION_LATE, ACCELERATION_LATE + count)
        lost = self._behind(known.t_us[:count], known.t_us[later]) - ACCELERATION_LATE
        signals = known.signals[:count].copy()
        for place in self._accelerations:
            signals[:, place] = np.where(lost < HOLDS, known.signals[later, place], np.nan)
        return signals

    def _behind(self, first: Ints, later: Ints) -> Floats:
        return np.asarray((later - first) / self._interval_us, np.float64)
