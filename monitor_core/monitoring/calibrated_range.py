"""Ranges of the speed and the signals of an axis during calibration, and whether the axis is within them now.

Thresholds keep their false-alarm budget in the conditions of the records from which they were calibrated.  A condition
is the value of an auxiliary signal, the root mean square of the speed over ten memories, the top speed of that time, or
the share of new poses: the part of the travel of the axis over ten memories that it made while the robot was in poses
that are not in the records.  A program that runs faster, but with longer stops, shows by its top speed only.  The
torque is not a condition, as a fault changes it.
"""

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.structure import Output
from monitor_core.monitoring.known_poses import PoseMap
from monitor_core.samples import SampleBlock, forward_fill
from monitor_core.settings import Settings
from monitor_core.wording import sentence

RMS_SPEED = "rms speed"
"""Root mean square of the speed [rad/s]; no signal can have this name."""
TOP_SPEED = "top speed"
"""Largest speed over about ten memories [rad/s], without single outliers; no signal can have this name."""
RMS_MEMORIES = 10
NEW_POSES = "share of new poses"
"""Share of the way of the axis over ten memories, 0 to 1; no signal can have this name."""
MOST_NEW_POSES = 0.1
"""With more of it another program runs, for which the nominal values of the load are an extrapolation."""
_AT_ONCE = 65_536
"""Samples of a record that are worked on at once: an hour of them would take several times their memory"""
MARGIN = 0.1
"""A value counts as inside if it is beyond an end by at most this share of the width and of the ends' magnitudes."""


class ConditionRange(NamedTuple):
    """Lowest and highest value of a condition in the calibration records."""

    condition: str
    low: float
    high: float

    def holds(self, values: Floats) -> Bools:
        """Whether values (N,) are inside, with a margin; unknown values (NaN) count as inside."""
        reach = MARGIN * max(self.high - self.low, abs(self.low), abs(self.high))
        return np.asarray(~((values < self.low - reach) | (values > self.high + reach)), np.bool_)


class ConditionTracker:
    """The conditions of an axis, from sample to sample; blocks may be split anywhere.

    Args:
        output: the measured output.
        settings: memory, interval and longest gap.
        signals: names of the auxiliary signals.
        poses: maps of the known poses; their angles are among the signals.
    """

    def __init__(
        self, output: Output, settings: Settings, signals: Sequence[str], poses: Sequence[PoseMap] = ()
    ) -> None:
        self.names = (RMS_SPEED, TOP_SPEED, *signals, *([NEW_POSES] if poses else ()))
        self._signals, self._poses = len(signals), [(m, [signals.index(name) for name in m.angles]) for m in poses]
        self._angle, self._gap_us = output == "angle", 1e6 * settings.max_gap_s
        self._samples = RMS_MEMORIES * settings.memory
        self._speed = MeasuredSpeed(output)
        self._sums = [0.0] * 4  # of the squares of the speed, of their weights, of the way, and of that in new poses
        self._top, self._recent = 0.0, np.zeros(0)  # the largest speed, forgotten slowly; the last two speeds
        self._last = np.full(len(self.names), math.nan)

    def take(self, block: SampleBlock) -> Floats:
        """The conditions at each sample (N, 2 + S), with maps (N, 3 + S); NaN: unknown."""
        N = block.size
        if N == 0:
            return np.zeros((0, len(self.names)))
        speed = self._speeds(block)
        known = np.isfinite(speed)
        # A sample without a speed leaves the sums as they are.
        total, count = self._sum(0, speed[known] ** 2), self._sum(1, np.ones(int(known.sum())))
        conditions = np.full((N, len(self.names)), math.nan)
        enough = count > self._samples * (1 - math.exp(-1))
        conditions[known, 0] = np.where(enough, np.sqrt(total / count), math.nan)
        conditions[known, 1] = self._top_speed(speed[known])
        if block.signals is not None:
            conditions[:, 2 : 2 + self._signals] = block.signals
        held = [0, 1]
        if self._poses:
            way = np.abs(speed[known])
            gone, new = self._sum(2, way), self._sum(3, np.where(self._is_new(block)[known], way, 0.0))
            conditions[known, -1] = np.where(enough & (gone > 0), new / np.maximum(gone, math.ulp(0.0)), math.nan)
            held.append(-1)
        conditions[:, held] = forward_fill(conditions[:, held], self._last[held])
        self._last = conditions[-1].copy()
        return conditions

    def _is_new(self, block: SampleBlock) -> Bools:
        """Whether the robot is in a pose that is not in the records (N,)."""
        new = np.zeros(block.size, np.bool_)
        if block.signals is not None:
            for known, (first, second) in self._poses:
                new |= ~known.holds(block.signals[:, first], block.signals[:, second])
        return new

    def _sum(self, row: int, values: Floats) -> Floats:
        """Running sum of values (n,) with exponential forgetting; ``row`` selects one of the sums."""
        if not values.size:
            return values
        factor = 1 - 1 / self._samples
        sums = accumulate(values.tolist(), lambda total, value: factor * total + value, initial=self._sums[row])
        out = np.fromiter(sums, float)[1:]
        self._sums[row] = float(out[-1])
        return out

    def _top_speed(self, speed: Floats) -> Floats:
        """The largest speed so far (n,), with exponential forgetting; NaN until there are three.

        Of three speeds in a row the middle one by value counts: an angle that is wrong in a single sample makes two
        large speeds of opposite signs.
        """
        own = np.concatenate([self._recent, speed])
        self._recent = own[-2:]
        if own.size < 3:
            return np.full(speed.size, math.nan)
        middle = np.abs(np.median(np.lib.stride_tricks.sliding_window_view(own, 3), axis=1))
        factor = 1 - 1 / self._samples
        tops = accumulate(middle.tolist(), lambda top, value: max(factor * top, value), initial=self._top)
        found = np.fromiter(tops, float)[1:]
        self._top = float(found[-1])
        return np.concatenate([np.full(speed.size - found.size, math.nan), found])

    def _speeds(self, block: SampleBlock) -> Floats:
        """Speed at each sample (N,); NaN: unknown, as after a gap of a measured angle."""
        steps = self._speed.take(block.t_us, block.y)
        if not self._angle:
            return steps.speed
        return np.where(steps.interval_us <= self._gap_us, steps.speed, math.nan)


def ranges(
    output: Output, settings: Settings, signals: Sequence[str], records: Sequence[SampleBlock]
) -> list[ConditionRange]:
    """Ranges of the conditions in consecutive records; a condition that was never known has no range.

    That of the top speed begins at zero: an axis that moves slowly does not leave the conditions by that.
    """
    tracker = ConditionTracker(output, settings, signals)
    low, high = (np.full(len(tracker.names), end) for end in (math.inf, -math.inf))
    for record in records:
        for first in range(0, record.size, _AT_ONCE):
            conditions = tracker.take(record.select(slice(first, first + _AT_ONCE)))
            low = np.fmin(low, np.fmin.reduce(conditions, axis=0))
            high = np.fmax(high, np.fmax.reduce(conditions, axis=0))
    return [
        ConditionRange(name, 0.0 if name == TOP_SPEED else float(least), float(most))
        for name, least, most in zip(tracker.names, low, high, strict=True)
        if least <= most
    ]


class Inside(NamedTuple):
    """Whether an axis is within its calibrated conditions at each sample, and whether in known poses, (N,) each."""

    conditions: Bools
    """All conditions, among them the poses"""
    poses: Bools | None
    """None: there is no map of the poses"""


class CalibratedRange:
    """Tells whether an axis is within its calibrated conditions, from sample to sample."""

    def __init__(self, known: Sequence[ConditionRange], tracker: ConditionTracker) -> None:
        self._tracker = tracker
        self._ranges = [(tracker.names.index(r.condition), r) for r in known if r.condition in tracker.names]
        self._new_poses = ConditionRange(NEW_POSES, 0.0, MOST_NEW_POSES) if NEW_POSES in tracker.names else None
        self._last: Floats | None = None

    def take(self, block: SampleBlock) -> Inside:
        """Whether the conditions are inside at each sample (N,)."""
        values, inside = self._tracker.take(block), np.ones(block.size, np.bool_)
        for column, r in self._ranges:
            inside &= r.holds(values[:, column])
        self._last = values[-1] if block.size else self._last
        if self._new_poses is None:
            return Inside(inside, None)
        poses = self._new_poses.holds(values[:, -1])
        return Inside(inside & poses, poses)

    @property
    def outside(self) -> tuple[str, ...]:
        """Conditions that were outside at the last sample, as "temperature = 41, calibrated from 20 to 35"."""
        last = self._last
        if last is None:
            return ()
        beyond = tuple(
            sentence(
                "not calibrated",
                "{name} = {value}, calibrated from {low} to {high}",
                name=r.condition,
                value=f"{last[column]:.3g}",
                low=f"{r.low:.3g}",
                high=f"{r.high:.3g}",
            )
            for column, r in self._ranges
            if not r.holds(last[column : column + 1]).all()
        )
        return (self.new_poses, *beyond) if self.new_poses else beyond

    @property
    def new_poses(self) -> str:
        """A sentence if, at the last sample, the share of new poses was too large; otherwise empty."""
        if self._last is None or self._new_poses is None or self._new_poses.holds(self._last[-1:]).all():
            return ""
        text = "{share} % of the way of the axis is in poses of the robot that no record of the calibration has"
        return sentence("new poses", text, share=f"{100 * self._last[-1]:.0f}")
