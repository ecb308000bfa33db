"""Warm-up of an axis without a thermometer: a thermal state, driven by the power that friction dissipates.

    heat' = (P_friction - heat) / tau,     P_friction = fm w^2 + fc |w|

The heat is in watts: at a lasting motion it becomes that motion's friction power.  Over an interval the solution is
exact for a constant power, heat+ = a heat + (1 - a) P with a = exp(-h / tau).  fm and fc are fixed numbers, so that a
fault that changes friction does not change the heat.  Friction that follows the heat does so as it would follow a
measured temperature (``operating_conditions``).

An axis from which no sample comes stands, and cools; unless its angle says that it has moved meanwhile.  A gearbox has
more than one time constant, and it cools more slowly the longer it stands: what is left of its heat is known up to the
difference to one that cools half as fast (standard deviation).  While nothing could have been received (``unwatched``),
the axis may also have moved and come back: then less of its heat is known, the longer that was.  After that, after a
clock that was set, and at a start of which nothing is known, the heat may be anything from 0 to the largest of the
records.  Its variance then falls like a^2, and by what is observed (``monitoring.heat_observer``), to that of what the
model lacks.

The model is that of Simoni, Beschi, Legnani and Visioli (Robotica, doi 10.1017/S0263574717000509), with one state.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.measured_speed import Steps

HEAT = "heat"
"""Name of the derived signal [W]; no measured signal can have it beside a thermal model."""
GAP_S = 1.0
"""A longer interval between two samples is a pause."""
MOVED = 1.0
"""rad at the sensor: an axis that comes back from a pause so far away has moved meanwhile."""

ThermalStart = Literal["cold", "unknown"]
Unwatched = Literal["stood", "unknown"]
"""What an axis did in a pause in which nothing could have been received, and after which it is where it was."""


@dataclass(frozen=True)
class ThermalModel:
    """How an axis warms up.

    Args:
        tau_s: time constant [s].
        fm: viscous friction for the power [N m s/rad], at the sensor.
        fc: Coulomb friction for the power [N m].
        largest: heat in the records [W], at the most.
        start: how an axis begins of which nothing is known: cold, or at any heat up to the largest.
        unwatched: what an axis did between a saved state and its first sample: it stood, or it may have moved and come
            back.
        error: standard deviation [W] of what the heat is off by when it is known, as the model is not the axis.

    Raises:
        ValueError: a value out of its range.
    """

    tau_s: float
    fm: float
    fc: float
    largest: float
    start: ThermalStart = "unknown"
    unwatched: Unwatched = "stood"
    error: float = 0.0

    def __post_init__(self) -> None:
        for name in ("tau_s", "largest"):
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} = {getattr(self, name)}: need a finite value greater than zero")
        if not (0 <= self.fm < math.inf and 0 <= self.fc < math.inf and self.fm + self.fc > 0):
            raise ValueError(
                f"fm = {self.fm}, fc = {self.fc}: need finite values, at least zero, and one above"
            )
        if not 0 <= self.error < math.inf:
            raise ValueError(f"error = {self.error}: need a finite value, at least zero")

    def power(self, speed: Floats) -> Floats:
        """Friction power [W] (N,) at speeds [rad/s] (N,); 0 where the speed is unknown."""
        w = np.where(np.isfinite(speed), np.abs(speed), 0.0)
        return np.asarray(self.fm * w * w + self.fc * w)

    def kept(self, seconds: float) -> float:
        """a = exp(-h / tau): what is left of a heat after so long without motion."""
        return math.exp(-seconds / self.tau_s)


class ThermalState:
    """The heat of one axis and its variance, from sample to sample; blocks may be split anywhere."""

    def __init__(self, model: ThermalModel) -> None:
        self.model = model
        self.heat = 0.0
        """Now [W]; what is expected, where it is not known"""
        self.known = True
        """Whether it is known so well that what follows it can be tested"""
        self.since_us: int | None = None
        """When it became unknown, or was last observed; None: before the first sample"""
        self._variance = 0.0  # at that time
        self._restored = False  # and no sample has come since
        self.losses = 0
        """How often nothing has been known of it but its range"""
        self._now_us: int | None = None
        if model.start == "unknown":
            self._lose(None)

    @property
    def sd(self) -> float:
        """Standard deviation of the heat now [W], with what the model lacks."""
        return math.hypot(self.sd_of_start, self.model.error)

    @property
    def sd_of_start(self) -> float:
        """The part of it that is of a heat that was not known, or of its observation; it falls with time [W]."""
        passed_us = 0 if self.since_us is None or self._now_us is None else self._now_us - self.since_us
        return math.sqrt(self._variance) * self.model.kept(max(passed_us, 0) * 1e-6)

    def take(self, t_us: NDArray[np.int64], steps: Steps) -> Floats:
        """The heat [W] at samples (N,), with the steps to them."""
        N = len(t_us)
        if not N:
            return np.zeros(0)
        if self.since_us is None:
            self.since_us = int(t_us[0])
        h, gap = steps.interval_us, GAP_S * 1e6
        paused = h > gap
        lost = (h < -gap) | (paused & (steps.distance > MOVED))
        distinct, which = np.unique(np.maximum(h, 0), return_inverse=True)
        # One by one: a vectorised exponential may depend on the place in the array in its last bit.
        a = np.array([self.model.kept(us * 1e-6) for us in distinct.tolist()])[which]
        brought = (1.0 - a) * np.where(paused, 0.0, self.model.power(steps.speed))
        if self._restored and self.model.unwatched == "unknown" and h[0] > gap and not lost[0]:
            self._doubt(int(t_us[0]), float(a[0]))
            a[0], brought[0], paused[0] = 1.0, 0.0, False
        self._restored = False
        heat, ends = np.empty(N), [0, *np.flatnonzero(lost | paused).tolist(), N]
        for first, end in pairwise(ends):
            if first == end:
                continue
            if lost[first]:
                self._lose(int(t_us[first]))
                a[first], brought[first] = 1.0, 0.0
            elif paused[first]:
                self._cool(int(t_us[first]), int(h[first]) * 1e-6)
            kept, course = self.heat, list[float]()
            for share, more in zip(a[first:end].tolist(), brought[first:end].tolist(), strict=True):
                kept = share * kept + more
                course.append(kept)
            heat[first:end], self.heat = course, kept
        self._now_us = int(t_us[-1])
        return heat

    def _lose(self, t_us: int | None) -> None:
        """From now on nothing is known but the range."""
        self.heat = self.model.largest / 2
        self._variance, self.since_us, self.known = self.heat**2, t_us, False
        self.losses += 1

    def _cool(self, t_us: int, seconds: float) -> None:
        """After a pause in which it stood, before the heat is that of now: how far that may be off."""
        self._now_us, more = t_us, (self.model.kept(seconds / 2) - self.model.kept(seconds)) * self.heat
        before = self.sd_of_start
        if more > before:
            self._variance, self.since_us = before**2 + more**2, t_us
        elif before > 0:
            self._variance *= 1 + (more / before) ** 2

    def _doubt(self, t_us: int, a: float) -> None:
        """After a pause that keeps a of a heat: it may have stood, or worked at up to the largest power, or both."""
        more = (1.0 - a) * self.model.largest / 2
        self._variance = (a * self.sd_of_start) ** 2 + more**2
        self.heat, self.since_us, self._now_us, self.known = a * self.heat + more, t_us, t_us, False

    def observed(self, heat: float, sd: float, known: bool) -> None:
        """Set what was found of the heat now [W], and whether that is enough to test what follows it."""
        self.heat = min(max(heat, 0.0), self.model.largest)
        self._variance, self.known, self.since_us = sd**2, known, self._now_us

    def to_array(self) -> Floats:
        """The state (5,), to be saved; empty before the first sample."""
        if self._now_us is None or self.since_us is None:
            return np.zeros(0)
        return np.array([self.heat, self._variance, self.since_us, self._now_us, self.known], np.float64)

    def restore(self, state: Floats) -> None:
        """Continue from ``to_array``.

        Raises:
            ValueError: that is no such state.
        """
        if not state.size:
            return
        if state.shape != (5,) or not np.isfinite(state).all() or not (state[:2] >= 0).all():
            raise ValueError("this is no state of a warm-up")
        self.heat, self._variance = float(state[0]), float(state[1])
        self.since_us, self._now_us, self.known = int(state[2]), int(state[3]), bool(state[4])
        self._restored = True
