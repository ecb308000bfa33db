"""Finds the turn of an arm per unit of the measured motion, from the torque of its weight.

Only a weight shows the unit of an angle in the torque: with another unit, inertia, friction and stiffness just have
other values.  The torque of a weight is a cosine of the arm's angle, so its period is a full turn of the arm.
"""

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import POSE, USUAL, WINDOWS, windowed_parts
from monitor_core.identification.weight.weight_balance import WeightBalance

_MAX_REMAINING = 0.5
"""A weight must reduce the torque that one mass leaves unexplained to at most this share."""
_WINDOW = 40
"""Number of samples in a window, as a weight changes slowly."""
_MAX_SAMPLES = 20_000
"""Largest number of samples that are used."""
_LEAST_TURN, _MOST_TURN = 0.25, 40.0
"""Range of the turn of the arm over the record, rad, that is searched."""
_STEP = 0.25
"""Step between trials, in rad at the ends of the motion."""
_SIGMAS = 3.0
_MODEL = 0.1
"""Share of the unexplained torque that may be due to errors of the model of one mass with a weight."""


class TurningWeight(NamedTuple):
    """A weight in the torque of a record."""

    ratio: float
    """Turn of the arm, rad, per unit of the motion"""
    least: float
    """Smallest and largest ratio with which the torque is explained about as well"""
    most: float


def turning_weight(record: Record) -> TurningWeight | None:
    """The weight that a record shows, the motion in any unit; None: it shows none, or no period of it."""
    used = record.select(slice(_MAX_SAMPLES)) if len(record) > _MAX_SAMPLES else record
    scale = speed_scales([used])[1]
    mass, pose = rigid_fits([used], [USUAL, POSE], scale)
    if mass is None or pose is None or 1 - pose.explained > _MAX_REMAINING * (1 - mass.explained):
        return None
    parts = [part for part in windowed_parts([used]) if len(part.u) > _WINDOW]
    if not parts:
        return None
    balance = WeightBalance(parts, _WINDOW, scale, moving=False)
    angles = [part.angle for part in parts]

    def unexplained(ratio: float) -> float:
        return balance.missed([balance.column(wave(ratio * a) for a in angles) for wave in (np.cos, np.sin)])

    trials = _trials(max(float(np.ptp(angle)) for angle in angles) or 1.0)
    left = np.array([unexplained(ratio) for ratio in trials])
    best = int(np.argmin(left))
    if left[best] > _MAX_REMAINING * balance.missed([]):
        return None
    # Independent equations beyond the values that are fitted.
    freedom = max(1.0, len(balance.torque) / WINDOWS - balance.rows.shape[1] - 2)
    as_good = np.flatnonzero(left < left[best] * (1 + max(_MODEL, _SIGMAS**2 / freedom)))
    first, last = int(as_good[0]), int(as_good[-1])
    if first == 0 or last == len(trials) - 1:
        return None
    return TurningWeight(_least(trials, left, best), float(trials[first - 1]), float(trials[last + 1]))


def _least(trials: Floats, left: Floats, best: int) -> float:
    """Where the parabola through the best trial and its neighbours is least."""
    before, at, after = left[best - 1 : best + 2]
    return float(trials[best] + (trials[best + 1] - trials[best]) * (before - after) / 2 / (before - 2 * at + after))


def _trials(extent: float) -> Floats:
    """Ratios that turn the arm by a part of a turn up to several over the record."""
    turns = np.arange(_LEAST_TURN, _MOST_TURN, _STEP)
    return np.asarray(turns / extent)
