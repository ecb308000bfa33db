"""Means of an estimate over stretches of operation, with standard deviations that account for autocorrelation.

Estimates of a recursion that forgets are correlated like lambda^l (a discrete Ornstein-Uhlenbeck process), with the
variance sigma^2 = lambda_0 P_ii / (1 + lambda).  The mean of n of them, c samples apart, rho = lambda^c, has the
variance

    sigma^2 / n (1 + 2 sum_k (1 - k / n) rho^k)
        = sigma^2 / n ((1 + rho) / (1 - rho) - 2 rho (1 - rho^n) / n / (1 - rho)^2),    k from 1 to n - 1

(for any stationary series; the sum is geometric).  This is a lower bound: temperature, load and other effects that are
not in the model increase it, and only the history shows by how much.
"""

import itertools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats


class EstimateReading(NamedTuple):
    """Estimates of an axis with their variances, after a number of learned samples."""

    time_us: int
    value: tuple[float, ...]
    """theta - theta_0(s) + theta_0: the estimate, converted to the reference conditions of the nominal values"""
    variance: tuple[float, ...]
    """lambda_0 P_ii / (1 + lambda)"""
    known: tuple[bool, ...]
    """Whether the parameter is observed and the model holds"""
    span_s: float
    """Time in operation since the last reading [s]"""
    correlation: float
    """Correlation of the estimates of two successive readings"""
    holds: bool = True
    """Whether the model explains the measurements"""


class HistoryEntry(NamedTuple):
    """Mean of a parameter over a stretch of time in which it was observed."""

    start_us: int
    end_us: int
    middle_us: int
    """Mean of the times of its readings"""
    mean: float
    variance: float
    """Lower bound of the variance of the mean, from P"""
    operating_s: float
    """Time in operation during which the parameter was observed [s]"""


def inflation(n: int, rho: float) -> float:
    """Ratio of the variance of the mean of n values, correlated like rho^k, to that of independent values."""
    return (1 + rho) / (1 - rho) - 2 * rho * (1 - rho**n) / (n * (1 - rho) ** 2)


def merged(entries: Sequence[HistoryEntry]) -> HistoryEntry:
    """Merge consecutive entries into one, weighted by their information."""
    w = np.array([1 / e.variance for e in entries])
    first, total = entries[0].middle_us, float(w.sum())  # differences of times keep their digits
    later = float(w @ [e.middle_us - first for e in entries]) / total
    mean = float(w @ [e.mean - entries[0].mean for e in entries]) / total + entries[0].mean
    operating_s = sum(e.operating_s for e in entries)
    return HistoryEntry(entries[0].start_us, entries[-1].end_us, first + round(later), mean, 1 / total, operating_s)


def thinned(entries: Sequence[HistoryEntry], most: int) -> list[HistoryEntry]:
    """Merge neighbours so that at most ``most`` entries remain."""
    group = -(-len(entries) // most)
    if group <= 1:
        return list(entries)
    first = len(entries) % group  # the newest are whole groups
    starts = [*([0] if first else []), *range(first, len(entries), group)]
    ends = [*starts[1:], len(entries)]
    return [merged(entries[a:b]) for a, b in zip(starts, ends, strict=True)]


def as_rows(entries: Iterable[HistoryEntry]) -> Floats:
    """Entries as an array (N, 6), exact: times in microseconds since 1970 are whole numbers below 2^53."""
    return np.array([tuple(e) for e in entries], float).reshape(-1, len(HistoryEntry._fields))


def from_rows(rows: Floats) -> list[HistoryEntry]:
    """Entries from the array of ``as_rows``.

    Raises:
        ValueError: the rows are not valid entries.
    """
    if rows.ndim != 2 or rows.shape[1] != len(HistoryEntry._fields) or not np.isfinite(rows).all():
        raise ValueError(f"no entries of a history: numbers of shape {rows.shape}, or not finite")
    entries = [HistoryEntry(int(r[0]), int(r[1]), int(r[2]), *(float(v) for v in r[3:])) for r in rows]
    for e in entries:
        if not (e.start_us <= e.middle_us <= e.end_us and e.variance > 0 and e.operating_s > 0):
            raise ValueError(f"no entry of a history: {e}")
    if any(b.start_us < a.end_us for a, b in itertools.pairwise(entries)):
        raise ValueError("the entries of a history are not in order")
    return entries
