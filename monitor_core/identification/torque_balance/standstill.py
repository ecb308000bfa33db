"""Standstill of an axis that stops often, as in pick and place: there friction balances any torque.

The model of friction, tanh of the speed, has no such force: the model creeps, and a fit would explain the torque at
standstill by a wrong inertia or friction.  So this torque is replaced by the torque that keeps a model at rest: the
offset and the weight that the motion of the record shows.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.records.measured_record import Record, pieces
from monitor_core.identification.torque_balance.rigid_body import resting_torque, rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    AROUND,
    ONE_WAY,
    POSE,
    GridPart,
    least_speed,
    moves_one_way,
    rms_speed,
    speed_of,
    windowed_parts,
)

_EXPLAINED = 0.5
"""Least explained share of the torque; otherwise the torque that keeps the axis at rest is not known."""
_EDGE = 2 * AROUND
"""Number of samples at either end of a standstill that are not changed, as the axis may have begun to move."""
_CREEP, _CREEP_S = 0.1, 1.0
"""An axis that stands travels less than at this part of the speed for that time, or for as long as it stands: a slow
motion travels more, and its friction is that of the motion."""
_RARE = 0.025
"""Share of the samples, at either side, that are ignored as noise."""
_SLOW, _RESTING = 0.15, 0.005
"""Shares of the root mean square of the speed: below the first, friction follows the Stribeck curve, or sticks and
slips; below the second, on average over a second, an axis does not travel."""
_LEAST = 0.1
"""Least share of samples at standstill; otherwise the torque is not changed."""


class Standstill(NamedTuple):
    """Records in which the axis often stands, with the torque that keeps a model at rest there.

    ``speed``: below it the axis stands, rad/s at the sensor.  ``share``: of the samples whose torque was replaced.
    ``one_way``: the axis moves in one direction only.
    """

    records: tuple[Record, ...]
    speed: float
    share: float
    one_way: bool

    def held(self, records: Sequence[Record]) -> list[Record]:
        """Other records of the axis, in the same way; one that no rigid mass explains stays as it is."""
        found = (_held(record, self.speed, self.one_way) for record in records)
        return [record if held is None else held[0] for record, held in zip(records, found, strict=True)]


def find_standstill(records: Sequence[Record]) -> Standstill | None:
    """The records with the resting torque at standstill; None: the axis rarely stands, or that torque is not known."""
    slowest = least_speed(windowed_parts(records))
    if slowest is None:
        return None
    held, replaced, one_way = [], 0, moves_one_way(records)
    for record in records:
        found = _held(record, slowest, one_way)
        if found is None:
            return None
        held.append(found[0])
        replaced += found[1]
    share = replaced / sum(map(len, records))
    return Standstill(tuple(held), slowest, share, one_way) if one_way or share > _LEAST else None


def slow_motion(records: Sequence[Record]) -> tuple[float, float]:
    """Speed below which a motion is slow, rad/s at the sensor, and the part of the time in motion that is so slow."""
    parts, slowest = windowed_parts(records), _SLOW * rms_speed(records)
    speeds = [abs(_mean_speed(part)) for part in parts]
    if not speeds:
        return slowest, 0.0
    speed = np.concatenate(speeds)
    moving = speed[speed > slowest * _RESTING / _SLOW]
    return slowest, float(np.mean(moving < slowest)) if moving.size else 0.0


def _mean_speed(part: GridPart) -> Floats:
    """Mean speed over about a second (N,)."""
    half = min(max(round(0.5 / part.h), AROUND), max(len(part.y) // 4, 1))
    if part.quantity == "angle":
        return speed_of(part, half)
    return np.convolve(part.y, np.full(2 * half + 1, 1 / (2 * half + 1)), mode="same")


def _held(record: Record, slowest: float, one_way: bool) -> tuple[Record, int] | None:
    """The record with the torque at rest, and the number of samples that have it; None: no rigid mass explains it."""
    terms = ONE_WAY if one_way else POSE
    fit = rigid_fits([record], [terms], speed_scales([record])[1], moving=True)[0]
    if fit is None or fit.explained < _EXPLAINED:
        return None
    u, count = record.u.copy(), 0
    for piece in pieces(record):
        for part in windowed_parts([piece]):
            rows = _standing(part, slowest)
            u[np.searchsorted(record.t, piece.t[rows])] = resting_torque(fit, part)[rows]
            count += rows.size
    return replace(record, u=u), count


def _standing(part: GridPart, slowest: float) -> Ints:
    """Samples at which the axis is slow, as it is around them, and does not travel."""
    slow = np.abs(speed_of(part, AROUND)) < slowest
    samples = np.flatnonzero(np.convolve(~slow, np.ones(2 * _EDGE + 1), mode="same") < 0.5)
    rests = np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1)
    stands = [rest for rest in rests if rest.size and _stands(part.angle[rest], part.h, slowest)]
    return np.concatenate([np.zeros(0, np.int64), *stands])


def _stands(angle: Floats, h: float, slowest: float) -> bool:
    low, high = np.quantile(angle, (_RARE, 1 - _RARE))
    return bool(high - low < _CREEP * slowest * min(angle.size * h, _CREEP_S))
