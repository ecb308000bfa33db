"""Finds bad rows of a damaged table that look right one by one: next to broken rows, or with a time that runs ahead."""

from bisect import bisect_left

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints

_NEAR_ROWS = 10
"""Rows farther than this from a broken row are accepted, and so are sequences longer than this without a step."""
_MIN_STEPS = 20
"""Fewest steps far from broken rows from which the largest step of a column is known."""
_EXTRA_STEPS = 2.0
"""Extra largest steps that a column may make, besides one for each row."""


def torn(values: Floats, broken: Bools) -> Bools:
    """Mask of the rows (N,) that belong to the damage around ``broken`` rows, although each cell alone could be right.

    A faulty writer continues with shifted cells or with cells from elsewhere, and many of these look like measurements.
    So rows next to broken rows are accepted only if they continue the good rows across the damage: no column moves
    farther than it does elsewhere in as many rows.

    Args:
        values: all columns but the time (N, C); NaN: missing.
        broken: mask of the broken rows (N,).
    """
    largest = _largest_steps(values, ~_near(broken))
    starts = np.flatnonzero(np.append(True, _apart(values, broken, largest)))
    ends = np.append(starts[1:], len(broken)) - 1
    long = ends - starts >= _NEAR_ROWS
    out, long_starts, long_ends = np.zeros(len(broken), np.bool_), starts[long], ends[long]
    if not long.any():
        return out
    for first, last in zip(starts[~long].tolist(), ends[~long].tolist(), strict=True):
        if not broken[first]:
            next_ = int(np.searchsorted(long_starts, first))
            pairs = [(first, k) for k in long_ends[max(next_ - 1, 0) : next_].tolist()]
            pairs += [(last, k) for k in long_starts[next_ : next_ + 1].tolist()]
            out[first : last + 1] = not any(_continue(values, i, k, largest) for i, k in pairs)
    return out


def _near(broken: Bools) -> Bools:
    counts = np.cumsum(np.pad(broken.astype(np.int64), (_NEAR_ROWS + 1, _NEAR_ROWS)))
    return np.asarray(counts[2 * _NEAR_ROWS + 1 :] > counts[: -2 * _NEAR_ROWS - 1], np.bool_)


def _largest_steps(values: Floats, quiet: Bools) -> Floats:
    """Largest step of each column (C,) from one row to the next; infinite if not known."""
    pairs = quiet[1:] & quiet[:-1]
    if np.count_nonzero(pairs) < _MIN_STEPS:
        return np.full(values.shape[1], np.inf)
    return np.asarray(np.fmax.reduce(abs(np.diff(values, axis=0))[pairs], axis=0, initial=0.0))


def _apart(values: Floats, broken: Bools, largest: Floats) -> Bools:
    """Mask of the rows that do not continue the row before (N - 1,), without the first row."""
    far = (abs(np.diff(values, axis=0)) > (1 + _EXTRA_STEPS) * largest).any(axis=1)
    return np.asarray(broken[1:] | broken[:-1] | far, np.bool_)


def _continue(values: Floats, i: int, k: int, largest: Floats) -> bool:
    rows = abs(i - k)
    return rows <= _NEAR_ROWS and not (abs(values[i] - values[k]) > (rows + _EXTRA_STEPS) * largest).any()


def ahead(times: Floats, usable: Bools) -> Bools:
    """Mask of the rows (N,) whose time is wrong, as it is later than that of right rows after them.

    The largest subset of the ``usable`` rows with increasing times is accepted.  Otherwise a single row with a too late
    time would make all rows after it count as late.
    """
    out = np.zeros(len(times), np.bool_)
    at = np.flatnonzero(usable)
    t = times[at]
    in_turn = np.count_nonzero(np.diff(np.maximum.accumulate(t)) > 0) + 1 if len(t) else 0
    if in_turn == len(t) or len(kept := _longest_rise(t)) <= in_turn:
        return out
    following = np.searchsorted(kept, np.arange(len(t)))  # the next kept row, or the row itself if it is kept
    next_time = np.append(t[kept], np.inf)[following]
    out[at] = t > next_time
    return out


def _longest_rise(values: Floats) -> Ints:
    """Indices of the longest strictly increasing subsequence (K,).

    C. Schensted, Canadian J. Math. 13 (1961): keep, for each length, the smallest last value of a subsequence.
    """
    ends, where, before = list[float](), list[int](), list[int]()
    for k, value in enumerate(values.tolist()):
        length = bisect_left(ends, value)
        before.append(where[length - 1] if length else -1)
        ends[length : length + 1], where[length : length + 1] = [value], [k]
    found, k = list[int](), where[-1]
    while k >= 0:
        found.append(k)
        k = before[k]
    return np.array(found[::-1], dtype=np.int64)
