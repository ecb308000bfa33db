"""A record prepared for the compiled predictor: distinct intervals, and levels of the scheduling signals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.identification.records.measured_record import Record
from monitor_core.samples import forward_fill

MOST_LEVELS = 32
"""A slowly varying signal counts as constant within the 32nd part of its range."""

_REGULAR = 0.01


@dataclass(frozen=True, eq=False)
class PreparedRecord:
    """A record with its distinct pairs of interval and level."""

    record: Record
    u: Floats  # (N,)
    y: Floats  # (N,) zero where not measured
    measured: Ints  # (N,) 0 or 1
    counts: Ints  # (N,) 0 or 1: whether it was measured, and its error counts
    step: Ints  # (N,) which of the pairs leads to the next sample
    level: Ints  # (N,) which of the levels applies
    pairs: Ints  # (G, 2) interval in us, level
    signals: Floats  # (L, s) the signals' values at each level
    weights: Floats  # (N, w) values of the signals that are torques

    @property
    def first(self) -> float:
        """The first output that was measured."""
        return float(self.y[np.argmax(self.measured)])

    def intervals_s(self, level: int) -> Floats:
        """Distinct intervals of a level, s."""
        return np.asarray(self.pairs[self.pairs[:, 1] == level, 0] * 1e-6)

    def in_order(self, of_levels: Sequence[Floats]) -> Floats:
        """Values for the intervals of one level after the other, in the order of the pairs."""
        places = [np.flatnonzero(self.pairs[:, 1] == j) for j in range(len(of_levels))]
        return np.concatenate(of_levels)[np.argsort(np.concatenate(places))]


def series(
    record: Record,
    signals: Sequence[str],
    late: int = 0,
    torques: Sequence[str] = (),
    min_speed: float = 0.0,
) -> PreparedRecord:
    """Prepare a record, with its torque ``late`` samples later.  Times are rounded to microseconds, as in the monitor.

    Parameters follow ``signals``, level by level; ``torques`` are inputs at each sample.  Errors count where the gates
    are open and the axis is as fast as ``min_speed``.

    Raises:
        ValueError: it lacks a signal, or nothing of it was measured with open gates, or all of it is slower; intervals
            too different for a shift.
    """
    if not record.measured.any():
        raise ValueError(f"{record.name or 'record'}: no output was measured")
    if not record.judged.any():
        raise ValueError(f"{record.name or 'record'}: the gates of the axis are closed throughout")
    if missing := [name for name in (*signals, *torques) if name not in record.signals]:
        raise ValueError(f"{record.name or 'record'}: no signal {missing[0]!r}")
    values, level = _levels([record.signals[name] for name in signals], len(record))
    t_us = np.rint(record.t * 1e6).astype(np.int64)
    intervals = np.diff(t_us)
    keys, step = np.unique(intervals * len(values) + level[:-1], return_inverse=True)
    pairs = np.stack(np.divmod(keys, len(values)), axis=1)
    y = np.where(record.measured, record.y, 0.0)
    measured = record.measured.astype(np.int64)
    counts = record.judged.astype(np.int64)
    if min_speed > 0:
        fast = MeasuredSpeed(record.quantity).take(t_us, record.y).speed >= min_speed
        if not fast.any():
            raise ValueError(f"{record.name or 'record'}: the axis is nowhere as fast as {min_speed:g} rad/s")
        counts = counts * fast
    if late and np.ptp(intervals) > _REGULAR * np.median(intervals):
        raise ValueError(f"{record.name or 'record'}: a delay of more than one interval needs equal intervals")
    u = record.u[np.clip(np.arange(len(record)) - late, 0, len(record) - 1)]
    weights = _filled([record.signals[name] for name in torques], len(record))
    return PreparedRecord(record, u, y, measured, counts, np.append(step, 0), level, pairs, values, weights)


def _levels(signals: Sequence[Floats], N: int) -> tuple[Floats, Ints]:
    """Mean values (L, s) and their index (N,); a missing value is replaced by the one before."""
    if not signals:
        return np.zeros((1, 0)), np.zeros(N, dtype=np.int64)
    filled = _filled(signals, N)
    parts = np.stack([_part(column) for column in filled.T], axis=1)
    level = np.unique(parts, axis=0, return_inverse=True)[1].reshape(-1)
    count = np.bincount(level)
    sums = [np.bincount(level, weights=column) for column in filled.T]
    return np.stack(sums, axis=1) / count[:, None], level


def _filled(signals: Sequence[Floats], N: int) -> Floats:
    """Signals side by side (N, s); a missing value is replaced by the one before, the first ones by the first."""
    columns = np.stack(signals, axis=1) if signals else np.zeros((N, 0))
    measured = np.isfinite(columns)
    if not measured.any(axis=0).all():
        raise ValueError("a signal that the parameters depend on was never measured")
    return forward_fill(columns, columns[measured.argmax(axis=0), np.arange(len(signals))])


def _part(column: Floats) -> Ints:
    """Index (N,) of the distinct value, or of the part of the range if there are too many values."""
    found, which = np.unique(column, return_inverse=True)
    if found.size <= MOST_LEVELS:
        return np.asarray(which, dtype=np.int64)
    low, high = found[0], found[-1]
    part = (column - low) / (high - low) * MOST_LEVELS
    return np.asarray(np.minimum(part, MOST_LEVELS - 1), dtype=np.int64)
