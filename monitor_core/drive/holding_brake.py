"""Brakes that hold an axis: it stands, although its motor bears nothing of its weight.

Many controllers close the brakes after some seconds without a motion, and switch the motors off.  The measured torque
is zero then, and a predictor expects the axis to fall.  An axis is held from the sample on at which, for HOLD_S,

* its weight would accelerate it more than Coulomb friction can prevent,
* the torque balances less than half of the weight,
* it has moved less than a tenth of what the weight would move it in that time.

So an axis whose sensor is stuck while it is controlled is not held, nor is one that has lost its torque and falls.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.rigid_motion import rigid_accelerations
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE, WEIGHT

HOLD_S = 0.1
_BORNE = 0.5
"""Share of the weight that the torque of a controlled axis balances at least."""
_MOVED = 0.1
"""Share of the distance, or of the speed, that the weight alone would have caused."""


class _Stand(NamedTuple):
    """The sample since which the axis has stood without a torque."""

    since_us: int
    y: float
    last_us: int


class HoldingBrake:
    """Whether a brake holds an axis, from sample to sample; blocks may be split anywhere."""

    def __init__(self, model: AxisModel) -> None:
        kinds = np.array(model.drive.inputs)
        by_input = rigid_accelerations(model.drive, model.nominal)
        self._of_torque = float(by_input[kinds == TORQUE].sum())
        self._of_friction = float(abs(by_input[kinds == COULOMB]).sum())
        self._of_weight = float(by_input[kinds == WEIGHT].sum())
        self._constant = float(by_input[kinds == ONE].sum())
        ratio = model.drive.matrix("ratio", model.nominal)[:, 0]
        self._turning = [
            (float(by_input[c]), float(ratio[c]), np.cos if kinds[c] == COSINE else np.sin)
            for c in np.flatnonzero((kinds == COSINE) | (kinds == SINE)).tolist()
            if by_input[c]
        ]
        self._angle = model.drive.output == "angle"
        self._stand: _Stand | None = None

    @property
    def possible(self) -> bool:
        """Whether the axis bears a weight that could move it."""
        turning = sum(abs(a) for a, _, _ in self._turning)
        return bool(self._of_weight or turning or abs(self._constant) > self._of_friction)

    @property
    def holds(self) -> bool:
        """Whether the brake held the axis at the last sample."""
        stand = self._stand
        return stand is not None and stand.last_us - stand.since_us >= HOLD_S * 1e6

    def take(self, t_us: NDArray[np.int64], u: Floats, y: Floats, weight: Floats | None) -> Bools:
        """Whether the brake holds the axis at the samples (N,).

        Args:
            t_us: times of the samples (N,) [us].
            u: torques (N,) [N m].
            y: measured output (N,), rad or rad/s; NaN: not measured.
            weight: torque of the weight (N,), if it is an input of the drive.
        """
        falls = self._falls(y, weight)
        with np.errstate(invalid="ignore"):
            idle = (abs(falls) > self._of_friction) & (abs(self._of_torque * u) < _BORNE * abs(falls))
        idle &= np.isfinite(y)
        held, stand = np.zeros(len(t_us), np.bool_), self._stand
        near = _MOVED * abs(falls) * (HOLD_S**2 / 2 if self._angle else HOLD_S)
        last = -1
        for k in np.flatnonzero(idle).tolist():
            now_us, at = int(t_us[k]), float(y[k])
            broken = stand is None or k != last + 1 or now_us < stand.last_us
            if stand is None or broken or not abs(at - (stand.y if self._angle else 0.0)) <= near[k]:
                stand = _Stand(now_us, at, now_us)
            else:
                stand = stand._replace(last_us=now_us)
            held[k] = now_us - stand.since_us >= HOLD_S * 1e6
            last = k
        if len(t_us):
            self._stand = stand if last == len(t_us) - 1 else None
        return held

    def _falls(self, y: Floats, weight: Floats | None) -> Floats:
        """Acceleration by the weight alone (N,) [rad/s^2]; NaN: unknown."""
        falls = np.full(len(y), self._constant)
        if weight is not None:
            falls = falls + self._of_weight * weight
        for acceleration, ratio, function in self._turning:
            falls = falls + acceleration * function(ratio * y)
        return falls
