"""Unwraps an angle that wraps after each turn, or after 2^16 counts.

The next angle is extrapolated from the last two.  Of all angles that the signal can mean (a period apart), the nearest
is taken.  If the extrapolation lies near the middle between two of them, the sample is refused, as a wrong choice would
add a jump that never happened.
"""

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.samples import SampleBlock
from service.config.schema import AxisConfig

AMBIGUOUS = "ambiguous"
"""Drop reason of samples about half a period away from the expected angle."""
SURE = 0.4
"""An angle farther than this part of a period from the expected one is ambiguous."""
_GAP = 10
"""Longest gap in sample intervals; the default of ``max_gap_s``"""


class MotionPoint(NamedTuple):
    """Motion of an axis at a time [us]: angle [rad] and speed [rad/us]."""

    t_us: int
    angle: float
    speed: float


class Turns:
    """Makes continuous angles of one axis from a signal with this period [rad], sample by sample.

    After a gap longer than ``gap_us``, the angle starts again at the value of the signal, as the predictor does.
    """

    def __init__(self, period: float, gap_us: int) -> None:
        self._period, self._gap_us = period, gap_us
        self._last: MotionPoint | None = None
        self.refused = 0

    def resume(self, motion: MotionPoint) -> None:
        """Continue from the last known motion of the axis."""
        self._last = motion

    def take(self, t_us: Ints, angle: Floats) -> tuple[Floats, Bools]:
        """Continuous angles (N,) of samples at increasing times, and which of them are unambiguous (N,)."""
        unwrapped = [self._next(t, value) for t, value in zip(t_us.tolist(), angle.tolist(), strict=True)]
        sure = np.array([value is not None for value in unwrapped], np.bool_)
        self.refused += len(unwrapped) - int(np.count_nonzero(sure))
        return np.array([np.nan if value is None else value for value in unwrapped]), sure

    def unwrapped(self, block: SampleBlock) -> SampleBlock:
        """The unambiguous samples, with continuous angles."""
        angle, sure = self.take(block.t_us, block.y)
        return block._replace(y=angle).select(sure)

    def _next(self, t_us: int, value: float) -> float | None:
        last = self._last
        if last is None or abs(t_us - last.t_us) > self._gap_us:
            self._last = MotionPoint(t_us, value, 0.0)
            return value
        if t_us <= last.t_us:  # the monitor will refuse and count this sample
            return value
        expected = last.angle + last.speed * (t_us - last.t_us)
        unwrapped = value + round((expected - value) / self._period) * self._period
        if not abs(unwrapped - expected) <= SURE * self._period:
            return None
        self._last = MotionPoint(t_us, unwrapped, (unwrapped - last.angle) / (t_us - last.t_us))
        return unwrapped


def continuous(t: Floats, angle: Floats, period: float | None) -> Floats:
    """Continuous angles (N,) at increasing times (N,) [s], in the unit of the signal; NaN: ambiguous."""
    good = np.isfinite(angle)
    if period is None or np.count_nonzero(good) < 2:
        return angle
    t_us = np.rint(1e6 * (t[good] - t[0])).astype(np.int64)
    turns = Turns(period, _GAP * max(1, int(np.median(np.diff(t_us)))))
    found = np.full(angle.shape, np.nan)
    found[good], _ = turns.take(t_us, angle[good])
    return found


def turns_of(config: AxisConfig) -> Turns | None:
    """The unwrapping of the angle of an axis; None: the angle does not wrap."""
    if config.angle is None or config.angle.wrap_period is None:
        return None
    period = abs(config.angle.factor) * config.angle.wrap_period
    return Turns(period, round(config.max_gap_s * 1e6))
