"""Brakes that hold an axis: it stands, although its motor bears nothing of its weight.

Many controllers close the brakes after some seconds without a motion, and switch the motors off.  The measured torque
is zero then, and a predictor expects the axis to fall.  An axis is held from the sample on at which, for HOLD_S,

* what the torque leaves of its weight would accelerate it more than Coulomb friction can prevent,
* the torque balances less than half of the weight,
* it has moved less than a tenth of what the weight would move it in that time,

until it has a torque, or moves by half of that.  So an axis whose sensor is stuck while it is controlled is not held,
nor is one that has lost its torque and falls.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import balance_of
from monitor_core.drive.friction_roles import friction_of, rigid_speeds
from monitor_core.drive.structure import Drive
from monitor_core.kernel.tables import ANGLE_FUNCTIONS, COULOMB, ONE, TORQUE, WEIGHT

HOLD_S = 0.1
_BORNE = 0.5
"""Share of the weight that the torque of a controlled axis balances at least."""
_STANDS, _MOVES = 0.1, 0.5
"""Shares of the distance, or of the speed, that the weight alone would have caused: an axis stands below the first;
one that is held moves beyond the second, as a noisy sample is no motion."""


class _Stand(NamedTuple):
    """The samples in which the axis has stood without a torque; ``y``: the angle, or the speed 0."""

    since_us: int
    y: float
    last_us: int

    @property
    def is_held(self) -> bool:
        return self.last_us - self.since_us >= HOLD_S * 1e6

    def is_near(self, y: float, fallen: float) -> bool:
        """Whether the axis still stands at y; ``fallen``: y if it had fallen for ``HOLD_S``."""
        return abs(y - self.y) <= (_MOVES if self.is_held else _STANDS) * fallen


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
            (float(by_input[c]), float(ratio[c]), ANGLE_FUNCTIONS[kind])
            for c, kind in enumerate(model.drive.inputs)
            if kind in ANGLE_FUNCTIONS and by_input[c]
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
        return self._stand is not None and self._stand.is_held

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
            borne = self._of_torque * u
            idle = (abs(falls + borne) > self._of_friction) & (abs(borne) < _BORNE * abs(falls))
        idle &= np.isfinite(y)
        held, stand = np.zeros(len(t_us), np.bool_), self._stand
        fallen = abs(falls) * (HOLD_S**2 / 2 if self._angle else HOLD_S)
        last = -1
        for k in np.flatnonzero(idle).tolist():
            now_us, at = int(t_us[k]), float(y[k])
            if stand is None or k != last + 1 or now_us < stand.last_us or not stand.is_near(at, fallen[k]):
                stand = _Stand(now_us, at if self._angle else 0.0, now_us)
            else:
                stand = stand._replace(last_us=now_us)
            held[k] = stand.is_held
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


def rigid_accelerations(drive: Drive, values: Mapping[str, float]) -> Floats:
    """Acceleration at the sensor (m,) of the drive as one rigid body by one unit of each input [rad/s^2].

    Without friction against the ground, the torques of springs and dampers cancel in the momentum: l A = 0 for one row
    vector l.  With r, the state that moves rigidly at a speed of 1 at the sensor, an input accelerates by l b / (l r).
    """
    free = {**values, **dict.fromkeys(friction_of(drive).viscous, 0.0)}
    A, B = drive.matrix("A", free), drive.matrix("B", values)
    d = balance_of(A)
    momentum = np.linalg.svd(A / d[:, np.newaxis] * d)[0][:, -1] / d
    return np.asarray(momentum @ B / (momentum @ rigid_speeds(drive, values)), np.float64)
