"""Warm-up of an axis without a thermometer: a thermal state, driven by the power that friction dissipates.

    heat' = (P_friction - heat) / tau,     P_friction = fm w^2 + fc |w|

The heat is in watts: at a lasting motion it becomes that motion's friction power.  Over an interval the solution is
exact for a constant power, heat+ = a heat + (1 - a) P with a = exp(-h / tau).  fm and fc are fixed numbers, so that a
fault that changes friction does not change the heat.  Friction that follows the heat does so as it would follow a
measured temperature (``operating_conditions``).

Where records show two time constants (what rubs and what is around it), the heat is the weighted mean of two such
parts, both driven by the same power.

An axis from which no sample comes stands, and cools; unless its angle says that it has moved meanwhile.  A gearbox has
more time constants than the model, and it cools more slowly the longer it stands: what is left of its heat is known up
to the difference to one that cools half as fast (standard deviation).  While nothing could have been received
(``unwatched``), the axis may also have moved and come back: then less of its heat is known, the longer that was.  After
that, after a clock that was set, and at a start of which nothing is known, the heat may be anything from 0 to the
largest of the records.  Its variance then falls like a^2, and by what is observed (``monitoring.heat_observer``), to
that of what the model lacks.

The model is that of Simoni, Beschi, Legnani and Visioli (Robotica, doi 10.1017/S0263574717000509), with one state or
two.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

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


class Fast(NamedTuple):
    """A faster part of the heat: its time constant [s], and its share of the heat of a lasting motion."""

    tau_s: float
    share: float


@dataclass(frozen=True)
class ThermalModel:
    """How an axis warms up.

    Args:
        tau_s: time constant [s]; of two the slower one.
        fm: viscous friction for the power [N m s/rad], at the sensor.
        fc: Coulomb friction for the power [N m].
        largest: heat in the records [W], at the most.
        start: how an axis begins of which nothing is known: cold, or at any heat up to the largest.
        unwatched: what an axis did between a saved state and its first sample: it stood, or it may have moved and come
            back.
        error: standard deviation [W] of what the heat is off by when it is known, as the model is not the axis.
        fast: the part with another time constant; None: there is but one.

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
    fast: Fast | None = None

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
        if self.fast and not (0 < self.fast.tau_s < self.tau_s and 0 < self.fast.share < 1):
            raise ValueError(
                f"fast = {self.fast.tau_s, self.fast.share}: need a time constant between 0 and {self.tau_s}, and a"
                " share between 0 and 1"
            )

    def power(self, speed: Floats) -> Floats:
        """Friction power [W] (N,) at speeds [rad/s] (N,); 0 where the speed is unknown."""
        w = np.where(np.isfinite(speed), np.abs(speed), 0.0)
        return np.asarray(self.fm * w * w + self.fc * w)

    @property
    def parts(self) -> tuple[tuple[float, float], ...]:
        """Time constant [s] and share of each part of the heat."""
        if self.fast is None:
            return ((self.tau_s, 1.0),)
        return (self.tau_s, 1.0 - self.fast.share), self.fast

    def kept(self, seconds: float) -> float:
        """What is left of a heat after so long without motion, if all its parts were as warm; else see ``cooled``."""
        return sum(share * math.exp(-seconds / tau_s) for tau_s, share in self.parts)

    def cooled(self, heats: Sequence[float], seconds: float) -> tuple[float, ...]:
        """What is left of the heat [W] of each part."""
        return tuple(
            heat * math.exp(-seconds / tau_s) for heat, (tau_s, _) in zip(heats, self.parts, strict=True)
        )

    def mean(self, heats: Sequence[float]) -> float:
        """The heat [W] of these parts [W]."""
        return sum(share * heat for heat, (_, share) in zip(heats, self.parts, strict=True))


class ThermalState:
    """The heat of one axis and its variance, from sample to sample; blocks may be split anywhere."""

    def __init__(self, model: ThermalModel) -> None:
        self.model = model
        self.parts = (0.0,) * len(model.parts)
        """Heat of each part now [W]"""
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
    def heat(self) -> float:
        """Now [W]; what is expected, where it is not known."""
        return self.model.mean(self.parts)

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
        ones = (1.0,) * len(self.parts)
        a = np.array([self.model.cooled(ones, us * 1e-6) for us in distinct.tolist()]).T[:, which]
        brought = (1.0 - a) * np.where(paused, 0.0, self.model.power(steps.speed))
        if self._restored and self.model.unwatched == "unknown" and h[0] > gap and not lost[0]:
            self._doubt(int(t_us[0]), a[:, 0].tolist())
            a[:, 0], brought[:, 0], paused[0] = 1.0, 0.0, False
        self._restored = False
        heat, ends = np.zeros(N), [0, *np.flatnonzero(lost | paused).tolist(), N]
        for first, end in pairwise(ends):
            if first == end:
                continue
            if lost[first]:
                self._lose(int(t_us[first]))
                a[:, first], brought[:, first] = 1.0, 0.0
            elif paused[first]:
                self._cool(int(t_us[first]), int(h[first]) * 1e-6)
            courses = [
                _course(kept, a[k, first:end].tolist(), brought[k, first:end].tolist())
                for k, kept in enumerate(self.parts)
            ]
            self.parts = tuple(course[-1] for course in courses)
            for course, (_, share) in zip(courses, self.model.parts, strict=True):
                heat[first:end] += share * np.array(course)
        self._now_us = int(t_us[-1])
        return heat

    def _lose(self, t_us: int | None) -> None:
        """From now on nothing is known but the range."""
        self.parts = (self.model.largest / 2,) * len(self.parts)
        self._variance, self.since_us, self.known = self.heat**2, t_us, False
        self.losses += 1

    def _cool(self, t_us: int, seconds: float) -> None:
        """After a pause in which it stood, before the heat is that of now: how far that may be off."""
        left, slower = (self.model.mean(self.model.cooled(self.parts, s)) for s in (seconds, seconds / 2))
        self._now_us, more = t_us, slower - left
        before = self.sd_of_start
        if more > before:
            self._variance, self.since_us = before**2 + more**2, t_us
        elif before > 0:
            self._variance *= 1 + (more / before) ** 2

    def _doubt(self, t_us: int, a: Sequence[float]) -> None:
        """After a pause that keeps a of each part: it may have stood, or worked at up to the largest power, or both."""
        usual, kept = self.model.largest / 2, self.model.mean(a)
        self._variance = (kept * self.sd_of_start) ** 2 + ((1.0 - kept) * usual) ** 2
        self.parts = tuple(
            left * heat + (1.0 - left) * usual for left, heat in zip(a, self.parts, strict=True)
        )
        self.since_us, self._now_us, self.known = t_us, t_us, False

    def observed(self, heat: float, sd: float, known: bool) -> None:
        """Set what was found of the heat now [W], and whether that is enough to test what follows it."""
        heat, before = min(max(heat, 0.0), self.model.largest), self.heat
        # Colder by the same share, warmer by the same amount: no part is below zero.
        if heat < before:
            self.parts = tuple(part * (heat / before) for part in self.parts)
        else:
            self.parts = tuple(part + (heat - before) for part in self.parts)
        self._variance, self.known, self.since_us = sd**2, known, self._now_us

    def to_array(self) -> Floats:
        """The state (4 + parts,), to be saved; empty before the first sample."""
        if self._now_us is None or self.since_us is None:
            return np.zeros(0)
        rest = self._variance, self.since_us, self._now_us, self.known
        return np.array([*self.parts, *rest], np.float64)

    def restore(self, state: Floats) -> None:
        """Continue from ``to_array``.

        Raises:
            ValueError: that is no such state.
        """
        if not state.size:
            return
        k = len(self.parts)
        if state.shape != (k + 4,) or not np.isfinite(state).all() or not (state[: k + 1] >= 0).all():
            raise ValueError("this is no state of a warm-up")
        *parts, variance, since_us, now_us, known = state.tolist()
        self.parts, self._variance = tuple(parts), variance
        self.since_us, self._now_us, self.known = int(since_us), int(now_us), bool(known)
        self._restored = True


def _course(kept: float, shares: Sequence[float], brought: Sequence[float]) -> list[float]:
    """What a part becomes from sample to sample, of which a share is kept and to which so much is added."""
    course = list[float]()
    for share, more in zip(shares, brought, strict=True):
        kept = share * kept + more
        course.append(kept)
    return course
