"""The two-axis arm of ``arm`` whose gearboxes warm up by the power of their own friction, without a thermometer.

Each gearbox warms up as that of ``warming`` does: with two time constants, friction falling exponentially.  The arm can
be switched off: no sample comes, and it cools.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from tests.core.arm import AXES, INTERVAL_S, Arm, ArmSamples, ArmTruth
from tests.core.arm import redrawn as redrawn_arm
from tests.core.warming import Warming

STEP_S = 1.0
"""The warmth is that of the beginning of each such step."""
WATTS = (30.0, 10.0)
"""Of shoulder and elbow: friction power that makes a warmth of 1."""


def redrawn_warming_arm(rng: np.random.Generator) -> tuple[ArmTruth, tuple[Warming, Warming]]:
    """An arm with all values up to 0.3 (of its masses 0.2) more or less."""
    truth = redrawn_arm(rng)

    def drawn(watts: float) -> Warming:
        usual = replace(Warming(), watts=watts)
        changed = {name: getattr(usual, name) * rng.uniform(0.7, 1.3) for name in usual.__annotations__}
        return replace(usual, **changed)

    return truth, (drawn(WATTS[0]), drawn(WATTS[1]))


class WarmingArm(Arm):
    """The arm in time, cold at first."""

    def __init__(self, truth: ArmTruth, warming: tuple[Warming, Warming], rng: np.random.Generator) -> None:
        super().__init__(truth, rng)
        self._warming = warming
        self._warmth = np.zeros((2, 2))  # of each axis: fast, slow

    @property
    def warmth(self) -> Floats:
        """Now, of both axes (2,)."""
        return np.asarray(self._warmth.sum(axis=1))

    def take(
        self,
        seconds: float,
        changes: Mapping[str, float] | None = None,
        test: Floats | None = None,
        pace: float = 1.0,
    ) -> ArmSamples:
        """The next samples, a whole number of steps; arguments as of the other arm."""
        n, parts = round(STEP_S / INTERVAL_S), list[ArmSamples]()
        for k in range(round(seconds / STEP_S)):
            own = dict(changes or {})
            for axis, name in enumerate(AXES):
                for friction in ("fm", "fc"):
                    fall = np.exp(-getattr(self._warming[axis], friction) * self.warmth[axis])
                    own[f"{name} {friction}"] = own.get(f"{name} {friction}", 1.0) * float(fall)
            part = super().take(STEP_S, own, None if test is None else test[k * n : (k + 1) * n], pace)
            speed = np.abs(np.diff(part.y, axis=0)) / INTERVAL_S
            watts = list[float]()
            for axis, name in enumerate(AXES):
                fm, fc = (own[f"{name} {x}"] * getattr(self.truth, x)[axis] for x in ("fm", "fc"))
                watts.append(float(np.mean(fm * speed[:, axis] ** 2 + fc * speed[:, axis])))
            self._cool(STEP_S, watts)
            parts.append(part)
        return ArmSamples(*(np.concatenate(pieces) for pieces in zip(*parts, strict=True)))

    def rest(self, seconds: float) -> None:
        """Switched off for so long; then the motion goes on where it was."""
        self._at += round(seconds / INTERVAL_S)
        for moves in self._moves:
            moves[:, 0] += seconds
        self._ends = [(begin + seconds, at) for begin, at in self._ends]
        self._cool(seconds, (0.0, 0.0))

    def _cool(self, seconds: float, watts: Sequence[float]) -> None:
        for axis, w in enumerate(self._warming):
            for k, (tau_s, share) in enumerate(((w.fast_s, w.fast), (w.slow_s, 1 - w.fast))):
                kept = np.exp(-seconds / tau_s)
                self._warmth[axis, k] = (
                    kept * self._warmth[axis, k] + (1 - kept) * share * watts[axis] / w.watts
                )
