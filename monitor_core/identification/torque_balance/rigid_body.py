"""Explains a record by one rigid mass with friction, an offset and further terms, by least squares.

The torque balance in windows (torque_windows.py) needs no starting values, holds in a closed loop and under a weight,
and sees the slow motion only.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.torque_windows import (
    SIGNAL,
    USUAL,
    WINDOWS,
    GridPart,
    TorqueTerm,
    balance_equations,
    least_speed,
    moves_one_way,
    rms_speed,
    term_values,
    windowed_parts,
)

_FEWEST_WINDOWS = 12
"""Least number of window lengths in the record."""
_FOR_EACH = 2
"""Least number of window lengths per term if standstill is left out; with fewer, all terms together explain any
torque."""
SHORTEST = 24
"""Least number of samples in a window, so that sums equal integrals to 1e-3."""
_SCALES = (0.02, 0.05, 0.12, 0.3)
"""Speed scales of Coulomb friction, as parts of the root mean square of the speed."""
_AS_GOOD, _WELL = 2.0, 0.1
"""A window is about as good as the best one if it leaves at most this multiple, or this share, unexplained."""
_AS_SURE = 2.0
"""A window determines the inertia about as well as the best one if its sd is at most this multiple."""


class Rigid(NamedTuple):
    """Records explained by one rigid mass."""

    inertia: float
    """kg m^2, with its standard deviation"""
    sd: float
    torques: Mapping[TorqueTerm, float]
    """N m per unit of each term"""
    explained: float
    """part of the variance of the windowed torque that the model explains, 1: all"""
    expected: float = 0.0
    """the same of as many other windows: fitted to few, any model explains much"""

    @property
    def inertia_sigmas(self) -> float:
        """The inertia in standard deviations."""
        return abs(self.inertia) / max(self.sd, 1e-300)


def rigid_fit(record: Record, speed_scale: float = 1.0) -> Rigid | None:
    """The usual terms; arguments and result as of ``rigid_fits``."""
    return rigid_fits([record], [USUAL], speed_scale)[0]


def rigid_fits(
    records: Sequence[Record],
    models: Sequence[Sequence[TorqueTerm]],
    speed_scale: float = 1.0,
    shortest_s: float = 0.0,
    moving: bool = False,
    min_speed: float = 0.0,
) -> list[Rigid | None]:
    """Fits of models with these terms, all with the window that is best for the first; None: that explains nothing.

    The longer the window, the less is seen of springs, but of the motion, too: at last only weight or friction is left,
    and explains all.  So the best is the longest that determines the inertia about as well as any does, of those in
    which the model explains about as much as in any.

    Args:
        records: about equally sampled.
        models: terms of each model, in addition to the inertia.
        speed_scale: of Coulomb friction, rad/s.
        shortest_s: length of a window at least; motions faster than a third of it are suppressed.
        moving: without standstill, where there is motion enough: friction may be anything then, and looks like the
            weight of the places at which the axis stops.
        min_speed: with ``moving``, only where the axis is as fast as that, rad/s at the sensor.
    """
    parts = windowed_parts(records)
    least = _least(parts, min_speed) if moving else None
    shortest = max(SHORTEST, shortest_s / records[0].interval_s)
    ladder = _ladder(shortest, sum(len(part.u) for part in parts))
    fits = [(fit, window) for window in ladder if (fit := _fit(parts, window, speed_scale, models[0], least))]
    if not fits and least is not None:  # the axis moves too briefly
        return rigid_fits(records, models, speed_scale, shortest_s)
    if not fits:
        return [None] * len(models)
    most = max(fit.explained for fit, _ in fits)
    enough = 1 - max(_AS_GOOD * (1 - most), _WELL)
    good = [pair for pair in fits if pair[0].explained >= enough]
    sure = max(fit.inertia_sigmas for fit, _ in good) / _AS_SURE
    best, window = max((pair for pair in good if pair[0].inertia_sigmas >= sure), key=lambda pair: pair[1])
    return [best, *(_fit(parts, window, speed_scale, terms, least) for terms in models[1:])]


class Balance(NamedTuple):
    """A torque balance with given values."""

    inertia: float
    """kg m^2"""
    torques: Mapping[TorqueTerm, float]
    """N m per unit of each term"""


def unexplained(
    records: Sequence[Record], balance: Balance, speed_scale: float = 1.0, min_speed: float = 0.0
) -> tuple[float, float] | None:
    """Sum of squares of the windowed torque that a balance does not explain, and that of the torque about its mean.

    Of an axis that moves in one direction only it is that of the torque itself, whose mean is friction.
    The window is the one in which these terms, fitted, would explain most of what was not fitted; without standstill,
    and what is slower than ``min_speed`` (rad/s at the sensor), where there is motion enough.
    None: the records are too short.
    """
    parts, terms = windowed_parts(records), tuple(balance.torques)
    ladder = _ladder(SHORTEST, sum(len(part.u) for part in parts))
    for least in dict.fromkeys((_least(parts, min_speed), None)):
        fits = [(fit.expected, window) for window in ladder if (fit := _fit(parts, window, speed_scale, terms, least))]
        if fits:
            break
    else:
        return None
    _, window = max(fits)
    rows, torque = balance_equations(parts, window, speed_scale, terms, least)
    left = torque - rows @ np.array([balance.inertia, *balance.torques.values()])
    mean = 0.0 if moves_one_way(records) else torque.mean()
    return float(left @ left), float(((torque - mean) ** 2).sum())


def speed_scales(records: Sequence[Record]) -> tuple[float, ...]:
    """Speed scales of Coulomb friction that come into question, rad/s at the sensor, the steepest first."""
    speed = rms_speed(records)
    return tuple(float(f"{part * speed:.2g}") for part in _SCALES)


def _ladder(shortest: float, count: int) -> list[int]:
    """Lengths of the window in samples, each one and a half times the one before, for that many samples."""
    lengths, most = [], count // _FEWEST_WINDOWS
    length = shortest
    while length <= most:
        lengths.append(int(length))
        length *= 1.5
    return lengths


def _least(parts: Sequence[GridPart], min_speed: float) -> float | None:
    """The larger of that speed and ``min_speed``; None: it is zero."""
    return max(least_speed(parts) or 0.0, min_speed) or None


def _fit(
    parts: Sequence[GridPart],
    window: int,
    speed_scale: float,
    terms: Sequence[TorqueTerm],
    least: float | None = None,
) -> Rigid | None:
    rows, torque = balance_equations(parts, window, speed_scale, terms, least)
    fewest = _FEWEST_WINDOWS if least is None else _FOR_EACH * WINDOWS * rows.shape[1]
    if len(torque) < fewest:
        return None
    scale = np.sqrt((rows**2).sum(axis=0))
    spread = float(((torque - torque.mean()) ** 2).sum())
    if not (scale > 0).all() or spread <= 0:
        return None
    found, _, rank, _ = np.linalg.lstsq(rows / scale, torque, rcond=1e-8)
    if rank < rows.shape[1]:
        return None
    residual = torque - rows / scale @ found
    variance = float(residual @ residual) / (len(torque) - rank)
    covariance = variance * np.linalg.inv((rows / scale).T @ (rows / scale))
    sd = float(np.sqrt(covariance[0, 0]) / scale[0])
    explained = 1 - float(residual @ residual) / spread
    inertia, *torques = (found / scale).tolist()
    separate = len(torque) / WINDOWS
    expected = 1 - (1 - explained) * separate / max(separate - rank, 1.0)
    return Rigid(inertia, sd, dict(zip(terms, torques, strict=True)), explained, float(expected))


def resting_torque(rigid: Rigid, part: GridPart) -> Floats:
    """Torque that keeps the mass at rest at the angle of each sample (N,): offset, weight, links; no friction."""
    terms = (term for term in rigid.torques if term == "offset" or term.startswith("angle"))
    still = np.zeros(len(part.y))
    links = rigid.torques["signal"] * part.signals[SIGNAL] if "signal" in rigid.torques else still
    return sum((rigid.torques[term] * term_values(term, still, part.angle, 1.0) for term in terms), start=links)
