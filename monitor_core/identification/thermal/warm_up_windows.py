"""Sums over short windows of records, which tell of friction that changes slowly: power, information, score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.thermal_state import ThermalModel
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.greybox.criterion import fit_starts
from monitor_core.identification.predictor.prediction_errors import RecordPredictor
from monitor_core.identification.records.measured_record import Record

WINDOW_S = 10.0
"""Length of a window"""


class Windows(NamedTuple):
    """Sums over the windows (W) of one record."""

    middle_s: Floats  # (W,) since its first sample
    power: Floats  # (W,) mean friction power, W
    information: Floats  # (W, p, p) sums of psi psi'
    score: Floats  # (W, p) sums of psi eps


def speeds_of(record: Record) -> tuple[Floats, Floats]:
    """Speeds (N,) and the intervals [s] that they are of."""
    t_us = np.rint(record.t * 1e6).astype(np.int64)
    steps = MeasuredSpeed(record.quantity).take(t_us, record.y)
    speed: Floats = np.where(np.isfinite(steps.speed), steps.speed, 0.0)
    return speed, np.asarray(steps.interval_us * 1e-6, np.float64)


def windows_of(found: Estimate, records: Sequence[Record], unit: ThermalModel) -> tuple[list[str], list[Windows]]:
    """Names of what psi is of, and the windows of each record; power by the friction of ``unit``.

    Raises:
        ValueError: the errors of a record are zero or not finite, or a parameter is.
    """
    problem = found.problem
    predictor = RecordPredictor(problem, records, problem.disturbance)
    xi = fit_starts(predictor)
    p = len(predictor.layout.names)
    rates = predictor.layout.rates(xi)[:p]
    out = list[Windows]()
    for record, errors in zip(records, predictor.errors(xi), strict=True):
        since = record.t - record.t[0]
        which = (since // WINDOW_S).astype(np.int64)
        count = int(which[-1]) + 1
        edges = np.searchsorted(which, np.arange(count + 1))
        # Records that the drive explains less well count less.
        level = math.sqrt(float(np.mean(errors.eps**2)))
        if not (0 < level < math.inf and np.isfinite(rates).all() and rates.all()):
            raise ValueError(f"{record.name or 'record'}: the prediction errors are zero or not finite")
        speed, h = speeds_of(record)
        energy = np.bincount(which, unit.power(speed) * h, count)
        information, score = np.zeros((count, p, p)), np.zeros((count, p))
        for k, (a, b) in enumerate(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)):
            psi = errors.psi[a:b, :p] / (rates * level)
            information[k], score[k] = psi.T @ psi, psi.T @ (errors.eps[a:b] / level)
        out.append(
            Windows(
                np.asarray((np.arange(count) + 0.5) * WINDOW_S, np.float64),
                energy / WINDOW_S,
                information,
                score,
            )
        )
    return list(predictor.layout.names), out
