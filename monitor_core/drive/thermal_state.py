"""Warm-up of an axis without a thermometer: a thermal state, driven by the power that friction dissipates.

    heat' = (P_friction - heat) / tau,     P_friction = fm w^2 + fc |w|

The heat is in watts: during a steady motion it converges to the friction power of that motion.  The solution over an
interval is exact for a constant power: heat+ = a heat + (1 - a) P with a = exp(-h / tau).  fm and fc are fixed numbers,
so that a fault that changes friction does not change the heat.  Friction follows the heat in the same way as it would
follow a measured temperature (``operating_conditions``).

While no samples come, the axis is taken to stand still and cool, unless its angle shows afterwards that it has moved.
A gearbox has more than one time constant, and it cools more slowly the longer it stands.  So the standard deviation of
the remaining heat is the difference to a gearbox that cools half as fast.  In a pause in which nothing could have been
received (``unwatched``), the axis may also have moved and come back.  If it may have moved unseen, or has, the heat is
between that of an axis that stood and that of one at the largest power: the longer the pause, the less is known.  So
the seconds of a restart in the middle of a motion change little, and after hours nothing is known.  After a clock was
set, and at an unknown start, the heat may be anything from 0 to the largest of the records.  Its variance then falls
like a^2, and with observations (``monitoring.heat_observer``), to that of the model error.

Where records show two time constants (of the parts that rub, and of their surroundings), the heat is the weighted mean
of two such parts, both driven by the same power.

The power says how much warmer the gearbox is than its surroundings, but friction depends on its temperature.  So a
hall that is colder or warmer than in the records adds to the heat: the ambient heat, in the same unit, which no motion
shows in advance.  It is a second state, an Ornstein-Uhlenbeck process with the standard deviation ``ambient`` and a
time constant of some hours.  Its value and its covariance with the error of the heat come from observations.

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
from monitor_core.drive.measured_speed import MeasuredSteps

HEAT = "heat"
"""Name of the derived signal [W]; with a thermal model no measured signal can have this name."""
TEMPERATURE = "temperature"
"""Name of a measured signal that friction may follow instead, in any unit"""
AMBIENT_TAU_S = 8 * 3600.0
"""Time constant of the temperature of a hall [s]: after a night it is another one, after an hour nearly the same."""
GAP_S = 1.0
"""A longer interval between two samples is a pause."""
MOVED = 1.0
"""An axis whose angle at the sensor [rad] differs by more than this after a pause has moved meanwhile."""
_MOST_POWER = 100.0
"""Friction power of one step at the most, in units of the largest heat of the records; more comes from a wrong angle"""

ThermalStart = Literal["cold", "unknown"]
Unwatched = Literal["stood", "unknown"]
"""Assumed motion during a pause in which nothing could have been received, if the angle is the same after it."""


class Fast(NamedTuple):
    """A faster part of the heat: its time constant [s], and its share of the heat of a lasting motion."""

    tau_s: float
    share: float


@dataclass(frozen=True)
class ThermalModel:
    """Model of the warm-up of an axis.

    Args:
        tau_s: time constant [s]; of two the slower one.
        fm: viscous friction for the power [N m s/rad], at the sensor.
        fc: Coulomb friction for the power [N m].
        largest: largest heat in the records [W].
        start: assumed heat at an unknown start: cold, or any heat up to the largest.
        unwatched: assumed motion between a saved state and the first sample: the axis stood, or it may have moved and
            come back.
        error: standard deviation [W] of the model error, which remains when the heat is known.
        fast: the part with the shorter time constant; None: there is only one time constant.
        ambient: standard deviation [W] of the ambient heat; 0: the surroundings are always those of the records.

    Raises:
        ValueError: a value is out of its range.
    """

    tau_s: float
    fm: float
    fc: float
    largest: float
    start: ThermalStart = "unknown"
    unwatched: Unwatched = "stood"
    error: float = 0.0
    fast: Fast | None = None
    ambient: float = 0.0

    def __post_init__(self) -> None:
        for name in ("tau_s", "largest"):
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} = {getattr(self, name)}: need a finite value greater than zero")
        if not (0 <= self.fm < math.inf and 0 <= self.fc < math.inf and self.fm + self.fc > 0):
            raise ValueError(f"fm = {self.fm}, fc = {self.fc}: need finite values, at least zero, and one above")
        for name in ("error", "ambient"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} = {getattr(self, name)}: need a finite value, at least zero")
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
        """Share of the heat left after ``seconds`` without motion if all parts are equally warm; see ``cooled``."""
        return sum(share * math.exp(-seconds / tau_s) for tau_s, share in self.parts)

    def cooled(self, heats: Sequence[float], seconds: float) -> tuple[float, ...]:
        """Heat [W] of each part after ``seconds`` without motion."""
        return tuple(heat * math.exp(-seconds / tau_s) for heat, (tau_s, _) in zip(heats, self.parts, strict=True))

    def mean(self, heats: Sequence[float]) -> float:
        """The heat [W] of parts with these heats [W]."""
        return sum(share * heat for heat, (_, share) in zip(heats, self.parts, strict=True))


class ThermalState:
    """The heat of one axis and its uncertainty, from sample to sample; blocks may be split anywhere.

    The errors of the two states, the heat by friction and the ambient heat, have the covariance ``covariance``.
    """

    def __init__(self, model: ThermalModel) -> None:
        self.model = model
        self.parts = (0.0,) * len(model.parts)
        """Present heat of each part by friction [W]"""
        self.ambient = 0.0
        """Present ambient heat [W]"""
        self.known = True
        """Whether the heat is known well enough to test the parameters that follow it"""
        self.since_us: int | None = None
        """Time at which the heat became unknown, or was last observed; None: before the first sample"""
        self._P = np.diag([0.0, model.ambient**2])  # at _P_us
        self._P_us: int | None = None
        self._restored = False  # True until the first sample after a saved state was restored
        self.losses = 0
        """Number of times that the heat became unknown, or uncertain because the axis may have moved unseen"""
        self._now_us: int | None = None
        if model.start == "unknown":
            self._lose(None)

    @property
    def heat(self) -> float:
        """Now [W]; what is expected, where it is not known."""
        return self.model.mean(self.parts) + self.ambient

    @property
    def sd(self) -> float:
        """Standard deviation of the present heat [W], including the model error."""
        return math.hypot(self.sd_of_state, self.model.error)

    @property
    def sd_of_state(self) -> float:
        """Standard deviation [W] due to the heat at a start or a pause, or its observation, and the ambient heat."""
        return math.sqrt(max(float(self.covariance.sum()), 0.0))

    @property
    def covariance(self) -> Floats:
        """Covariance (2, 2) [W^2] of the errors of the heat by friction and of the ambient heat, now."""
        return self._covariance(self._now_us)

    def _covariance(self, t_us: int | None) -> Floats:
        passed_us = 0 if self._P_us is None or t_us is None else t_us - self._P_us
        passed_s = max(passed_us, 0) * 1e-6
        kept = np.array([self.model.kept(passed_s), math.exp(-passed_s / AMBIENT_TAU_S)])
        drifted = np.diag([0.0, (1.0 - kept[1] ** 2) * self.model.ambient**2])
        return np.asarray(self._P * np.outer(kept, kept) + drifted)

    def take(self, t_us: NDArray[np.int64], steps: MeasuredSteps) -> Floats:
        """The heat [W] at samples with times ``t_us`` (N,), from the steps to them."""
        N = len(t_us)
        if not N:
            return np.zeros(0)
        if self.since_us is None:
            self.since_us = self._P_us = int(t_us[0])
        h, gap = steps.interval_us, GAP_S * 1e6
        paused = h > gap
        lost, moved = h < -gap, paused & (steps.distance > MOVED)
        if self._restored and self.model.unwatched == "unknown":
            moved[0] = paused[0]
        self._restored = False
        distinct, which = np.unique(np.maximum(h, 0), return_inverse=True)
        # Value by value: the last bit of a vectorised exponential may depend on the index in the array.
        ones = (1.0,) * len(self.parts)
        a = np.array([self.model.cooled(ones, us * 1e-6) for us in distinct.tolist()]).T[:, which]
        power = np.minimum(self.model.power(steps.speed), _MOST_POWER * self.model.largest)
        brought = (1.0 - a) * np.where(paused, 0.0, power)
        heat, ends = np.full(N, math.nan), [0, *np.flatnonzero(lost | paused).tolist(), N]
        for first, end in pairwise(ends):
            if first == end:
                continue
            if lost[first]:
                self._lose(int(t_us[first]))
                a[:, first], brought[:, first] = 1.0, 0.0
            elif moved[first]:
                self._doubt(int(t_us[first]), int(h[first]) * 1e-6)
                a[:, first], brought[:, first] = 1.0, 0.0
            elif paused[first]:
                self._cool(int(t_us[first]), int(h[first]) * 1e-6)
            courses = [
                _course(kept, a[k, first:end].tolist(), brought[k, first:end].tolist())
                for k, kept in enumerate(self.parts)
            ]
            self.parts = tuple(course[-1] for course in courses)
            heat[first:end] = self.ambient
            for course, (_, share) in zip(courses, self.model.parts, strict=True):
                heat[first:end] += share * np.array(course)
        self._now_us = int(t_us[-1])
        return heat

    def _lose(self, t_us: int | None) -> None:
        """Set the heat to unknown: anything in its range."""
        self.parts, self.ambient = (self.model.largest / 2,) * len(self.parts), 0.0
        self._P, self._P_us = np.diag([self.heat**2, self.model.ambient**2]), t_us
        self.since_us, self.known = t_us, False
        self.losses += 1

    def _cool(self, t_us: int, seconds: float) -> None:
        """Increase the variance for a pause in which the axis stood; call before ``parts`` are updated for it."""
        left, slower = (self.model.mean(self.model.cooled(self.parts, s)) for s in (seconds, seconds / 2))
        before = self._elapse(t_us, seconds)
        self._P[0, 0] += (slower - left) ** 2
        if self._P.sum() > 2 * before:
            self.since_us = t_us

    def _doubt(self, t_us: int, seconds: float) -> None:
        """Set heat and variance after a pause in which the axis may have moved unseen, at up to the largest power."""
        usual, a = self.model.largest / 2, self.model.cooled((1.0,) * len(self.parts), seconds)
        self._elapse(t_us, seconds)
        self._P[0, 0] += ((1.0 - self.model.mean(a)) * usual) ** 2
        self.parts = tuple(left * heat + (1.0 - left) * usual for left, heat in zip(a, self.parts, strict=True))
        self.since_us, self.known = t_us, False
        self.losses += 1

    def _elapse(self, t_us: int, seconds: float) -> float:
        """Let a pause pass for the ambient heat and the covariance; returns the variance without what it has added."""
        P, kept = self._covariance(t_us - round(seconds * 1e6)), math.exp(-seconds / AMBIENT_TAU_S)
        decayed = np.array([self.model.kept(seconds), kept])
        self.ambient *= kept
        self._P, self._P_us, self._now_us = self._covariance(t_us), t_us, t_us
        return float(decayed @ P @ decayed)

    def observed(self, step: Floats, covariance: Floats, known: bool) -> None:
        """Correct both heats by an observation.

        Args:
            step: correction (2,) of the heat by friction and of the ambient heat [W].
            covariance: their covariance (2, 2) afterwards.
            known: whether the heat counts as known.
        """
        before = self.model.mean(self.parts)
        heat = min(max(before + float(step[0]), 0.0), self.model.largest)
        # Colder by the same share, warmer by the same amount: no part is below zero.
        if heat < before:
            self.parts = tuple(part * (heat / before) for part in self.parts)
        else:
            self.parts = tuple(part + (heat - before) for part in self.parts)
        if self.model.ambient > 0:
            # What no friction power explains is due to the surroundings.
            self.ambient += float(step[1]) + (before + float(step[0]) - heat)
        self._P, self._P_us = covariance.copy(), self._now_us
        np.fill_diagonal(self._P, np.maximum(covariance.diagonal(), 0.0))  # by rounding it may be below
        self.known, self.since_us = known, self._now_us

    def to_array(self) -> Floats:
        """The state (8 + parts,), to be saved; empty before the first sample."""
        if self._now_us is None or self.since_us is None or self._P_us is None:
            return np.zeros(0)
        P = self._P[0, 0], self._P[0, 1], self._P[1, 1]
        return np.array([*self.parts, self.ambient, *P, self._P_us, self.since_us, self._now_us, self.known])

    def restore(self, state: Floats) -> None:
        """Restore a state from ``to_array``.

        Raises:
            ValueError: the array does not have the form of such a state.
        """
        if not state.size:
            return
        k = len(self.parts)
        never_negative = [*range(k), k + 1, k + 3]  # parts and variances
        if state.shape != (k + 8,) or not np.isfinite(state).all() or not (state[never_negative] >= 0).all():
            raise ValueError("this is no state of a warm-up")
        *parts, ambient, of_heat, both, of_ambient, P_us, since_us, now_us, known = state.tolist()
        self.parts, self.ambient, self._P = tuple(parts), ambient, np.array([[of_heat, both], [both, of_ambient]])
        self._P_us, self.since_us, self._now_us, self.known = int(P_us), int(since_us), int(now_us), bool(known)
        self._restored = True


def _course(kept: float, shares: Sequence[float], brought: Sequence[float]) -> list[float]:
    """What a part becomes from sample to sample, of which a share is kept and to which so much is added."""
    course = list[float]()
    for share, more in zip(shares, brought, strict=True):
        kept = share * kept + more
        course.append(kept)
    return course
