"""What the values of columns show: commands and measurements, angles and speeds, how rough a column is."""

from collections.abc import Mapping, Sequence

import numpy as np

from monitor_core.arrays import Floats

_SLOPE = 0.95
"""Least correlation of a speed with the slope of its angle"""
_ALIKE, _LATER = 0.05, 0.9
"""Columns have equal values if they differ by less than this part of their spread; least delay in rows"""
_STILL, _ZERO, _RESTS, _AT_ZERO = 0.01, 0.05, 0.1, 0.3
"""A column rests if it changes by less than this part of its steps; zero, as a part of its range; least share of the
rows at rest; least share of these at zero if the column may be a speed"""
MIN_ROWS = 3
"""Fewest rows in which two columns must have values to be compared"""
_MIN_RANGE = 1e-9
MOST = (0.01, 0.99)
"""Quantiles that enclose 98 % of a column"""


def changes(v: Floats) -> bool:
    """Whether a column (N,) is not constant."""
    finite = v[np.isfinite(v)]
    return finite.size > 2 and float(np.ptp(finite)) > _MIN_RANGE


def rests_beside_zero(v: Floats) -> bool:
    """Whether a column (N,) rests mostly at other values than zero, as an angle: an axis rests at the speed 0."""
    finite = v[np.isfinite(v)]
    steps, (low, high) = abs(np.diff(finite)), np.quantile(finite, MOST)
    still = steps <= _STILL * np.quantile(steps, MOST[1])
    zero = abs(finite[1:][still]) < _ZERO * (high - low)
    return bool(np.mean(still) > _RESTS and np.mean(zero) < _AT_ZERO)


def commanded_columns(values: Mapping[str, Floats], names: Sequence[str]) -> set[str]:
    """Columns whose values another column has later: commands, which the measurement follows with a delay."""
    centres = {name: float(np.nanmean(values[name])) for name in names}
    spreads = {name: float(np.nanstd(values[name])) for name in names}
    return {
        a
        for a in names
        for b in names
        if a != b
        and abs(centres[b] - centres[a]) < _ALIKE * spreads[a]
        and abs(spreads[b] - spreads[a]) < _ALIKE * spreads[a]
        and _delay(values[a], values[b]) > _LATER
    }


def _delay(first: Floats, second: Floats) -> float:
    """Delay in rows with which the second column (N,) has the values of the first; 0: the values differ."""
    slope = np.gradient(first)
    rows = np.column_stack([first, slope, np.ones_like(first)])
    good = np.isfinite(rows).all(axis=1) & np.isfinite(second)
    rows, target = rows[good], second[good]
    if len(target) < MIN_ROWS or not changes(rows[:, 1]):
        return 0.0
    fit = np.linalg.lstsq(rows, target, rcond=None)[0]
    factor, lead, _ = fit.tolist()
    residual = target - rows @ fit
    same = abs(factor - 1) < _ALIKE and float(np.std(residual)) < _ALIKE * float(np.std(target))
    return -lead / factor if same else 0.0


def roughness(v: Floats, share: float = 0.5, order: int = 2) -> float:
    """Quantile ``share`` of the difference ``order`` of a column (N,), as a part of the range of 98 % of its values."""
    finite = v[np.isfinite(v)]
    low, high = np.quantile(finite, MOST)
    if high == low or len(finite) <= order:
        return 0.0
    return float(np.quantile(abs(np.diff(finite, order)), share) / (high - low))


def speeds_of_angles(values: Mapping[str, Floats], names: Sequence[str], t: Floats | None) -> dict[str, str]:
    """Columns (angles) of which another column is the slope, each with that column (its speed)."""
    found = dict[str, str]()
    for angle in names:
        slope = slope_of(values[angle], t)
        alike = {name: correlation(slope, values[name]) for name in names if name != angle}
        best = max(alike, key=alike.__getitem__, default=None)
        if best is not None and alike[best] > _SLOPE:
            found[angle] = best
    return found


def slope_of(angle: Floats, t: Floats | None) -> Floats:
    """Slope of a column (N,) at the times ``t`` (N,); None: evenly spaced."""
    return np.asarray(np.gradient(angle, 1.0 if t is None else t))


def correlation(a: Floats, b: Floats) -> float:
    """Correlation of two columns (N,); zero if one is constant."""
    both = np.isfinite(a) & np.isfinite(b)
    if not both.any():
        return 0.0
    # Clip each column to the range of 98 % of its values, so that a few faulty rows have little effect.
    u, v = (np.clip(x[both], *np.quantile(x[both], MOST)) for x in (a, b))
    return float(np.corrcoef(u, v)[0, 1]) if changes(u) and changes(v) else 0.0
