"""Parts of records: by share, by time, at gaps; and several joined into one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from monitor_core.identification.record import Record

_FEWEST = 2


def split(record: Record, shares: Sequence[float]) -> list[Record]:
    """The record in parts, in the order of time.

    Args:
        record: what is split.
        shares: the parts' sizes in proportion to each other, in samples: (2, 1) are two thirds and a third.

    Raises:
        ValueError: a share that is not positive; a part of fewer than two samples.
    """
    sizes = np.asarray(shares, dtype=np.float64)
    if sizes.size == 0 or not (np.isfinite(sizes) & (sizes > 0)).all():
        raise ValueError(f"shares {tuple(shares)}: each must be positive")
    ends = np.rint(np.cumsum(sizes) / sizes.sum() * len(record)).astype(int)
    starts = [0, *ends[:-1].tolist()]
    return [record.select(slice(start, end)) for start, end in zip(starts, ends.tolist(), strict=True)]


def between(record: Record, start_s: float, end_s: float) -> Record:
    """The samples from ``start_s`` to ``end_s``, seconds after the record's first sample, both ends included.

    Raises:
        ValueError: fewer than two samples are there; the text says how long the record is.
    """
    since = record.t - record.t[0]
    chosen = (since >= start_s) & (since <= end_s)
    if np.count_nonzero(chosen) < _FEWEST:
        what = f"record {record.name}" if record.name else "the record"
        raise ValueError(
            f"{what} has no two samples from {start_s:g} s on{'' if end_s == np.inf else f' to {end_s:g} s'}: it is "
            f"{record.duration_s:g} s long"
        )
    return record.select(chosen)


def segments(record: Record, gap_s: float) -> list[Record]:
    """The record cut wherever an interval is longer than ``gap_s``; what is left of one sample is dropped."""
    ends = np.append(np.flatnonzero(record.intervals > gap_s) + 1, len(record))
    starts = np.concatenate(([0], ends[:-1]))
    return [
        record.select(slice(start, end))
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
        if end - start >= _FEWEST
    ]


def join(records: Sequence[Record], gap_s: float | None = None) -> Record:
    """One record of several, one after the other in time.

    The torque of each last sample is held until the next record begins, which is true of parts of one record and
    of no others: fit records of different experiments side by side, or cut at the gap with ``segments``.

    Args:
        records: of the same quantity and with the same signals.
        gap_s: s; each begins so long after the end of the one before.  None: the times stay as they are.

    Raises:
        ValueError: no record; different quantities or signals; records that overlap in time.
    """
    _check_alike(records)
    shifts = [0.0]
    for before, after in pairwise(records):
        shifts.append(0.0 if gap_s is None else before.t[-1] + shifts[-1] + gap_s - after.t[0])
    first = records[0]
    return Record(
        np.concatenate([r.t + shift for r, shift in zip(records, shifts, strict=True)]),
        np.concatenate([r.u for r in records]),
        np.concatenate([r.y for r in records]),
        first.quantity,
        " + ".join(dict.fromkeys(r.name for r in records if r.name)),
        np.concatenate([r.measured for r in records]),
        {name: np.concatenate([r.signals[name] for r in records]) for name in first.signals},
    )


def _check_alike(records: Sequence[Record]) -> None:
    if not records:
        raise ValueError("no records to join")
    first = records[0]
    for other in records[1:]:
        if other.quantity != first.quantity:
            raise ValueError(f"records of {first.quantity} and of {other.quantity} cannot be joined")
        if other.signals.keys() != first.signals.keys():
            names = f"{sorted(first.signals)} and {sorted(other.signals)}"
            raise ValueError(f"records with signals {names} cannot be joined")
