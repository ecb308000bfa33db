"""The torque balance of one mass with friction and a weight, as columns of a least-squares problem.

    J w' + f w + fc sign(w) + tau0 + sum_i (c_i cos s_i + d_i sin s_i) = u

in windows (torque_windows.py).  ``arm_links`` chooses the sums of angles s_i, ``gear_ratios`` finds the ratios in them,
``turning_weight`` the unit of the angle.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    SIGNAL,
    USUAL,
    WINDOWS,
    GridPart,
    balance_equations,
    integrals,
    least_speed,
    moving_windows,
    residual_torque,
    rms_speed,
    window_of,
    windowed_parts,
)

_MOST_SAMPLES = 30_000
"""Longer records are decimated to about this number of samples, as weights change slowly."""
_PERIOD_SHARE, _MIN_WINDOW = 0.1, 24
"""Window of the torque balance: of the usual period of the motion, in which a weight hardly changes; in samples."""
_MOST_MOVING_SAMPLES, _MOVING_SHARE = 100_000, 0.03
"""The same for torques that change with speeds and accelerations"""
_MAX_RATIO = 2.0
"""Largest ratio of the inertias that both halves of the equations show"""
_GOES_WITH = 0.9
"""Cosine of the angle between two columns that hardly differ"""
MOST_OTHERS = 2
"""Other angles in the sum of a weight: shoulder, elbow and a wrist that bends in the same plane."""
MIN_INCREASE = 1.02
"""A single cosine or sine is kept if the squared errors grow by at least this factor without it."""
DETERMINED = 1e-10
"""Singular values of the normal equations below this share of the largest are left out."""
_LEAST_WINDOWS = 20
"""Least number of windows in all records; fewer do not distinguish the terms of a weight."""


class HalfEquations(NamedTuple):
    """The normal equations of one half of the windows, from which trials of few columns are solved fast."""

    G: Floats
    """X'X (n, n)"""
    b: Floats
    """X'y (n,)"""
    yy: float
    """y'y"""

    def of_columns(self, used: Ints) -> HalfEquations:
        """Those of some columns."""
        return HalfEquations(self.G[np.ix_(used, used)], self.b[used], self.yy)

    def missed_with(self, fitted: HalfEquations) -> float:
        """Sum of the squared errors of these equations with the values that solve the fitted ones."""
        theta = np.linalg.lstsq(fitted.G, fitted.b, rcond=DETERMINED)[0]
        return self.yy - float(2 * theta @ self.b - theta @ self.G @ theta)


class WeightBalance:
    """The equations of one mass with the usual terms, ``rows`` (M, 4) and ``torque`` (M,), in windows of parts.

    ``scale``: speed scale of Coulomb friction, rad/s.  ``moving``: only the windows in which the axis moves.
    """

    def __init__(self, parts: Sequence[GridPart], window: int, scale: float, moving: bool = True) -> None:
        self._parts = parts
        self._windows = [window_of(window, part.h) for part in parts]
        rows, torque = balance_equations(parts, window, scale, USUAL)
        self._kept = _windows_of_motion(parts, window) if moving else np.ones(len(torque), np.bool_)
        self.rows, self.torque = rows[self._kept], torque[self._kept]
        self.spread = float(((self.torque - self.torque.mean()) ** 2).sum())
        """Sum of squares of the torque about its mean"""

    @property
    def halves(self) -> tuple[slice, slice]:
        """The first and the last half of the equations: values are fitted to one, and tested on the other."""
        half = len(self.torque) // 2
        return slice(half), slice(half, None)

    def share_explained(self, missed: float) -> float:
        """Share of the torque about its mean that is explained where ``missed`` is the sum of the squared errors."""
        return 1 - float(np.sqrt(missed / self.spread)) if self.spread > 0 else 0.0

    def normal_equations(self, rows: Floats) -> tuple[tuple[HalfEquations, HalfEquations], Floats]:
        """Those of each half for columns (M, n) that are divided by their sizes, and these sizes (n,)."""
        size = column_sizes(rows)
        scaled = rows / size
        first, last = (_half_equations(scaled[half], self.torque[half]) for half in self.halves)
        return (first, last), size

    def column(self, values: Iterable[Floats]) -> Floats:
        """A further column (M,): the integrals of values (N,) of each part."""
        return self._windowed(values)

    def rate(self, values: Iterable[Floats]) -> Floats:
        """The integrals (M,) of the rate of change of values (N,) of each part, by parts."""
        return self._windowed(values, rate=True)

    def mean(self, values: Iterable[Floats]) -> Floats:
        """Means of values (N,) of each part in the windows (M,)."""
        return self._windowed(values, mean=True)

    def _windowed(self, values: Iterable[Floats], mean: bool = False, rate: bool = False) -> Floats:
        found = list[Floats]()
        for part, (g, g1, _), value in zip(self._parts, self._windows, values, strict=True):
            shape = -g1 if rate else g
            found.append(integrals(part, shape, value) / (part.h * shape.sum() if mean else 1.0))
        return np.concatenate(found)[self._kept]

    def rigid_mass(self, columns: Sequence[Floats]) -> tuple[float, float] | None:
        """Inertia and viscous friction beside further columns; None: the halves of the equations differ about it.

        If they do, columns that hardly differ from that of the inertia are left out, as of an inertia that follows a
        pose which changes little.  So it is the inertia in the mean pose: beside them it may be anything.
        """
        for used in (columns, [column for column in columns if not self._goes_with_inertia(column)]):
            halves = self.inertias(used)
            if min(halves) > max(halves) / _MAX_RATIO > 0:
                inertia, viscous = self._solved(used, slice(None))[:2].tolist()
                return inertia, max(viscous, 0.0)
        return None

    def _goes_with_inertia(self, column: Floats) -> bool:
        inertia = self.rows[:, 0]
        return abs(float(inertia @ column)) > _GOES_WITH * float(np.linalg.norm(inertia) * np.linalg.norm(column))

    def inertias(self, columns: Sequence[Floats]) -> tuple[float, float]:
        """The inertia beside further columns by each half of the equations."""
        first, last = (self._solved(columns, half)[0] for half in self.halves)
        return float(first), float(last)

    def slopes(self, columns: Sequence[Floats]) -> Floats:
        """The torque per unit of each further column, by all equations."""
        return self._solved(columns, slice(None))[self.rows.shape[1] :]

    def _solved(self, columns: Sequence[Floats], part: slice) -> Floats:
        """Values of the usual terms and of further columns, by this part of the equations."""
        rows = np.column_stack([self.rows, *columns])
        scale = column_sizes(rows)
        return np.asarray(np.linalg.lstsq(rows[part] / scale, self.torque[part])[0] / scale)

    def missed(self, columns: Sequence[Floats], fitted: slice = slice(None), judged: slice = slice(None)) -> float:
        """Sum of squares that further columns leave of the torque, in the judged windows with values of the fitted."""
        missed = residual_torque(np.column_stack([self.rows, *columns]), self.torque, fitted, judged)
        return float(missed @ missed)


def column_sizes(rows: Floats) -> Floats:
    """Root of the sum of squares of each column (n,); 1 for a column of zeros."""
    size = np.sqrt((rows**2).sum(axis=0))
    return np.where(size > 0, size, 1.0)


def _half_equations(X: Floats, y: Floats) -> HalfEquations:
    return HalfEquations(X.T @ X, X.T @ y, float(y @ y))


def with_torque_of_links(records: Sequence[Record], terms: Sequence[str]) -> list[Record]:
    """The records with the torque that is proportional to these signals as the further signal SIGNAL.

    As they are, if there are no such signals, or too few windows.
    """
    parts, window = slow_parts(records, terms) if terms else ([], 0)
    if not parts:
        return list(records)
    balance = WeightBalance(parts, window, speed_scales(records)[1])
    slopes = balance.slopes([balance.column(part.signals[term] for part in parts) for term in terms])
    return [
        replace(
            record,
            signals={**record.signals, SIGNAL: sum(s * record.signals[t] for s, t in zip(slopes, terms, strict=True))},
        )
        for record in records
    ]


def slow_parts(records: Sequence[Record], angles: Sequence[str]) -> tuple[list[GridPart], int]:
    """Parts of records where these angles are known, and the window of their torque balance; none: too few windows."""
    return _parts(records, angles, _MOST_SAMPLES, _PERIOD_SHARE)


def moving_parts(records: Sequence[Record], angles: Sequence[str]) -> tuple[list[GridPart], int]:
    """The same with more samples, and a window in which accelerations change little."""
    return _parts(records, angles, _MOST_MOVING_SAMPLES, _MOVING_SHARE)


def _parts(records: Sequence[Record], signals: Sequence[str], most: int, share: float) -> tuple[list[GridPart], int]:
    parts = [part for part in windowed_parts(records) if all(np.isfinite(part.signals[name]).all() for name in signals)]
    window_s = share * _usual_period(records, parts)
    parts = [_thinned(part, most, window_s) for part in parts]
    window = max(_MIN_WINDOW, round(window_s / parts[0].h)) if parts else _MIN_WINDOW
    parts = [part for part in parts if len(part.u) > window]
    enough = sum(len(part.u) for part in parts) >= _LEAST_WINDOWS * window
    return (parts if enough else []), window


def _usual_period(records: Sequence[Record], parts: Sequence[GridPart]) -> float:
    """The usual period of the motion [s]: that of a sine with its speed and its way; 0: there is none."""
    speed = rms_speed(records)
    if not parts or not speed > 0:
        return 0.0
    turned = np.concatenate([_turned(part) for part in parts])
    return 2 * np.pi * float(np.sqrt(np.mean(turned**2))) / speed


def _turned(part: GridPart) -> Floats:
    """The angle relative to its mean (N,)."""
    angle = part.y if part.quantity == "angle" else np.cumsum(part.y) * part.h
    return np.asarray(angle - angle.mean())


def _thinned(part: GridPart, most: int, window_s: float) -> GridPart:
    """Means over blocks of samples, if there are too many, but so few that a window still has its samples."""
    block = min(-(-len(part.u) // most), int(window_s / (_MIN_WINDOW * part.h)))
    if block <= 1:
        return part
    count = len(part.u) // block

    def means(values: Floats) -> Floats:
        return np.asarray(values[: count * block].reshape(count, block).mean(axis=1))

    signals = {name: means(values) for name, values in part.signals.items()}
    return GridPart(means(part.u), means(part.y), part.h * block, part.quantity, signals)


def _windows_of_motion(parts: Sequence[GridPart], window: int) -> Bools:
    """In which windows (M,) of all parts the axis moves: where it stands, friction may be anything, as a weight may."""
    least = least_speed(parts)
    kept = [moving_windows(part, window, least or 0.0) for part in parts]
    if least is not None and sum(map(np.count_nonzero, kept)) >= _LEAST_WINDOWS * WINDOWS:
        return np.concatenate(kept)
    return np.ones(sum(map(len, kept)), np.bool_)
