"""Parts of records: by time, between gaps, and where an axis moves most.

The torque in a gap is not known, and a drive that runs through it with an unknown torque is off for long afterwards:
after a few gaps no drive seems to explain the record.  So records are cut at their gaps before a fit.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.identification.records.measured_record import GAP, Record

_FEWEST = 2
"""Samples of a record, at least"""


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


def pieces(record: Record) -> list[Record]:
    """A record between its gaps; pieces of a single sample are dropped."""
    ends = np.append(np.flatnonzero(record.intervals > GAP * record.interval_s) + 1, len(record))
    starts = np.concatenate(([0], ends[:-1]))
    return [
        record.select(slice(start, end))
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
        if end - start >= _FEWEST
    ]


def open_pieces(record: Record) -> list[Record]:
    """The pieces of a record between its gaps in which the gates are open all the time."""
    return [part for piece in pieces(record) for part in _open_parts(piece)]


def _open_parts(record: Record) -> Iterator[Record]:
    if record.gate is None:
        yield record
        return
    edges = np.flatnonzero(np.diff(record.gate.astype(np.int8), prepend=0, append=0))
    for start, end in edges.reshape(-1, 2).tolist():
        if end - start >= _FEWEST:
            yield record.select(slice(start, end))


# --- The parts between gaps that are fitted ---------------------------------------------------------------------------


_MIN_SAMPLES = 1000
"""Least number of samples of a part that is fitted: many more than the values of its own unknown initial state."""
_MIN_SHARE = 0.5
"""Least share of the samples that the parts must hold together; otherwise the record is used uncut."""
_MIN_TIME_CONSTANTS = 5.0
"""Least length of a part, in time constants of the drive; then its unknown initial state matters little."""


class RecordPart(NamedTuple):
    """A record without gaps, or what is fitted of one with gaps.

    ``number``: which of the given records it belongs to.  ``begins_s``: clock time of its first sample [s]; None: not
    known.
    """

    record: Record
    number: int
    begins_s: float | None


class GapCut(NamedTuple):
    """What is used of a record with gaps.

    ``name``: of the record.  ``parts``: number of parts between the gaps that are used; 0: the record is used uncut,
    gaps and all, since little is left between them.  ``used``: share of the samples in these parts.
    """

    name: str
    parts: int
    used: float


def cut_at_gaps(
    records: Sequence[Record], slowest_s: float | None, begins_s: Sequence[float | None] = ()
) -> tuple[tuple[RecordPart, ...], tuple[GapCut, ...]]:
    """The parts of records to fit, in their order, and what is used of each record with gaps.

    Args:
        records: with or without gaps.
        slowest_s: slowest time constant of the drive [s]; None: not known.
        begins_s: clock times of the records' first samples [s]; None, or none at all: unknown.  If there is only one
            record, its own times then take their place.
    """
    starts_s = [*begins_s, *[None] * len(records)][: len(records)]
    if len(records) == 1 and starts_s[0] is None:
        starts_s = [float(records[0].t[0])]
    parts, cuts = list[RecordPart](), list[GapCut]()
    for number, (record, start_s) in enumerate(zip(records, starts_s, strict=True)):
        found = long_pieces(record, _MIN_TIME_CONSTANTS * (slowest_s or 0.0))
        for piece in found or [record]:
            later_s = float(piece.t[0] - record.t[0])
            parts.append(RecordPart(piece, number, None if start_s is None else start_s + later_s))
        if not found or found[0] is not record:
            cuts.append(GapCut(record.name, len(found), sum(map(len, found)) / len(record)))
    return tuple(parts), tuple(cuts)


def long_pieces(record: Record, shortest_s: float = 0.0) -> list[Record]:
    """The pieces of a record between its gaps that are worth a fit; empty if most of the record would be lost.

    A record without a gap is returned as it is.
    """
    if not (record.intervals > GAP * record.interval_s).any():
        return [record]
    found = [piece for piece in pieces(record) if len(piece) >= _MIN_SAMPLES and piece.duration_s >= shortest_s]
    return found if sum(map(len, found)) >= _MIN_SHARE * len(record) else []


# --- The part with most motion ----------------------------------------------------------------------------------------


_ENOUGH = 40_000
"""Number of samples that suffices to find starting values and the speed scale of friction, and to judge a drive."""


def most_moving_parts(records: Sequence[Record], most: int = _ENOUGH) -> Sequence[Record]:
    """The stretches with most motion of long records, so that at most ``most`` samples remain.

    Short records stay as they are: all are cut to the same length, if they are longer.
    """
    length = _length([len(record) for record in records], most)
    return [record if len(record) <= length else _most_moving(record, length) for record in records]


def _length(counts: Sequence[int], most: int) -> int:
    """Length to which records with these numbers of samples are cut, so that ``most`` samples remain."""
    left, longer = most, sorted(counts)
    while longer and longer[0] * len(longer) <= left:
        left -= longer.pop(0)
    return left // len(longer) if longer else max(counts, default=0)


def _most_moving(record: Record, length: int) -> Record:
    """The stretch of ``length`` samples in which the motion changes most from sample to sample."""
    y = np.where(record.measured, record.y, np.nan)
    steps = np.nan_to_num(abs(np.diff(y)))
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    within = travelled[length - 1 :] - travelled[: len(travelled) - length + 1]
    first = int(np.argmax(within))
    return record.select(slice(first, first + length))
