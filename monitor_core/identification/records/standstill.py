"""Standstill of an axis that stops often, as in pick and place: friction then holds whatever the torque is.

The model of friction, tanh of the speed, has no such force: it creeps, and a fit would explain the torque of an axis
that stands by an inertia or a friction that no drive has.  So that torque is replaced by what keeps a model at rest:
the offset and the weight that the motion of the record shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.rigid_body import (
    AROUND,
    POSE,
    least_speed,
    pieces,
    resting_torque,
    rigid_fits,
    speed_of,
    speed_scales,
    windowed_parts,
)

_EXPLAINED = 0.5
"""Of the torque, at least: otherwise it is not known what keeps the axis at rest."""
_EDGE = 2 * AROUND
"""Samples at either end of a standstill that stay as they are: the axis may have begun to move."""


class Standstill(NamedTuple):
    """Records in which the axis often stands, with the torque that keeps a model at rest there.

    ``speed``: below it the axis stands, rad/s at the sensor.  ``share``: of the samples whose torque was replaced.
    """

    records: tuple[Record, ...]
    speed: float
    share: float

    def held(self, records: Sequence[Record]) -> list[Record]:
        """Other records of the axis, in the same way; one that no rigid mass explains stays as it is."""
        found = (_held(record, self.speed) for record in records)
        return [record if held is None else held[0] for record, held in zip(records, found, strict=True)]


def find_standstill(records: Sequence[Record]) -> Standstill | None:
    """The records with another torque where the axis stands; None: it seldom does, or it is not known which torque."""
    slowest = least_speed(windowed_parts(records))
    if slowest is None:
        return None
    held, replaced = [], 0
    for record in records:
        found = _held(record, slowest)
        if found is None:
            return None
        held.append(found[0])
        replaced += found[1]
    share = replaced / sum(map(len, records))
    return Standstill(tuple(held), slowest, share) if replaced else None


def _held(record: Record, slowest: float) -> tuple[Record, int] | None:
    """The record with the torque at rest, and the number of samples that have it; None: no rigid mass explains it."""
    fit = rigid_fits([record], [POSE], speed_scales([record])[1], moving=True)[0]
    if fit is None or fit.explained < _EXPLAINED:
        return None
    u, count = record.u.copy(), 0
    for piece in pieces(record):
        for part in windowed_parts([piece]):
            rows = np.flatnonzero(_stands(np.abs(speed_of(part, AROUND)) < slowest))
            u[np.searchsorted(record.t, piece.t[rows])] = resting_torque(fit, part)[rows]
            count += rows.size
    return replace(record, u=u), count


def _stands(slow: Bools) -> Bools:
    """Samples (N,) around which all are slow."""
    around = np.convolve(~slow, np.ones(2 * _EDGE + 1), mode="same")
    return np.asarray(around < 0.5)
