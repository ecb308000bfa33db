"""Rows of the history as numbers: packed for the file, merged by their count, side by side on the same times."""

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
"""What a row has of each parameter, Q numbers"""

_Q = len(QUANTITIES)
_SINGLE = np.dtype([("mean", "<f4", _Q)])
_SEVERAL = np.dtype([("mean", "<f8", _Q), ("low", "<f4", _Q), ("high", "<f4", _Q)])
"""A row of one point has 28 bytes, a row of several 112."""


class Rows(NamedTuple):
    """N rows: begin of each [s since 1970], number of points in it, their mean and their ends (N, Q)."""

    t: Ints
    n: Ints
    mean: Floats
    low: Floats
    high: Floats

    def select(self, which: Bools | slice | Ints) -> "Rows":
        """Some of the rows."""
        t, n, mean, low, high = self
        return Rows(t[which], n[which], mean[which], low[which], high[which])


NO_ROWS = Rows(np.zeros(0, np.int64), np.zeros(0, np.int64), *(np.zeros((0, _Q)) for _ in range(3)))


def points(t: Sequence[int], values: Sequence[Sequence[float]]) -> Rows:
    """Points as rows of one point each, rounded to what the file keeps: seven digits."""
    with np.errstate(over="ignore", under="ignore"):
        rounded = np.asarray(values, float).reshape(-1, _Q).astype(np.float32).astype(float)
    return Rows(np.asarray(t, np.int64), np.ones(len(t), np.int64), rounded, rounded, rounded)


def joined(parts: Iterable[Rows]) -> Rows:
    """Rows one after the other."""
    return Rows(*(np.concatenate(columns) for columns in zip(NO_ROWS, *parts, strict=True)))


def merged(rows: Rows, step_s: int, series: Ints | None = None) -> tuple[Rows, Ints]:
    """Rows of the same series and of the same step of time as one row each, and their series; in order of both.

    Each point counts once: the mean is weighted by the counts.  A number that is not finite makes its mean so.

    Args:
        rows: N rows.
        step_s: length of a step [s]; the rows of a step are those that begin in it.
        series: (N,); None: all are of one.
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
    return Rows(begin[first], n, mean, low, high), series[first]


def packed(rows: Rows) -> list[bytes]:
    """The numbers of each row, for the file."""
    single, several = np.zeros(len(rows.n), _SINGLE), np.zeros(len(rows.n), _SEVERAL)
    with np.errstate(over="ignore", under="ignore"):
        single["mean"] = rows.mean
    several["mean"], several["low"], several["high"] = rows.mean, rows.low, rows.high
    texts = zip(single, several, strict=True)
    return [(a if n == 1 else b).tobytes() for n, (a, b) in zip(rows.n, texts, strict=True)]


def unpacked(found: Iterable[tuple[int, int, bytes]]) -> Rows:
    """Rows from begin, count and numbers of each in the file; those that are damaged are left out."""
    t, n, cells = list[int](), list[int](), list[bytes]()
    for begin, count, numbers in found:  # thousands of tuples at once would keep the garbage collector busy
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
    return Rows(np.array(t, np.int64), counts, mean, low, high)


def aligned(rows: Sequence[Rows], step_s: int, gap_s: float) -> tuple[Ints, list[Rows]]:
    """Rows of several parameters on the same times; where a parameter has none, its count is 0 and the rest NaN.

    Args:
        rows: of each parameter, in order of time, on whole steps.
        step_s: the length of a row [s].
        gap_s: times that are farther apart have a gap between them: one time at its beginning, without any row.

    Returns:
        The times (M,), and M rows of each parameter.
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
        found.append(Rows(times, n, *columns))
    return times, found
