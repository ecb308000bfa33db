"""The axis of ``mismatch`` whose gearbox warms up by the power of its own friction, and that has no thermometer.

Its warmth has two time constants, and viscous friction, Coulomb friction and the Stribeck part fall with it
exponentially, each by another amount: another law than the monitor's, which has one time constant and straight lines.
The axis can also be switched off: no sample comes, and it cools.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats
from tests.core.mismatch import INTERVAL_S, NOMINAL, STEP, Block, MismatchPlant, Truth, redrawn

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
    truth, usual = redrawn(rng), Warming()
    changed = {name: getattr(usual, name) * rng.uniform(0.7, 1.3) for name in usual.__annotations__}
    return truth, replace(usual, **changed)


class WarmingPlant(MismatchPlant):
    """The plant in time, cold at first."""

    def __init__(
        self, rng: np.random.Generator, truth: Truth = NOMINAL, warming: Warming | None = None
    ) -> None:
        super().__init__(truth, rng)
        self._warming = warming or Warming()
        self._warmth = np.zeros(2)  # fast, slow
        self._broken: dict[str, float] = dict.fromkeys(("kT", "fc", "fm"), 1.0)

    @property
    def warmth(self) -> float:
        """Now."""
        return float(self._warmth.sum())

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
        w, values, broken = self._warming, self._truth.values, {**self._broken, **(fault or {})}
        n, begin = round(STEP_S / INTERVAL_S), self._at
        torques, angles = list[Floats](), list[Floats]()
        for k in range(round(seconds / STEP_S)):
            falls = {name: np.exp(-getattr(w, name) * self.warmth) for name in ("fm", "fc", "stribeck")}
            fm, fc = (values[name] * broken[name] * falls[name] for name in ("fm", "fc"))
            friction = np.array([fc, self._truth.stribeck * falls["stribeck"], values["tau0"] + push])
            part = None if test is None else test[k * n : (k + 1) * n]
            u, y = self._moved(np.full(n, fm - values["fm"]), friction, broken["kT"], part)
            speed = np.abs(np.diff(y)) / INTERVAL_S
            self._cool(STEP_S, float(np.mean(fm * speed**2 + fc * speed)))
            torques.append(u)
            angles.append(y)
        y = np.round(np.concatenate(angles) / STEP) * STEP
        t_us = np.round((begin + np.arange(y.size)) * INTERVAL_S * 1e6).astype(np.int64)
        return Block(t_us, np.concatenate(torques), y, np.full(y.size, np.nan))

    def rest(self, seconds: float) -> None:
        """Switched off for so long; then the motion goes on where it was."""
        self._at += round(seconds / INTERVAL_S)
        self._moves[:, 0] += seconds
        self._end = self._end[0] + seconds, self._end[1]
        self._cool(seconds, 0.0)

    def _cool(self, seconds: float, watts: float) -> None:
        w = self._warming
        for k, (tau_s, share) in enumerate(((w.fast_s, w.fast), (w.slow_s, 1 - w.fast))):
            kept = np.exp(-seconds / tau_s)
            self._warmth[k] = kept * self._warmth[k] + (1 - kept) * share * watts / w.watts
