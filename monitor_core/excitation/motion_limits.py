"""The largest amplitude at which torque, speed and angle stay within their limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monitor_core.excitation.open_loop import ExcitationError
from monitor_core.excitation.planned_drive import Motion

_STEPS = 12
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
    for _ in range(_STEPS):
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
