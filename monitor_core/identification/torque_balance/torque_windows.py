"""The torque balance of one rigid mass in smooth windows: equations for its inertia, friction and weight.

Weighted with smooth windows and integrated by parts, so that nothing has to be differentiated:

    integral g u = J integral g w' + f integral g w + fc integral g tanh(w / scale) + ..       (g = 0 at both ends)
"""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.record_parts import open_pieces
from monitor_core.identification.records.uniform_grid import mean_torque

TorqueTerm = Literal["viscous", "coulomb", "offset", "angle", "angle^2", "angle^3", "stribeck", "drag", "signal"]
"""Terms of the torque in addition to the inertia: friction, an offset; powers of the angle, for effects of the pose;
friction that falls with the speed, or grows faster than it; a signal of the record, named SIGNAL."""
SIGNAL = "torque of signals"
USUAL: tuple[TorqueTerm, ...] = ("viscous", "coulomb", "offset")
POSE: tuple[TorqueTerm, ...] = (*USUAL, "angle", "angle^2", "angle^3")
"""Terms with a weight that depends on the pose in any way"""

ONE_WAY: tuple[TorqueTerm, ...] = ("viscous", "coulomb")
"""Terms of an axis that moves in one direction only.  An offset is then part of Coulomb friction.  As each place is
passed once, a dependence on the angle cannot be distinguished from one on the time."""

WINDOWS = 4
"""Number of equations per window length; closer ones contain nothing new."""
_STRIBECK = 0.3
"""Speed of Stribeck's friction, as part of the root mean square of the speed."""
AROUND = 4
"""Number of samples on either side for the speed from an angle."""
_STANDS = 0.05
"""The axis stands below this share of the root mean square of the speed."""
_OFTEN = 0.2
"""Standstill is left out only if the axis stands for at least this share of the time."""
_SELDOM = 0.01
_BACK = 0.005
"""An axis that moves backwards for less than this share of the time in motion counts as moving in one direction."""
_MOSTLY = 0.9
"""Share of a window in which the axis must move."""
_MUCH_LESS = 0.5
"""At most this share of the squared errors is much less."""
_DETERMINED = 1e-8
"""Singular values below this share of the largest belong to values that the equations do not determine."""


class GridPart(NamedTuple):
    """A piece of a record on a regular grid: torque around each sample, motion and signals (N,), interval in s."""

    u: Floats
    y: Floats
    h: float
    quantity: Output
    signals: Mapping[str, Floats]

    @property
    def angle(self) -> Floats:
        """Angle from the first sample on (N,)."""
        return self.y - self.y[0] if self.quantity == "angle" else np.cumsum(self.y) * self.h


def rms_speed(records: Sequence[Record]) -> float:
    """Root mean square of the motor's speed, rad/s, without its noise: from windows of some samples."""
    means = [speed_of(part, AROUND) for part in windowed_parts(records)]
    return float(np.sqrt(np.mean(np.concatenate(means) ** 2))) if means else 1.0


def windowed_parts(records: Sequence[Record]) -> list[GridPart]:
    """The pieces of records between gaps and closed gates, each on a regular grid."""
    found = [piece for record in records for piece in open_pieces(record)]
    return [_part(piece) for piece in found if np.count_nonzero(piece.measured) > 1]


def balance_equations(
    parts: Sequence[GridPart],
    window: int,
    speed_scale: float,
    terms: Sequence[TorqueTerm],
    least: float | None = None,
) -> tuple[Floats, Floats]:
    """``windowed_equations`` of all parts that are long enough; ``least``: only windows with a larger speed."""
    rows, torque = [np.zeros((0, 1 + len(terms)))], [np.zeros(0)]
    for part in parts:
        if len(part.u) > window:
            columns, right = windowed_equations(part, window, speed_scale, terms)
            kept = slice(None) if least is None else moving_windows(part, window, least)
            rows.append(columns[kept])
            torque.append(right[kept])
    return np.concatenate(rows), np.concatenate(torque)


def residual_torque(rows: Floats, torque: Floats, fitted: slice = slice(None), judged: slice = slice(None)) -> Floats:
    """Torque of the judged equations that these terms, fitted to the fitted equations, do not explain."""
    rows = of_unit_length(rows)
    found = np.linalg.lstsq(rows[fitted], torque[fitted], rcond=_DETERMINED)[0]
    return np.asarray(torque[judged] - rows[judged] @ found)


def leaves_much_less(explained: float, other: float) -> bool:
    """Whether an explanation of this share of the torque leaves much smaller squared errors than the other one."""
    return (1 - explained) ** 2 < _MUCH_LESS * (1 - other) ** 2


def of_unit_length(rows: Floats) -> Floats:
    """Columns of equations scaled to length one, but for those of zeros."""
    size = np.sqrt((rows**2).sum(axis=0))
    return np.asarray(rows / np.where(size > 0, size, 1.0))


def least_speed(parts: Sequence[GridPart]) -> float | None:
    """Speed below which the axis of these parts stands, at the sensor; None: it seldom does.

    Where an axis moves in one direction only, what friction holds at rest does not average out: it may stand seldom.
    """
    if not parts:
        return None
    speed, least = _speeds(parts), standing_speed(parts)
    often = _SELDOM if _one_way(speed) else _OFTEN
    return least if np.mean(abs(speed) < least) > often else None


def standing_speed(parts: Sequence[GridPart]) -> float:
    """Speed below which an axis may stand, at the sensor, however seldom it does; 0: there are no parts."""
    return _STANDS * float(np.sqrt(np.mean(_speeds(parts) ** 2))) if parts else 0.0


def _speeds(parts: Sequence[GridPart]) -> Floats:
    return np.concatenate([speed_of(part, AROUND) for part in parts])


def moves_one_way(records: Sequence[Record]) -> bool:
    """Whether an axis moves in one direction only, as a conveyor, a spindle or a pump does."""
    parts = windowed_parts(records)
    return bool(parts) and _one_way(np.concatenate([speed_of(part, AROUND) for part in parts]))


def _one_way(speed: Floats) -> bool:
    moving = speed[abs(speed) > _STANDS * float(np.sqrt(np.mean(speed**2)))]
    return bool(moving.size) and min(float(np.mean(moving > 0)), float(np.mean(moving < 0))) < _BACK


def speed_of(part: GridPart, half: int) -> Floats:
    """Speed in a part (N,); from an angle it is the mean over ``half`` samples on either side."""
    if part.quantity == "speed":
        return part.y
    around = np.pad(part.y, half, mode="reflect", reflect_type="odd")
    slope: Floats = (around[2 * half :] - around[: -2 * half]) / (2 * half * part.h)
    return slope


def moving_windows(part: GridPart, window: int, least: float) -> Bools:
    """Mask (M,) of the windows in which the axis nearly always moves."""
    g = window_of(window, part.h)[0]
    moving = (np.abs(speed_of(part, max(window // 8, 1))) > least).astype(float)
    return np.asarray(integrals(part, g, moving) > _MOSTLY * part.h * float(g.sum()), np.bool_)


def _part(segment: Record) -> GridPart:
    """The record on a regular grid: the mean torque is exact, and the motion is almost straight between samples."""
    t = np.linspace(segment.t[0], segment.t[-1], len(segment))
    y = np.interp(t, segment.t[segment.measured], segment.y[segment.measured])
    u = mean_torque(segment, t)
    # Mean of the torques before and after each sample.
    around = np.convolve(u, (0.5, 0.5))[: len(u)]
    signals = {name: _on_grid(t, segment.t, values) for name, values in segment.signals.items()}
    return GridPart(around, y, float(t[1] - t[0]), segment.quantity, signals)


def _on_grid(grid: Floats, t: Floats, values: Floats) -> Floats:
    """Values at other times, straight between those that are known; NaN: none is."""
    known = np.isfinite(values)
    return np.interp(grid, t[known], values[known]) if known.any() else np.full(len(grid), np.nan)


def windowed_equations(
    part: GridPart, window: int, speed_scale: float, terms: Sequence[TorqueTerm]
) -> tuple[Floats, Floats]:
    """Columns (M, 1 + terms), that of J first; the windowed torque (M,)."""
    g, g1, g2 = window_of(window, part.h)
    y, angle, speed = part.y, part.angle, speed_of(part, window // 8)

    def over(weight: Floats, values: Floats) -> Floats:
        return integrals(part, weight, values)

    if part.quantity == "speed":
        inertia, viscous = -over(g1, y), over(g, y)
    else:
        inertia, viscous = over(g2, angle), -over(g1, angle)
    columns = [
        viscous
        if term == "viscous"
        else over(g, part.signals[SIGNAL] if term == "signal" else term_values(term, speed, angle, speed_scale))
        for term in terms
    ]
    return np.column_stack([inertia, *columns]), over(g, part.u)


def integrals(part: GridPart, weight: Floats, values: Floats) -> Floats:
    """Integrals (M,) of values (N,) of a part, weighted with a window, one after the other."""
    # Few enough overlap that to convolve all samples would take longer.
    windows = sliding_window_view(values, len(weight))[:: (len(weight) - 1) // WINDOWS]
    return np.asarray(part.h * (windows @ weight))


def term_values(term: TorqueTerm, speed: Floats, angle: Floats, speed_scale: float) -> Floats:
    """Values (N,) that a term is proportional to."""
    if term == "coulomb":
        return np.tanh(speed / speed_scale)
    if term == "stribeck":
        slow = _STRIBECK * float(np.sqrt(np.mean(speed**2))) or 1.0
        return np.tanh(speed / speed_scale) * np.exp(-((speed / slow) ** 2))
    if term == "drag":
        return np.abs(speed) * speed
    powers: Mapping[TorqueTerm, int] = {"offset": 0, "angle": 1, "angle^2": 2, "angle^3": 3}
    return np.asarray((angle / max(float(np.abs(angle).max()), 1e-300)) ** powers[term])


def window_of(count: int, interval_s: float) -> tuple[Floats, Floats, Floats]:
    """g = sin^4 over the window (count + 1,), and its first two derivatives."""
    x = np.pi * np.arange(count + 1) / count
    w = np.pi / (count * interval_s)
    sin, cos = np.sin(x), np.cos(x)
    return sin**4, 4 * w * sin**3 * cos, 4 * w**2 * (3 * sin**2 * cos**2 - sin**4)
