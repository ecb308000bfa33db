"""The records of an identification: loaded, checked, cut at their gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.identification import (
    GapCut,
    IdentificationError,
    KnownAxis,
    Record,
    ScheduledTerm,
    check_record,
    cut_at_gaps,
    most_moving_parts,
    with_terms,
)
from service.config import Config
from service.ingest.records.loaded_records import Loaded, load, loaded_part

SAME_INTERVAL = 0.01
"""Largest relative difference of intervals that count as equal, such as in a file of nominal values and its axis"""
_OTHER_SAMPLING = 2.0
"""Ratio of intervals above which the sampling differs; below it the clock is only inexact"""
TIME_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
"""Units of time, by how many of them make a second"""


class IdentificationRecords(NamedTuple):
    """The records to which a drive is fitted, and those that are only predicted."""

    estimation: Sequence[Loaded]
    validation: Sequence[Loaded]

    @property
    def fitted(self) -> list[Record]:
        """The samples to which the drive is fitted."""
        return [item.record for item in self.estimation]

    @property
    def every(self) -> list[Record]:
        """The samples of all records."""
        return [item.record for item in (*self.estimation, *self.validation)]

    def warnings(self, known: KnownAxis, interval_s: float) -> Iterator[str]:
        """What is doubtful in the records, in sentences.

        Raises:
            IdentificationError: a record is refused.
        """
        yield from _doubts(self.every, known)
        yield from _interval_doubts(self.every, interval_s)

    def without_gaps(self, known: KnownAxis) -> tuple[IdentificationRecords, Sequence[str]]:
        """The records, those with gaps as the parts between them, and what is used of each of these, in sentences."""
        (estimation, cuts), (validation, more_cuts) = (_without_gaps(items, known) for items in self)
        return IdentificationRecords(estimation, validation), [_gap_warning(cut) for cut in (*cuts, *more_cuts)]

    def with_terms(self, scheduled: Sequence[ScheduledTerm]) -> IdentificationRecords:
        """The records with the values of the terms that parameters follow."""
        return IdentificationRecords(
            *([item._replace(record=with_terms(item.record, scheduled)) for item in items] for items in self)
        )

    def with_most_moving_parts(self) -> IdentificationRecords:
        """Of long records to which the drive is fitted only the part with the most motion."""
        parts = zip(self.estimation, most_moving_parts(self.fitted), strict=True)
        return self._replace(estimation=[item._replace(record=part) for item, part in parts])

    def interval_s(self, configured_s: float) -> float:
        """The configured interval if the fitted records agree with it, else that of them, since K depends on it."""
        measured_s = float(np.median([record.mean_interval_s for record in self.fitted]))
        alike = math.isclose(measured_s, configured_s, rel_tol=SAME_INTERVAL)
        return configured_s if alike else float(f"{measured_s:.5g}")


def load_records(
    config: Config, axis_id: str, records: Sequence[str], validation: Sequence[str]
) -> IdentificationRecords:
    """Load the records of an axis, each a file with or without a range.

    Raises:
        RecordError, DescriptionError, IngestError: a record cannot be read.
    """
    return IdentificationRecords(*([load(text, config, axis_id) for text in texts] for texts in (records, validation)))


def _doubts(records: Sequence[Record], known: KnownAxis) -> list[str]:
    findings = [
        (finding.severity, f"{record.name}: {finding.sentence}.")
        for record in records
        for finding in check_record(record, known)
    ]
    if refused := [words for severity, words in findings if severity == "refuse"]:
        raise IdentificationError("refused: " + "\n".join(refused))
    return [words for _, words in findings]


def _interval_doubts(records: Sequence[Record], interval_s: float) -> Iterator[str]:
    """Warnings about the sample intervals of records, in sentences."""
    for record in records:
        measured_s = record.mean_interval_s
        ratio = measured_s / interval_s
        apart = f"its samples are {measured_s:.6g} s apart"
        differ = f"{record.name}: {apart}, but sample_interval_s = {interval_s:g}"
        if not 1 / _OTHER_SAMPLING < ratio < _OTHER_SAMPLING:
            mistake = "correct it, or the times, which must be in seconds"
            for factor, unit in TIME_UNITS.items():
                if math.isclose(ratio, factor, rel_tol=0.1):
                    mistake = f"times must be in seconds, these look like {unit}"
            raise IdentificationError(f"{differ}: {mistake}")
        if not math.isclose(ratio, 1.0, rel_tol=SAME_INTERVAL):
            yield (
                f"{differ}: the result belongs to the interval of this record; for the daemon, set sample_interval_s ="
                f" {measured_s:.5g}."
            )


def _without_gaps(items: Sequence[Loaded], known: KnownAxis) -> tuple[list[Loaded], Sequence[GapCut]]:
    """The records, those with gaps as the parts between them, and what is used of each of these."""
    parts, cuts = cut_at_gaps(
        [item.record for item in items], known.slowest_s, [item.source.begins_s for item in items]
    )
    return [loaded_part(items[part.number], part) for part in parts], cuts


def _gap_warning(cut: GapCut) -> str:
    if cut.parts:
        share = f"{100 * cut.used:.3g} % of the samples, in {cut.parts} parts"
        return f"{cut.name}: cut at its gaps; {share}, are used."
    return (
        f"{cut.name}: used as a whole, since little is left between its gaps; the drive may then seem not to"
        " explain the motion: record again, without gaps."
    )
