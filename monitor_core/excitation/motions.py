"""Motions of a drive under a designed signal, as large as its limits allow: by a torque alone, or with a controller.

A drive without a controller drifts: with friction it integrates the torque once, without it twice.  So an offset
balances the mean, and pulses in the fades move the drive to where its motion has room on both sides, and back to rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine_signals import Complex, Multisine
from monitor_core.excitation.planned_drive import Controller, Motion, Plant


@dataclass(frozen=True)
class Schedule:
    """In samples: a warm-up of one period ``N``, whose first ``fade`` samples fade in; ``periods``; ``fade`` out.

    Raises:
        ValueError: no period; a fade longer than a period, or shorter than four samples.
    """

    N: int
    periods: int
    fade: int

    def __post_init__(self) -> None:
        if self.periods < 1:
            raise ValueError(f"{self.periods} periods: at least one is needed")
        if not 4 <= self.fade <= self.N:
            raise ValueError(f"a fade of {self.fade} samples: need 4 to {self.N}, a period")

    @property
    def samples(self) -> int:
        """Of the whole record."""
        return self.N * (1 + self.periods) + self.fade

    @property
    def evaluated(self) -> slice:
        """The samples of the whole periods."""
        return slice(self.N, self.N * (1 + self.periods))

    def window(self) -> Floats:
        """Rises from 0 to 1 and falls again (samples,), with continuous speed and acceleration."""
        t = np.arange(self.fade) / self.fade
        ramp = t**3 * (10 - 15 * t + 6 * t**2)
        middle = np.ones(self.samples - 2 * self.fade)
        return np.concatenate([ramp, middle, 1 - ramp])

    def repeated(self, signal: Multisine) -> Floats:
        """The signal throughout the record (samples,); the first evaluated period starts with its phase zero."""
        return np.resize(signal.samples(), self.samples)

    def pulses(self) -> Floats:
        """Two pulses in each fade (4, samples), one of one sign and one of both, which move the drive to a position."""
        phase = np.pi * np.arange(self.fade) / self.fade
        shapes = np.array([np.sin(phase) ** 2, np.sin(phase) * np.sin(2 * phase)])
        out = np.zeros((4, self.samples))
        out[:2, : self.fade] = shapes
        out[2:, -self.fade :] = shapes
        return out


# --- A torque without a position controller, which moves the drive and brings it back ---------------------------------


_CORRECTIONS = 7
_CLOSE = 1e-3
"""Of the largest angle, and of the largest speed: so far the drive may end from rest."""
_RESTS = 0.05
"""Of the largest speed: more is no rest at the end."""
_DRIFT = 10.0
"""So much worse than a motion off the middle is one that leaves it further with every period."""
_STEP = 0.02
"""For the slopes, in rms values of the signal."""
_LINEAR, _NONLINEAR = (np.inf, np.inf, 0.0), (0.2, 0.5, 0.03)
"""The range in which the linearised drive is used and the largest pulse, in rms values of the signal, and the weight
against pulses: friction damps them, and keeps the drive from running away."""


class ExcitationError(ValueError):
    """An experiment that cannot be planned; the text says what would be right."""


@dataclass(frozen=True)
class OpenLoop:
    """Motions of a plant under a torque signal of any amplitude.

    Raises:
        ExcitationError: in use, if the drive does not stay where it is put.
    """

    plant: Plant
    schedule: Schedule
    signal: Multisine

    @cached_property
    def planned_angle(self) -> Floats:
        """Angle in the steady state of the linear drive (samples,), with the same room on both sides."""
        angle = self.schedule.repeated(self.signal.through(self.plant.response(self.signal.frequency_hz)[0]))
        return np.asarray(angle - (angle.max() + angle.min()) / 2)

    @cached_property
    def _corrections(self) -> Floats:
        """Shapes of torque (samples, 5), each 1 N m high."""
        return np.vstack([np.ones(self.schedule.samples), self.schedule.pulses()]).T

    def move(self, size: float) -> Motion:
        """The motion (samples, 1) with the signal scaled by a factor."""
        from scipy.optimize import lsq_linear  # 16 MB, which the daemon does not need

        wanted = size * self.schedule.window() * self.schedule.repeated(self.signal)
        step_size = size * self.signal.rms
        reach, highest, reluctance = _LINEAR if self.plant.is_linear else _NONLINEAR
        # At first no pulses, and the offset that the drive needs at rest.
        c = np.append(self.plant.countered(np.zeros(1), np.zeros(1)), np.zeros(4))
        largest = np.array([np.inf, *[highest * step_size] * 4])
        best: tuple[float, Motion] | None = None
        for _ in range(_CORRECTIONS):
            tried = c + _STEP * step_size * np.vstack([np.zeros(5), np.eye(5)])
            with np.errstate(all="ignore"):
                motion = self.plant.moved(wanted[:, None] + self._corrections @ tried.T)
            misses = np.vstack([self._misses(motion, size), reluctance * tried.T[1:] / step_size])
            if not np.isfinite(misses).all():
                break
            worst = float(np.linalg.norm(misses[:, 0]))
            if best is None or worst < best[0]:
                best = worst, motion
            if worst < _CLOSE:
                break
            slopes = (misses[:, 1:] - misses[:, :1]) / _STEP
            room = (
                np.minimum(largest - c, reach * step_size),
                np.maximum(-largest - c, -reach * step_size),
            )
            c = (
                c
                + step_size * lsq_linear(slopes, -misses[:, 0], (room[1] / step_size, room[0] / step_size)).x
            )
        return self._checked(best)

    def _misses(self, motion: Motion, size: float) -> Floats:
        """Errors of the mean angle, of its drift, and of the end from rest at zero.

        (periods + 3, W), over the largest planned angle and speed.
        """
        s, planned = self.schedule, size * self.planned_angle
        ranges = [slice(s.fade, s.N)] if s.fade < s.N else []
        ranges += [slice(s.N * k, s.N * (k + 1)) for k in range(1, s.periods + 1)]
        off = np.array([motion.angle[r].mean(axis=0) - planned[r].mean() for r in ranges])
        off = np.vstack([off.mean(axis=0, keepdims=True), _DRIFT * np.diff(off, axis=0)])
        top, fast = np.abs(planned).max(), np.abs(np.diff(planned)).max() / self.plant.interval_s
        return np.vstack([off / top, motion.angle[-1] / top, motion.speed[-1] / fast])

    def _checked(self, best: tuple[float, Motion] | None) -> Motion:
        """Friction may keep the drive from returning completely; but it must be at rest."""
        if best is None or (speed := np.abs(best[1].speed[:, 0]))[-1] > _RESTS * speed.max():
            raise ExcitationError(_NOT_HELD if self.plant.bears_weight else _NO_REST)
        torque, angle, speed, inputs = best[1]
        return Motion(torque[:, :1], angle[:, :1], speed[:, :1], inputs)


_ELSE = "plan a motion for its controller, with speed or angle as the reference"
_NOT_HELD = f"a torque alone does not keep this drive in its place (its weight moves it away): {_ELSE}"
_NO_REST = f"a torque alone does not bring this drive back to rest: raise the limits, or {_ELSE}"


# --- A reference for the position controller, under which the drive gets the designed torque --------------------------


_BANDWIDTH = 2.0
"""rad/s, of the controller that stands for a good one: it only keeps the drive from drifting away."""


@dataclass(frozen=True)
class ClosedLoop:
    """Motions of a plant that follows a reference, with the torque signal at a given amplitude.

    Without a ``controller`` the real one is assumed to follow well: the reference is the linear motion under the
    signal, and the torque along it is known beforehand.  With a controller, the reference makes it command the signal.

    Raises:
        ExcitationError: the controller does not hold the drive.
    """

    plant: Plant
    schedule: Schedule
    signal: Multisine
    controller: Controller | None = None

    def __post_init__(self) -> None:
        if not self.plant.held_together_by(self._controller):
            c = self._controller
            raise ExcitationError(
                f"the drive is not stable with kp = {c.kp:g} N m/rad and kd = {c.kd:g} N m s/rad"
            )

    @cached_property
    def _controller(self) -> Controller:
        if self.controller is not None:
            return self.controller
        J = self.plant.inertia
        return Controller(J * _BANDWIDTH**2, J * _BANDWIDTH)

    @cached_property
    def planned_angle(self) -> Floats:
        """Angle of the reference (samples,), from rest at zero and back, with the same room on both sides."""
        G = self.plant.response(self.signal.frequency_hz)[0]
        if self.controller is not None:
            omega = 2 * np.pi * self.signal.frequency_hz
            G = G + 1 / (self.controller.kp + 1j * omega * self.controller.kd)
        angle = self.schedule.repeated(self.signal.through(G))
        return np.asarray(self.schedule.window() * (angle - (angle.max() + angle.min()) / 2))

    @cached_property
    def _references(self) -> Floats:
        """Angle and its derivative (2, samples)."""
        return np.array([self.planned_angle, self._filtered(lambda f: 2j * np.pi * f)])

    @cached_property
    def _forward(self) -> Floats:
        """The torque along the linear motion (samples,), from the inverse of the drive's frequency response."""
        return self._filtered(lambda f: 1 / self.plant.response(f)[0])

    def _filtered(self, response: Callable[[Floats], Complex]) -> Floats:
        """The planned angle through a frequency response, below twice the highest line."""
        N = len(self.planned_angle)
        spectrum = np.fft.rfft(self.planned_angle)
        frequency = np.arange(len(spectrum)) / (N * self.plant.interval_s)
        top = min(2 * float(self.signal.frequency_hz.max()), 0.4 / self.plant.interval_s)
        used = (frequency > 0) & (frequency <= max(top, float(self.signal.frequency_hz.max())))
        spectrum[~used] = 0
        spectrum[used] *= response(frequency[used])
        return np.fft.irfft(spectrum, N)

    def reference(self, size: float) -> Floats:
        """Angle [rad] and speed [rad/s] (2, samples) that the controller must follow."""
        return size * self._references

    def move(self, size: float) -> Motion:
        """The motion (samples, 1) with the signal scaled by a factor."""
        angle, speed = self.reference(size)
        forward = np.zeros(len(angle))
        if self.controller is None:
            forward = size * self._forward + self.plant.countered(angle, speed)
        motion = self.plant.moved(forward[:, None], np.array([angle, speed]), self._controller)
        if not all(math.isfinite(np.abs(x).max()) for x in motion):
            raise ExcitationError("the drive runs away from its controller")
        return motion


# --- The largest amplitude at which torque, speed and angle stay within their limits ----------------------------------


_TRIALS = 12
_FULL = 0.99
"""An amplitude that uses so much of a limit is the largest."""


@dataclass(frozen=True)
class Limits:
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
        """Limits by quantity."""
        return {"torque": self.torque, "speed": self.speed, "angle": self.angle}

    def used(self, motion: Motion) -> dict[str, float]:
        """Largest values over limits, by quantity."""
        peaks = {"torque": motion.torque, "speed": motion.speed, "angle": motion.angle}
        return {name: float(np.abs(peaks[name]).max()) / limit for name, limit in self.by_name().items()}


class Fitted(NamedTuple):
    """An amplitude within the limits, its motion, and the limiting quantity."""

    size: float
    motion: Motion
    binding: str


def fitted(move: Callable[[float], Motion], limits: Limits, size: float) -> Fitted:
    """The largest amplitude within the limits, from a first guess, with its motion (samples, 1).

    Peaks grow with the amplitude, but not quite in proportion: friction takes its part of a small one.

    Raises:
        ExcitationError: no amplitude is small enough.
    """
    below: tuple[float, float] = (0.0, 0.0)
    above: tuple[float, float] | None = None
    best: Fitted | None = None
    for _ in range(_TRIALS):
        motion = move(size)
        shares = limits.used(motion)
        binding = max(shares, key=lambda name: shares[name])
        if shares[binding] <= 1:
            below, best = (size, shares[binding]), Fitted(size, motion, binding)
            if shares[binding] > _FULL:
                break
        else:
            above = size, shares[binding]
        size = _next(below, above)
    if best is None:
        raise ExcitationError(f"the {binding} limit does not hold, however small the signal: {_why(binding)}")
    return best


def _next(below: tuple[float, float], above: tuple[float, float] | None) -> float:
    """Amplitude where a line through the two points reaches slightly less than the limit, and never close to either."""
    aim = (1 + _FULL) / 2
    if above is None:
        return below[0] * min(4.0, aim / max(below[1], 1e-9))
    if not math.isfinite(above[1]):
        return (below[0] + above[0]) / 2
    share = (aim - below[1]) / (above[1] - below[1])
    return below[0] + min(max(share, 0.05), 0.95) * (above[0] - below[0])


def _why(binding: str) -> str:
    if binding == "torque":
        return "to bear the drive's weight, friction or offset already takes more"
    return "the drive moves further already while its weight, friction or offset is being borne"
