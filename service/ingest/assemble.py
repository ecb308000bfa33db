"""Pairs torque and motion of one axis into samples; what does not fit is counted, never mixed up."""

from __future__ import annotations

import math
from collections import deque
from typing import Literal, NamedTuple

from monitor_core.samples import PHYSICAL_LIMITS
from service.can.user_errors import IngestError

REASONS = ("not_finite", "absurd", "repeated", "out_of_order", "untimed", "unpaired", "late", "missing")
"""Why values did not become a sample; ``Assembler.dropped`` counts them, and as "missing" whole samples.

not_finite: NaN or infinite.  absurd: beyond physical limits.  repeated: the same quantity again within half
an interval.  out_of_order: not after the last sample.  untimed: the sample counter, or the fitted clock, contradicts
the time of receipt.  unpaired: the partner never came.  late: came after its partner had been given up or paired
otherwise.  missing: samples that never came, from the interval between two samples.
"""

Kind = Literal["torque", "motion"]


class Sample(NamedTuple):
    """Torque and motion of one axis at one time, SI units on the motor side."""

    t_us: int
    torque: float  # N m
    motion: float  # rad or rad/s


class _Value(NamedTuple):
    t_us: int  # time of receipt, for pairing
    value: float
    sample_us: int | None  # time by the sample counter, where there is one


class _Lane:
    def __init__(self) -> None:
        self.waiting: list[_Value] = []
        self.given_up: deque[int] = deque(maxlen=8)
        self.paired_us: int | None = None

    def has_near(self, t_us: int, distance_us: float) -> bool:
        """Whether a waiting value of this quantity is nearer than that distance."""
        return self.was_near(t_us, distance_us) or any(abs(v.t_us - t_us) < distance_us for v in self.waiting)

    def was_near(self, t_us: int, distance_us: float) -> bool:
        """As ``has_near``, for values that no longer wait."""
        if self.paired_us is not None and abs(self.paired_us - t_us) < distance_us:
            return True
        return any(abs(t - t_us) < distance_us for t in self.given_up)

    def nearest(self, t_us: int, tolerance_us: float) -> _Value | None:
        """The waiting value nearest to that time, within the tolerance."""
        best = min(self.waiting, key=lambda v: abs(v.t_us - t_us), default=None)
        return best if best is not None and abs(best.t_us - t_us) <= tolerance_us else None

    def give_up(self, before_us: float) -> int:
        """Stop waiting for the partners of values before that time; returns how many there were."""
        lost = [v for v in self.waiting if v.t_us < before_us]
        if lost:
            self.waiting = [v for v in self.waiting if v.t_us >= before_us]
            self.given_up.extend(v.t_us for v in lost)
        return len(lost)


class Assembler:
    """Pairs the values of one axis into samples with strictly increasing times.

    A torque and a motion value belong together when they were received within the tolerance.  As long as all values of
    a cycle are, and the tolerance is below half an interval, no sample ever mixes two cycles.  Every value is in one
    sample or counted once.

    Args:
        interval_s: sample interval [s].
        tolerance_s: pairing tolerance [s], below half an interval.
        max_gap_s: a step back in time by more than this means that the clock was set back [s].
        patience: number of intervals that a value waits for its partner.
        motion: what the motion is: "angle" or "speed".

    Raises:
        IngestError: the tolerance is not below half an interval.
    """

    def __init__(
        self,
        interval_s: float,
        tolerance_s: float,
        max_gap_s: float,
        patience: float = 1.0,
        motion: str = "angle",
    ) -> None:
        if not 0 < tolerance_s < interval_s / 2:
            raise IngestError(
                f"pairing_tolerance_s = {tolerance_s:g} must be below half of sample_interval_s = "
                f"{interval_s:g}"
            )
        self._interval_us = interval_s * 1e6
        self._tolerance_us = tolerance_s * 1e6
        self._gap_us = max_gap_s * 1e6
        self._patience_us = patience * self._interval_us
        self._limits = {"torque": PHYSICAL_LIMITS["torque"], "motion": PHYSICAL_LIMITS[motion]}
        self._lanes: dict[Kind, _Lane] = {"torque": _Lane(), "motion": _Lane()}
        self._newest_us: int | None = None  # of all values received
        self._floor_us: int | None = None  # later of the two values of the last sample, as received
        self._last_us: int | None = None  # time of the last sample
        self.dropped = dict.fromkeys(REASONS, 0)
        self.clock_set_back = 0

    def add(self, kind: Kind, t_us: int, value: float, sample_us: int | None = None) -> Sample | None:
        """Take a value; returns the sample that it completes.

        Args:
            kind: which quantity.
            t_us: time of receipt [us].
            value: torque [N m], or angle [rad] or speed [rad/s].
            sample_us: time of the sample [us] by the sample counter, where this message has one.
        """
        if (nonsense := self._nonsense(kind, value)) is not None:
            self.drop(nonsense)
            return None
        self._notice(t_us)
        lane, other = self._lanes[kind], self._lanes["motion" if kind == "torque" else "torque"]
        reason = self._misfit(lane, other, t_us)
        if reason is not None:
            self.drop(reason)
            return None
        partner = other.nearest(t_us, self._tolerance_us)
        mine = _Value(t_us, value, sample_us)
        if partner is None:
            lane.waiting.append(mine)
            self._give_up(t_us - self._patience_us)
            return None
        other.waiting.remove(partner)
        lane.paired_us, other.paired_us = t_us, partner.t_us
        return self._pair(mine, partner) if kind == "torque" else self._pair(partner, mine)

    def add_pair(
        self, t_us: int, torque: float, motion: float, sample_us: int | None = None
    ) -> Sample | None:
        """Take both values from one frame: they belong together, whatever the tolerance."""
        nonsense = self._nonsense("torque", torque) or self._nonsense("motion", motion)
        if nonsense is not None:
            self.drop(nonsense, 2)
            return None
        self._notice(t_us)
        floor = self._floor_us
        # A sample counter has already separated repeated frames from those of a burst.
        if sample_us is None and floor is not None and abs(t_us - floor) < self._interval_us / 2:
            self.drop("repeated", 2)
            return None
        if sample_us is None and floor is not None and t_us < floor:
            self.drop("out_of_order", 2)
            return None
        return self._pair(_Value(t_us, torque, sample_us), _Value(t_us, motion, sample_us))

    def flush(self) -> None:
        """No more values will come: those that wait for a partner are unpaired."""
        self._give_up(math.inf)

    def drop(self, reason: str, values: int = 1) -> None:
        """Count values that do not become a sample."""
        self.dropped[reason] += values

    def _notice(self, t_us: int) -> None:
        """Keep the newest time; a large step back means that the clock was set back: restart."""
        if self._newest_us is not None and t_us < self._newest_us - self._gap_us:
            self.clock_set_back += 1
            self.flush()
            self._lanes = {"torque": _Lane(), "motion": _Lane()}
            self._newest_us = self._floor_us = self._last_us = None
        self._newest_us = t_us if self._newest_us is None else max(self._newest_us, t_us)

    def _misfit(self, lane: _Lane, other: _Lane, t_us: int) -> str | None:
        """Why a value of that time fits into no sample, whether or not its partner is there."""
        if lane.has_near(t_us, self._interval_us / 2):
            return "repeated"
        if other.was_near(t_us, self._tolerance_us):
            return "late"
        return "out_of_order" if self._floor_us is not None and t_us <= self._floor_us else None

    def _give_up(self, before_us: float) -> None:
        self.dropped["unpaired"] += sum(lane.give_up(before_us) for lane in self._lanes.values())

    def _pair(self, torque: _Value, motion: _Value) -> Sample | None:
        self._floor_us = max(torque.t_us, motion.t_us)
        self._give_up(self._floor_us)
        times = (motion.sample_us, torque.sample_us, motion.t_us)
        time_us = next(time for time in times if time is not None)
        if not self._follows(time_us):
            self.drop("out_of_order", 2)
            return None
        self._last_us = time_us
        return Sample(time_us, torque.value, motion.value)

    def _follows(self, time_us: int) -> bool:
        """Whether a sample of that time comes after the last one; counts those missing between."""
        if self._last_us is None:
            return True
        if time_us < self._last_us - self._gap_us:  # the sample counter was re-anchored
            self.clock_set_back += 1
            return True
        self.dropped["missing"] += max(0, round((time_us - self._last_us) / self._interval_us) - 1)
        return time_us > self._last_us

    def _nonsense(self, kind: Kind, value: float) -> str | None:
        """Why a value is impossible for any axis."""
        if not math.isfinite(value):
            return "not_finite"
        return "absurd" if abs(value) > self._limits[kind] else None
