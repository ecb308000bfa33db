"""Motions of a drive under a designed signal, as large as its limits allow, from rest to rest.

With only a torque signal a drive drifts, as it integrates the torque once with friction, and twice without.  So the
linear motion under the signal is planned, and the drive is simulated with the torque that follows this motion.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine_signals import Multisine
from monitor_core.excitation.planned_drive import DriveMotion, Plant


@dataclass(frozen=True)
class ExperimentPhases:
    """Phases of an experiment, in samples.

    A warm-up of one period ``N``, whose first ``fade`` samples fade in; ``periods`` evaluated periods; ``fade`` out.
    """

    N: int
    periods: int
    fade: int

    @property
    def samples(self) -> int:
        """Number of samples of the record."""
        return self.N * (1 + self.periods) + self.fade

    @property
    def evaluated(self) -> slice:
        """The samples of the whole periods."""
        return slice(self.N, self.N * (1 + self.periods))

    def window(self) -> Floats:
        """Window (samples,) that rises from 0 to 1 and falls again, with continuous speed and acceleration."""
        t = np.arange(self.fade) / self.fade
        ramp = t**3 * (10 - 15 * t + 6 * t**2)
        middle = np.ones(self.samples - 2 * self.fade)
        return np.concatenate([ramp, middle, 1 - ramp])

    def repeated(self, signal: Multisine) -> Floats:
        """The signal throughout the record (samples,); the first evaluated period starts with its phase zero."""
        return np.resize(signal.samples(), self.samples)


class ExcitationError(ValueError):
    """An experiment that cannot be planned; the text says what would be right."""


# --- Motion that the drive follows, and its torque --------------------------------------------------------------------


_SOFT, _FIRM = 2.0, 4.0
"""Bandwidths of the simulated controller, rad/s.  For a drive that is not linear it also acts in the evaluated periods,
where the low bandwidth only prevents drift; for a linear one the high bandwidth moves the drive to its place before
them."""


@dataclass(frozen=True)
class PlannedMotion:
    """Motions of a plant along the linear motion under a torque signal, for any amplitude of the signal.

    The signal, and the torque for friction and weight along the motion, are known beforehand.  A simulated controller
    adds the remaining torque.  A linear drive needs it only before and after the evaluated periods, during which the
    torque is the signal itself plus a constant against an offset.  With Coulomb friction or weight it acts throughout,
    as such a drive does not quite follow the linear motion, and would drift away from it.  The torque of this
    simulation alone gives the same motion of the same drive; an axis with a good controller can follow the motion as a
    reference.
    """

    plant: Plant
    schedule: ExperimentPhases
    signal: Multisine

    @cached_property
    def _reference(self) -> Floats:
        """Angle and speed (2, samples) from rest at zero and back, centred between equal limits on both sides."""
        angle, speed = (
            self.schedule.repeated(self.signal.through(G)) for G in self.plant.response(self.signal.frequency_hz)
        )
        angle -= (angle.max() + angle.min()) / 2
        window = self.schedule.window()
        slope = np.gradient(window) / self.plant.interval_s
        return np.array([window * angle, window * speed + slope * angle])

    @cached_property
    def _forward(self) -> Floats:
        """Torque (samples,) that follows the reference for a linear drive; in the evaluated periods it is the signal.

        Before and after by the inverse of its frequency response, below twice the highest line: the fades contain next
        to nothing above.
        """
        angle = self._reference[0]
        spectrum = np.fft.rfft(angle)
        frequency = np.arange(len(spectrum)) / (len(angle) * self.plant.interval_s)
        highest = float(self.signal.frequency_hz.max())
        used = (frequency > 0) & (frequency <= max(highest, min(2 * highest, 0.4 / self.plant.interval_s)))
        spectrum[~used] = 0
        spectrum[used] /= self.plant.response(frequency[used])[0]
        torque = np.fft.irfft(spectrum, len(angle))
        evaluated = self.schedule.evaluated
        torque[evaluated] = self.schedule.repeated(self.signal)[evaluated]
        return torque

    @cached_property
    def _gains(self) -> Floats:
        """Gains of the controller on angle and speed at each sample (2, samples)."""
        bandwidth = _FIRM if self.plant.is_linear else _SOFT
        acts = np.ones(self.schedule.samples)
        if self.plant.is_linear:
            acts[self.schedule.evaluated] = 0.0
        return self.plant.inertia * np.outer([bandwidth**2, bandwidth], acts)

    def reference(self, size: float) -> Floats:
        """Angle [rad] and speed [rad/s] (2, samples) that a controller must follow."""
        return size * self._reference

    def move(self, size: float) -> DriveMotion:
        """The motion (samples,) with the signal scaled by a factor.

        Raises:
            ExcitationError: the drive does not follow.
        """
        angle, speed = self.reference(size)
        forward = size * self._forward + self.plant.countered(angle, speed)
        motion = self.plant.moved(forward, np.array([angle, speed]), self._gains)
        if not all(math.isfinite(np.abs(x).max()) for x in motion):
            raise ExcitationError("the simulated drive is unstable: it does not follow the controller")
        return motion


# --- Largest amplitude with which torque, speed and angle stay within their limits ------------------------------------


_TRIALS = 12
_FULL = 0.99
"""An amplitude that uses this share of a limit counts as the largest."""


@dataclass(frozen=True)
class MotionLimits:
    """Largest absolute values: motor torque [N m], speed [rad/s], angle from where the motion starts [rad].

    Raises:
        ValueError: none is given; one is not greater than zero.
    """

    torque: float = math.inf
    speed: float = math.inf
    angle: float = math.inf

    def __post_init__(self) -> None:
        for name, value in self.by_name().items():
            if not value > 0:
                raise ValueError(f"{name} limit {value}: must be greater than zero")
        if all(math.isinf(value) for value in self.by_name().values()):
            raise ValueError("no limit is given: torque, speed or angle must have one")

    def by_name(self) -> dict[str, float]:
        """The limits by quantity."""
        return {"torque": self.torque, "speed": self.speed, "angle": self.angle}

    def used(self, motion: DriveMotion) -> dict[str, float]:
        """Largest values over limits, by quantity."""
        peaks = {"torque": motion.torque, "speed": motion.speed, "angle": motion.angle}
        return {name: float(np.abs(peaks[name]).max()) / limit for name, limit in self.by_name().items()}


class FittedMotion(NamedTuple):
    """An amplitude within the limits, its motion, and the limiting quantity."""

    size: float
    motion: DriveMotion
    binding: str


def fitted(move: Callable[[float], DriveMotion], limits: MotionLimits, size: float) -> FittedMotion:
    """The largest amplitude within the limits, from a first guess, with its motion (samples,).

    Peaks grow with the amplitude, but not quite in proportion: friction reduces a small amplitude more.

    Raises:
        ExcitationError: no amplitude is small enough.
    """
    below: tuple[float, float] = (0.0, 0.0)
    above: tuple[float, float] | None = None
    best: FittedMotion | None = None
    for _ in range(_TRIALS):
        motion = move(size)
        shares = limits.used(motion)
        binding = max(shares, key=lambda name: shares[name])
        if shares[binding] <= 1:
            below, best = (size, shares[binding]), FittedMotion(size, motion, binding)
            if shares[binding] > _FULL:
                break
        else:
            above = size, shares[binding]
        size = _next(below, above)
    if best is None:
        raise ExcitationError(f"the {binding} limit does not hold, however small the signal: {_why(binding)}")
    return best


def _next(below: tuple[float, float], above: tuple[float, float] | None) -> float:
    """Amplitude at which a line through the two points reaches slightly less than the limit, not close to a point."""
    aim = (1 + _FULL) / 2
    if above is None:
        return below[0] * min(4.0, aim / max(below[1], 1e-9))
    if not math.isfinite(above[1]):
        return (below[0] + above[0]) / 2
    share = (aim - below[1]) / (above[1] - below[1])
    return below[0] + min(max(share, 0.05), 0.95) * (above[0] - below[0])


def _why(binding: str) -> str:
    if binding == "torque":
        return "the torque against weight, friction and offset alone exceeds it"
    return "the motion due to weight, friction and offset alone exceeds it"
