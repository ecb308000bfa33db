"""Records with gaps, cut into the parts between them before a fit.

The torque in a gap is not known, and a drive that runs through it with an unknown torque is off for long afterwards:
after a few gaps no drive seems to explain the record.
"""

from collections.abc import Sequence
from typing import NamedTuple

from monitor_core.identification.records.measured_record import GAP, Record, pieces

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
