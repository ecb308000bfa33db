"""The parts of long records in which an axis moves most: enough to find where a fit starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monitor_core.identification.records.measured_record import Record

ENOUGH = 40_000
"""Samples to find starting values, the speed scale of friction, and whether a drive is right at all."""


def lively_parts(records: Sequence[Record], most: int = ENOUGH) -> Sequence[Record]:
    """Of long records the stretch with most motion, so that no more than ``most`` samples are left.

    Short records stay as they are: all are cut to the same length, if they are longer.
    """
    length = _length([len(record) for record in records], most)
    return [record if len(record) <= length else _liveliest(record, length) for record in records]


def _length(counts: Sequence[int], most: int) -> int:
    """To which records of so many samples are cut, so that ``most`` are left."""
    left, longer = most, sorted(counts)
    while longer and longer[0] * len(longer) <= left:
        left -= longer.pop(0)
    return left // len(longer) if longer else max(counts, default=0)


def _liveliest(record: Record, length: int) -> Record:
    """The stretch of so many samples over which the motion changes most from sample to sample."""
    y = np.where(record.measured, record.y, np.nan)
    steps = np.nan_to_num(abs(np.diff(y)))
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    within = travelled[length - 1 :] - travelled[: len(travelled) - length + 1]
    first = int(np.argmax(within))
    return record.select(slice(first, first + length))
