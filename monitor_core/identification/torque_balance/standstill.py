"""Standstill of an axis that stops often, as in pick and place: there friction balances any torque.

The model of friction, tanh of the speed, has no such force: the model creeps, and a fit would explain the torque at
standstill by a wrong inertia or friction.  So this torque is replaced by the torque that keeps a model at rest: the
offset and the weight that the motion of the record shows.

The same is done where a brake holds an axis whose motor is off, however rarely: by the model the axis would fall, and
seconds of that spoil the fit to many minutes.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.record_parts import open_pieces
from monitor_core.identification.torque_balance.rigid_body import resting_torque, rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    AROUND,
    ONE_WAY,
    POSE,
    SIGNAL,
    USUAL,
    GridPart,
    TorqueTerm,
    least_speed,
    moves_one_way,
    rms_speed,
    speed_of,
    standing_speed,
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
"""Least share of samples at standstill; otherwise the torque is changed only where a brake holds the axis."""
_BORNE, _BRAKED_S = 0.5, 0.3
"""A brake holds an axis that stands if its torque is less than this share of the resting torque for this time."""

_STICTION = 1.5
"""Friction may hold this multiple of Coulomb friction at rest."""


class Standstill(NamedTuple):
    """Records in which the axis often stands, or its brake holds it, with the torque that keeps a model at rest there.

    ``speed``: below it the axis stands, rad/s at the sensor; 0: only where its brake holds it the torque was replaced.
    ``share``: of the samples whose torque was replaced.  ``one_way``: the axis moves in one direction only.
    ``slowest``: below this speed it does not travel, rad/s at the sensor.
    """

    records: tuple[Record, ...]
    speed: float
    share: float
    one_way: bool
    slowest: float

    def held(self, records: Sequence[Record]) -> list[Record]:
        """Other records of the axis, in the same way; one that no rigid mass explains stays as it is."""
        rests = [_rest(record, self.slowest, self.one_way) for record in records]
        return [
            record if rest is None else rest.replaced(record, braked=not self.speed)
            for record, rest in zip(records, rests, strict=True)
        ]


class _Rest(NamedTuple):
    """The torque at rest of a record (N,), whether the axis stands, and whether its brake holds it."""

    torque: Floats
    stands: Bools
    braked: Bools

    def replaced(self, record: Record, braked: bool) -> Record:
        """The record with this torque wherever the axis stands; or, with ``braked``, where its brake holds it."""
        return replace(record, u=np.where(self.braked if braked else self.stands, self.torque, record.u))


def find_standstill(records: Sequence[Record]) -> Standstill | None:
    """The records with the resting torque at standstill, or where a brake holds the axis.

    ``records``: of links that load the axis they have the torque as the signal SIGNAL.

    None: the axis rarely stands, and never held by a brake; or the resting torque is not known.
    """
    parts = windowed_parts(records)
    seldom, slowest = least_speed(parts) is None, standing_speed(parts)
    if not slowest:  # it never moves
        return None
    one_way, rests = moves_one_way(records), list[_Rest]()
    for record in records:
        rest = _rest(record, slowest, one_way)
        if rest is None:
            return None
        rests.append(rest)
    total = sum(map(len, records))
    stands, braked = (sum(map(np.count_nonzero, part)) / total for part in zip(*(r[1:] for r in rests), strict=True))
    only_braked = seldom or (not one_way and stands <= _LEAST)
    if only_braked and not braked:
        return None
    held = tuple(rest.replaced(record, only_braked) for record, rest in zip(records, rests, strict=True))
    speed, share = (0.0, braked) if only_braked else (slowest, stands)
    return Standstill(held, speed, float(share), one_way, slowest)


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


def _rest(record: Record, slowest: float, one_way: bool) -> _Rest | None:
    """Where the axis stands, and with what torque; None: no rigid mass explains the record."""
    terms: tuple[TorqueTerm, ...] = ONE_WAY if one_way else POSE
    if SIGNAL in record.signals:
        terms = (*(ONE_WAY if one_way else USUAL), "signal")
    fit = rigid_fits([record], [terms], speed_scales([record])[1], moving=True, min_speed=slowest)[0]
    if fit is None or fit.explained < _EXPLAINED:
        return None
    N = len(record)
    torque, stands, braked = np.zeros(N), np.zeros(N, np.bool_), np.zeros(N, np.bool_)
    for piece in open_pieces(record):
        for part in windowed_parts([piece]):
            at, own = np.searchsorted(record.t, piece.t), resting_torque(fit, part)
            torque[at] = own
            stands[at[_standing(part, slowest)]] = True
            braked[at[_braked(part, own, abs(fit.torques.get("coulomb", 0.0)), slowest)]] = True
    return _Rest(torque, stands | braked, braked)


def _braked(part: GridPart, resting: Floats, friction: float, slowest: float) -> Ints:
    """Samples at which a brake holds the axis: it stands, and the motor bears less than half of the weight.

    ``resting`` (N,): torque that bears the weight.  ``friction``: Coulomb friction, which may hold what the motor does
    not bear.
    """
    idle = (np.abs(resting - part.u) > _STICTION * friction) & (np.abs(part.u) < _BORNE * np.abs(resting))
    idle &= np.abs(speed_of(part, AROUND)) < slowest
    samples = np.flatnonzero(idle)
    runs = np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1)
    held = [run for run in runs if run.size * part.h >= _BRAKED_S and _stands(part.angle[run], part.h, slowest)]
    return np.concatenate([np.zeros(0, np.int64), *held])


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
