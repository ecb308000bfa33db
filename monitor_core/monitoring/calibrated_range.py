"""Conditions of an axis while it was calibrated: ranges of its speed and its signals; whether it is within them now.

Thresholds keep their false-alarm budget in the conditions of the records that they are from.  A condition is the value
of an auxiliary signal, or the root mean square of the speed over ten memories.  The torque is none: a fault changes it.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.structure import Output
from monitor_core.samples import SampleBlock, forward_fill
from monitor_core.settings import Settings
from monitor_core.wording import sentence

RMS_SPEED = "rms speed"
"""Root mean square of the speed [rad/s]; no signal can have this name."""
RMS_MEMORIES = 10
MARGIN = 0.1
"""A value counts as inside up to this share of the width of a range, and of the magnitude of its ends, beyond them."""


class Range(NamedTuple):
    """Lowest and highest value of a condition in the calibration records."""

    condition: str
    low: float
    high: float

    def holds(self, values: Floats) -> Bools:
        """Whether values (N,) are inside, with a margin; unknown ones (NaN) count as inside."""
        reach = MARGIN * max(self.high - self.low, abs(self.low), abs(self.high))
        return np.asarray(~((values < self.low - reach) | (values > self.high + reach)), np.bool_)


class ConditionTracker:
    """The conditions of an axis, from sample to sample; blocks may be split anywhere.

    Args:
        output: what is measured beside the torque.
        settings: memory, interval and longest gap.
        signals: names of the auxiliary signals.
    """

    def __init__(self, output: Output, settings: Settings, signals: Sequence[str]) -> None:
        self.names = (RMS_SPEED, *signals)
        self._angle, self._gap_us = output == "angle", 1e6 * settings.max_gap_s
        self._samples = RMS_MEMORIES * settings.memory
        self._speed = MeasuredSpeed(output)
        self._sums = [0.0, 0.0]  # of the squares and of their weights
        self._last = np.full(len(self.names), math.nan)

    def take(self, block: SampleBlock) -> Floats:
        """The conditions at each sample (N, 1 + S); NaN: unknown."""
        N = block.size
        if N == 0:
            return np.zeros((0, len(self.names)))
        squares = self._speeds(block) ** 2
        known = np.isfinite(squares)
        # A sample without a speed neither adds nor forgets.
        total, count = self._sum(0, squares[known]), self._sum(1, np.ones(int(known.sum())))
        found = np.full((N, len(self.names)), math.nan)
        enough = count > self._samples * (1 - math.exp(-1))
        found[known, 0] = np.where(enough, np.sqrt(total / count), math.nan)
        found[:, :1] = forward_fill(found[:, :1], self._last[:1])
        if block.signals is not None:
            found[:, 1:] = block.signals
        self._last = found[-1].copy()
        return found

    def _sum(self, row: int, values: Floats) -> Floats:
        """Running sum of values (n,) with the memory of the mean square; one of two, by row."""
        if not values.size:
            return values
        kept = 1 - 1 / self._samples
        sums = accumulate(values.tolist(), lambda total, value: kept * total + value, initial=self._sums[row])
        out = np.fromiter(sums, float)[1:]
        self._sums[row] = float(out[-1])
        return out

    def _speeds(self, block: SampleBlock) -> Floats:
        """Magnitude of the speed at each sample (N,); NaN: unknown, as after a gap of an angle."""
        steps = self._speed.take(block.t_us, block.y)
        if not self._angle:
            return steps.speed
        return np.where(steps.interval_us <= self._gap_us, steps.speed, math.nan)


def ranges(
    output: Output, settings: Settings, signals: Sequence[str], records: Sequence[SampleBlock]
) -> list[Range]:
    """Ranges of the conditions in records, one after the other; without those that were never known."""
    tracker = ConditionTracker(output, settings, signals)
    found = np.concatenate([tracker.take(record) for record in records])
    return [
        Range(name, float(np.nanmin(values)), float(np.nanmax(values)))
        for name, values in zip(tracker.names, found.T, strict=True)
        if np.isfinite(values).any()
    ]


class CalibratedRange:
    """Whether an axis is within the conditions of its calibration, from sample to sample."""

    def __init__(self, known: Sequence[Range], tracker: ConditionTracker) -> None:
        self._tracker = tracker
        self._ranges = [(tracker.names.index(r.condition), r) for r in known if r.condition in tracker.names]
        self._last: Floats | None = None

    def take(self, block: SampleBlock) -> Bools:
        """Whether the conditions are inside at each sample (N,)."""
        values, inside = self._tracker.take(block), np.ones(block.size, np.bool_)
        for column, r in self._ranges:
            inside &= r.holds(values[:, column])
        self._last = values[-1] if block.size else self._last
        return inside

    @property
    def outside(self) -> tuple[str, ...]:
        """What was outside at the last sample: "temperature = 41, calibrated from 20 to 35"; empty: nothing."""
        return tuple(self._outside())

    def _outside(self) -> Iterator[str]:
        for column, r in self._ranges if self._last is not None else ():
            assert self._last is not None
            if not r.holds(self._last[column : column + 1]).all():
                yield sentence(
                    "not calibrated",
                    "{name} = {value}, calibrated from {low} to {high}",
                    name=r.condition,
                    value=f"{self._last[column]:.3g}",
                    low=f"{r.low:.3g}",
                    high=f"{r.high:.3g}",
                )
