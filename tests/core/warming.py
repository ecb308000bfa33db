"""The axis of ``mismatch`` whose gearbox warms up by the power of its own friction, and that has no thermometer.

Its warmth has two time constants, and viscous friction, Coulomb friction and the Stribeck part fall with it
exponentially, each by another amount: another law than the monitor's, which has one time constant and straight lines.
The axis can also be switched off: no sample comes, and it cools.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from tests.core.mismatch import INTERVAL_S, NOMINAL, STEP, Block, MismatchPlant, Truth, redrawn
from tests.core.plants import redrawn_fields

STEP_S = 1.0
"""The warmth is that of the beginning of each such step."""


@dataclass(frozen=True)
class Warming:
    """How a gearbox warms up; a warmth of 1 is that of a lasting friction power of ``watts``."""

    watts: float = 20.0
    fast_s: float = 240.0
    slow_s: float = 1200.0
    fast: float = 0.35
    """Share of the warmth with the fast time constant"""
    fm: float = 0.5
    """Friction falls like exp(-this warmth)"""
    fc: float = 0.3
    stribeck: float = 0.4


def redrawn_warming(rng: np.random.Generator) -> tuple[Truth, Warming]:
    """An axis with all values up to 0.3 (of its masses 0.2) more or less."""
    return redrawn(rng), redrawn_fields(rng, Warming(), 0.3)


class Warmth:
    """What the power of its friction has left in a gearbox."""

    def __init__(self, warming: Warming) -> None:
        self._warming = warming
        self._parts = np.zeros(2)  # fast, slow
        self.hall = 0.0
        """Warmth of the hall, beyond that of the day of its first record"""

    @property
    def now(self) -> float:
        return float(self._parts.sum()) + self.hall

    def fall(self, friction: str) -> float:
        """Factor by which a kind of friction is smaller than in a cold gearbox."""
        return float(np.exp(-getattr(self._warming, friction) * self.now))

    def take(self, seconds: float, watts: float = 0.0) -> None:
        w = self._warming
        kept = np.exp(-seconds / np.array([w.fast_s, w.slow_s]))
        self._parts = kept * self._parts + (1 - kept) * [w.fast, 1 - w.fast] * watts / w.watts


class WarmingPlant(MismatchPlant):
    """The plant in time, cold at first."""

    def __init__(self, rng: np.random.Generator, truth: Truth = NOMINAL, warming: Warming | None = None) -> None:
        super().__init__(truth, rng)
        self._warmth = Warmth(warming or Warming())
        self._broken: dict[str, float] = dict.fromkeys(("kT", "fc", "fm"), 1.0)

    @property
    def warmth(self) -> float:
        """0: cold; 1: as after a lasting friction power of ``Warming.watts``."""
        return self._warmth.now

    def enter(self, hall: float) -> None:
        """From now on the hall is warmer by this warmth than on the first day."""
        self._warmth.hall = hall

    def break_down(self, fault: Mapping[str, float]) -> None:
        """From now on kT, fc and fm have so many times their values."""
        self._broken.update(fault)

    def take(
        self,
        seconds: float,
        fault: Mapping[str, float] | None = None,
        test: Floats | None = None,
        push: float = 0.0,
    ) -> Block:
        """The next samples, a whole number of steps; the rest as of the other plant."""
        values, broken = self._truth.values, {**self._broken, **(fault or {})}
        n, begin = round(STEP_S / INTERVAL_S), self._at
        torques, angles = list[Floats](), list[Floats]()
        for k in range(round(seconds / STEP_S)):
            falls = {name: self._warmth.fall(name) for name in ("fm", "fc", "stribeck")}
            fm, fc = (values[name] * broken[name] * falls[name] for name in ("fm", "fc"))
            friction = np.array([fc, self._truth.stribeck * falls["stribeck"], values["tau0"] + push])
            part = None if test is None else test[k * n : (k + 1) * n]
            u, y = self._moved(np.full(n, fm - values["fm"]), friction, broken["kT"], part)
            speed = np.abs(np.diff(y)) / INTERVAL_S
            self._warmth.take(STEP_S, float(np.mean(fm * speed**2 + fc * speed)))
            torques.append(u)
            angles.append(y)
        y = np.round(np.concatenate(angles) / STEP) * STEP
        t_us = np.round((begin + np.arange(y.size)) * INTERVAL_S * 1e6).astype(np.int64)
        return Block(t_us, np.concatenate(torques), y, np.full(y.size, np.nan))

    def rest(self, seconds: float) -> None:
        """Switched off for so long; then the motion goes on where it was."""
        self._at += round(seconds / INTERVAL_S)
        self._moves.wait(seconds)
        self._warmth.take(seconds)

    def pause(self, seconds: float) -> None:
        """The next motion begins so much later; until then the axis is held where it is."""
        self._moves.pause(self._at * INTERVAL_S, seconds)
