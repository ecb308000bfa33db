"""A record prepared for the compiled predictor: distinct intervals, and levels of the scheduling signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.records.record import Record

MOST_LEVELS = 32
"""A slowly varying signal counts as constant within the 32nd part of its range."""

_REGULAR = 0.01


@dataclass(frozen=True, eq=False)
class Series:
    """A record with its distinct (interval, level) pairs."""

    record: Record
    u: Floats  # (N,)
    y: Floats  # (N,) zero where not measured
    measured: Ints  # (N,) 0 or 1
    step: Ints  # (N,) which of the pairs leads to the next sample
    level: Ints  # (N,) which of the levels applies
    pairs: Ints  # (G, 2) interval in us, level
    signals: Floats  # (L, s) the signals' values at each level

    @property
    def first(self) -> float:
        """The first output that was measured."""
        return float(self.y[np.argmax(self.measured)])


def series(record: Record, signals: Sequence[str], late: int = 0) -> Series:
    """Prepare a record, with its torque ``late`` samples later.  Times are rounded to microseconds, as in the monitor.

    Raises:
        ValueError: it lacks a signal, or nothing of it was measured; intervals too different for a shift.
    """
    if not record.measured.any():
        raise ValueError(f"{record.name or 'record'}: no output was measured")
    missing = [name for name in signals if name not in record.signals]
    if missing:
        raise ValueError(f"{record.name or 'record'}: no signal {missing[0]!r}")
    values, level = _levels([record.signals[name] for name in signals], len(record))
    intervals = np.diff(np.rint(record.t * 1e6).astype(np.int64))
    keys, step = np.unique(intervals * len(values) + level[:-1], return_inverse=True)
    pairs = np.stack(np.divmod(keys, len(values)), axis=1)
    y = np.where(record.measured, record.y, 0.0)
    measured = record.measured.astype(np.int64)
    if late and np.ptp(intervals) > _REGULAR * np.median(intervals):
        raise ValueError(
            f"{record.name or 'record'}: the torque is late by more than one interval, and those differ"
        )
    u = record.u[np.clip(np.arange(len(record)) - late, 0, len(record) - 1)]
    return Series(record, u, y, measured, np.append(step, 0), level, pairs, values)


def _levels(signals: Sequence[Floats], N: int) -> tuple[Floats, Ints]:
    """Mean values (L, s) and their index (N,); a missing value is replaced by the one before."""
    if not signals:
        return np.zeros((1, 0)), np.zeros(N, dtype=np.int64)
    filled = np.stack([_filled(signal) for signal in signals], axis=1)
    parts = np.stack([_part(column) for column in filled.T], axis=1)
    level = np.unique(parts, axis=0, return_inverse=True)[1].reshape(-1)
    count = np.bincount(level)
    sums = [np.bincount(level, weights=column) for column in filled.T]
    return np.stack(sums, axis=1) / count[:, None], level


def _filled(signal: Floats) -> Floats:
    good = np.flatnonzero(np.isfinite(signal))
    if good.size == 0:
        raise ValueError("a signal that the parameters depend on was never measured")
    return signal[good[np.maximum(np.searchsorted(good, np.arange(signal.size), side="right") - 1, 0)]]


def _part(column: Floats) -> Ints:
    """Index of its distinct value, or of the part of its range if there are too many values."""
    found, which = np.unique(column, return_inverse=True)
    if found.size <= MOST_LEVELS:
        return np.asarray(which, dtype=np.int64)
    low, high = found[0], found[-1]
    part = (column - low) / (high - low) * MOST_LEVELS
    return np.asarray(np.minimum(part, MOST_LEVELS - 1), dtype=np.int64)
