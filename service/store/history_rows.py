"""Rows of the history as arrays: packing for the file, merging, alignment to common times."""

from collections.abc import Iterable, Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints

QUANTITIES = (
    "estimate",
    "deviation",
    "standard_deviation",
    "cusum_up",
    "cusum_down",
    "threshold",
    "observability",
)
"""The Q quantities of a row"""

_Q = len(QUANTITIES)
_SINGLE = np.dtype([("mean", "<f4", _Q)])
_SEVERAL = np.dtype([("mean", "<f8", _Q), ("low", "<f4", _Q), ("high", "<f4", _Q)])
"""Formats of a row with one point (28 bytes) and with several points (112 bytes)."""


class HistoryRows(NamedTuple):
    """N rows: start [s since 1970] and number of points (N,); mean, minimum and maximum (N, Q)."""

    t: Ints
    n: Ints
    mean: Floats
    low: Floats
    high: Floats

    def select(self, which: Bools | slice | Ints) -> "HistoryRows":
        """Only the rows of a mask, slice or index array."""
        t, n, mean, low, high = self
        return HistoryRows(t[which], n[which], mean[which], low[which], high[which])


NO_ROWS = HistoryRows(np.zeros(0, np.int64), np.zeros(0, np.int64), *(np.zeros((0, _Q)) for _ in range(3)))


def points(t: Sequence[int], values: Sequence[Sequence[float]]) -> HistoryRows:
    """Points as rows of one point each, rounded to the seven digits that the file stores."""
    with np.errstate(over="ignore", under="ignore"):
        rounded = np.asarray(values, float).reshape(-1, _Q).astype(np.float32).astype(float)
    return HistoryRows(np.asarray(t, np.int64), np.ones(len(t), np.int64), rounded, rounded, rounded)


def joined(parts: Iterable[HistoryRows]) -> HistoryRows:
    """Join rows, in their order."""
    return HistoryRows(*(np.concatenate(columns) for columns in zip(NO_ROWS, *parts, strict=True)))


def merged(rows: HistoryRows, step_s: int, series: Ints | None = None) -> tuple[HistoryRows, Ints]:
    """Merge rows of the same series and the same time step; returns rows and their series, sorted by series and time.

    The mean is weighted by the number of points.  It is not finite if one of the values is not finite.

    Args:
        rows: N rows.
        step_s: length of a step [s]; a row belongs to the step in which it starts.
        series: series of each row (N,); None: all rows are of one series.
    """
    begin = rows.t // step_s * step_s
    series = np.zeros(len(begin), np.int64) if series is None else series
    order = np.lexsort((begin, series))
    rows, begin, series = rows.select(order), begin[order], series[order]
    first = np.flatnonzero(np.r_[True, (np.diff(begin) != 0) | (np.diff(series) != 0)][: len(begin)])
    if len(first) == len(begin):
        return rows._replace(t=begin), series
    n = np.add.reduceat(rows.n, first)
    with np.errstate(invalid="ignore"):
        mean = np.add.reduceat(rows.n[:, None] * rows.mean, first, axis=0) / n[:, None]
        low, high = np.minimum.reduceat(rows.low, first), np.maximum.reduceat(rows.high, first)
    return HistoryRows(begin[first], n, mean, low, high), series[first]


def packed(rows: HistoryRows) -> list[bytes]:
    """The bytes of each row for the file."""
    single, several = np.zeros(len(rows.n), _SINGLE), np.zeros(len(rows.n), _SEVERAL)
    with np.errstate(over="ignore", under="ignore"):
        single["mean"] = rows.mean
    several["mean"], several["low"], several["high"] = rows.mean, rows.low, rows.high
    texts = zip(single, several, strict=True)
    return [(a if n == 1 else b).tobytes() for n, (a, b) in zip(rows.n, texts, strict=True)]


def unpacked(found: Iterable[tuple[int, int, bytes]]) -> HistoryRows:
    """Rows from the start, count and bytes of each in the file; damaged rows are left out."""
    t, n, cells = list[int](), list[int](), list[bytes]()
    # Not a list of tuples: thousands of them slow the garbage collector down.
    for begin, count, numbers in found:
        t.append(begin)
        n.append(count)
        cells.append(numbers)
    if not t:
        return NO_ROWS
    counts = np.array(n, np.int64)
    alone, sizes = counts == 1, np.fromiter(map(len, cells), np.int64, len(cells))
    sound = (sizes == np.where(alone, _SINGLE.itemsize, _SEVERAL.itemsize)) & (counts > 0)
    if not sound.all():
        return unpacked(compress(zip(t, n, cells, strict=True), sound))
    mean, low, high = (np.empty((len(counts), _Q)) for _ in range(3))
    for which, kind, names in ((alone, _SINGLE, ("mean",) * 3), (~alone, _SEVERAL, ("mean", "low", "high"))):
        rows = np.frombuffer(b"".join(compress(cells, which)), kind)
        for column, name in zip((mean, low, high), names, strict=True):
            column[which] = rows[name]
    return HistoryRows(np.array(t, np.int64), counts, mean, low, high)


def aligned(rows: Sequence[HistoryRows], step_s: int, gap_s: float) -> tuple[Ints, list[HistoryRows]]:
    """Align rows of several parameters to common times; where a parameter has no row, its count is 0 and the rest NaN.

    Args:
        rows: rows of each parameter, sorted by time, starting at whole steps.
        step_s: length of a row [s].
        gap_s: times farther apart than this get an additional time at the start of the gap, without any row.

    Returns:
        The times (M,), and M rows for each parameter.
    """
    times = np.unique(np.concatenate([NO_ROWS.t, *(r.t for r in rows)]))
    gaps = times[:-1][np.diff(times) > gap_s] + step_s
    times = np.union1d(times, gaps)
    found = []
    for r in rows:
        at = np.searchsorted(times, r.t)
        n = np.zeros(len(times), np.int64)
        n[at] = r.n
        columns = []
        for known in (r.mean, r.low, r.high):
            column = np.full((len(times), _Q), np.nan)
            column[at] = known
            columns.append(column)
        found.append(HistoryRows(times, n, *columns))
    return times, found
