"""Corrects values that are received some samples later than the motion that they belong to.

A filtered torque is sent some samples after the motion that it caused.  Speed and acceleration of an axis, taken
from its angle, are known only when there are samples on both sides.  The motion of another axis that also moves the
motor of this one may be sent after it; here it is added, so that samples have the motion of the motor.

The predictor holds the inputs of a sample until the next one.  A torque that changes in between is best the mean over
the interval: half a sample late (torque_time.py).  Torques that follow speeds and accelerations always change, so these
are those of the middle of the interval.
"""

import math
from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig, FurtherSignalConfig
from service.ingest.samples.motion_derivatives import MAX_ERROR, derivative_late

_TIME_TOLERANCE = 0.5
"""Tolerance of the time difference in intervals; outside it, samples in between are missing."""


class LateValues:
    """Combines each motion with the torque that is received ``late_samples`` samples later, and with derivatives.

    Half a sample is the mean of the two on either side.

    It takes block after block.  The last samples wait for their late values.  A sample whose torque or coupled motion
    is missing is dropped and counted.

    Args:
        config: the axis.
        signals: the auxiliary signals of the samples.
        coupled: number of coupled motions of other axes; they are the last columns of the signals that it takes, and
            are added to the motion.
        coupled_late: number of samples by which these come later.
    """

    def __init__(
        self, config: AxisConfig, signals: Sequence[FurtherSignalConfig] = (), coupled: int = 0, coupled_late: int = 0
    ) -> None:
        late = config.torque.late_samples
        self._late, self._latest = math.floor(late), math.ceil(late)
        self._interval_us = 1e6 * config.sample_interval_s
        self._derivative_late = derivative_late(config.sample_interval_s)
        self._derivatives = [place for place, source in enumerate(signals) if source.is_derivative]
        self._coupled, self._coupled_late = coupled, coupled_late
        self._waits = max(self._latest, self._derivative_late + 1 if self._derivatives else 0, coupled_late)
        self._waiting: list[SampleBlock] = []
        self.unpaired = 0
        """Number of samples whose torque or coupled motion is missing"""

    def paired(self, block: SampleBlock) -> SampleBlock:
        """Take samples; returns those whose late values are now known, with these."""
        if not self._waits and not self._coupled:
            return block
        known = concatenate([*self._waiting, block])
        count = max(known.size - self._waits, 0)
        self._waiting = [known.select(slice(count, None))]
        motion, u = known.select(slice(count)), np.zeros(count)
        y, signals = self._of_motor(motion.y, known), self._signals(known, count)
        pairs = np.isfinite(y)
        for late in (self._late, self._latest):
            torque = known.select(slice(late, late + count))
            pairs &= np.abs(self._behind(motion.t_us, torque.t_us) - late) < _TIME_TOLERANCE
            u += torque.u / 2
        self.unpaired += int(np.count_nonzero(~pairs))
        return motion._replace(y=y, u=u, signals=signals).select(pairs)

    def _of_motor(self, y: Floats, known: SampleBlock) -> Floats:
        """The motion of the motor (count,): that of the axis, and what the other axes add; NaN: that is not known."""
        if known.signals is None or not self._coupled:
            return y
        later = slice(self._coupled_late, self._coupled_late + len(y))
        for added in known.signals[later, -self._coupled :].T:
            y = y + added
        return y

    def _signals(self, known: SampleBlock, count: int) -> Floats | None:
        """The signals of the first samples (count, S), with the derivatives at their time."""
        if known.signals is None or known.signals.shape[1] == self._coupled:
            return None
        signals = known.signals[:count, : known.signals.shape[1] - self._coupled]
        if not self._derivatives:
            return signals
        signals = signals.copy()
        signals[:, self._derivatives] = 0.0
        for late in (self._derivative_late, self._derivative_late + 1):
            later = slice(late, late + count)
            lost = self._behind(known.t_us[:count], known.t_us[later]) - late
            found = known.signals[later][:, self._derivatives]
            signals[:, self._derivatives] += np.where((lost < MAX_ERROR)[:, np.newaxis], found, np.nan) / 2
        return signals

    def _behind(self, first: Ints, later: Ints) -> Floats:
        return np.asarray((later - first) / self._interval_us, np.float64)
