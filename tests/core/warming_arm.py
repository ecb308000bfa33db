"""The two-axis arm of ``arm`` whose gearboxes warm up by the power of their own friction, without a thermometer.

Each gearbox warms up as that of ``warming`` does: with two time constants, friction falling exponentially.  The arm can
be switched off: no sample comes, and it cools.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from tests.core.arm import AXES, INTERVAL_S, Arm, ArmSamples, ArmTruth
from tests.core.arm import redrawn as redrawn_arm
from tests.core.plants import redrawn_fields
from tests.core.warming import Warming, Warmth

STEP_S = 1.0
"""The warmth is that of the beginning of each such step."""
WATTS = (30.0, 10.0)
"""Of shoulder and elbow: friction power that makes a warmth of 1."""


def redrawn_warming_arm(rng: np.random.Generator) -> tuple[ArmTruth, tuple[Warming, Warming]]:
    """An arm with all values up to 0.3 (of its masses 0.2) more or less."""
    truth = redrawn_arm(rng)
    shoulder, elbow = (redrawn_fields(rng, replace(Warming(), watts=watts), 0.3) for watts in WATTS)
    return truth, (shoulder, elbow)


class WarmingArm(Arm):
    """The arm in time, cold at first."""

    def __init__(self, truth: ArmTruth, warming: tuple[Warming, Warming], rng: np.random.Generator) -> None:
        super().__init__(truth, rng)
        self._warmth = [Warmth(each) for each in warming]

    @property
    def warmth(self) -> Floats:
        """Now, of both axes (2,)."""
        return np.array([warmth.now for warmth in self._warmth])

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
            for warmth, name in zip(self._warmth, AXES, strict=True):
                for friction in ("fm", "fc"):
                    own[f"{name} {friction}"] = own.get(f"{name} {friction}", 1.0) * warmth.fall(friction)
            part = super().take(STEP_S, own, None if test is None else test[k * n : (k + 1) * n], pace)
            speed = np.abs(np.diff(part.y, axis=0)) / INTERVAL_S
            for axis, name in enumerate(AXES):
                fm, fc = (own[f"{name} {x}"] * getattr(self.truth, x)[axis] for x in ("fm", "fc"))
                watts = float(np.mean(fm * speed[:, axis] ** 2 + fc * speed[:, axis]))
                self._warmth[axis].take(STEP_S, watts)
            parts.append(part)
        return ArmSamples(*(np.concatenate(pieces) for pieces in zip(*parts, strict=True)))

    def rest(self, seconds: float) -> None:
        """Switched off for so long; then the motion goes on where it was."""
        self._at += round(seconds / INTERVAL_S)
        for moves, warmth in zip(self._moves, self._warmth, strict=True):
            moves.wait(seconds)
            warmth.take(seconds)
