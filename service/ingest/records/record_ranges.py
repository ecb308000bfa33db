"""Ranges of records: FILE@10:60 are the seconds 10 to 60 of a file, after the first sample of each axis."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from service.can.messages import DescriptionError
from service.can.user_errors import RecordError
from service.config.schema import Config
from service.ingest.records.record_files import FileRecord, RecordQuality, RecordStep, read_record

_RANGE = re.compile(r"(?P<path>.+)@(?P<start>[^@:/]*):(?P<end>[^@/]*)")
_DATED_US = 10**14
"""Later times [us since 1970] are dates, of 1973 and later; other records begin at 0"""


class Wanted(NamedTuple):
    """A file and a range in it, in seconds after the first sample; None: from the start, or to the end."""

    path: Path
    start_s: float | None = None
    end_s: float | None = None


def wanted(text: str) -> Wanted:
    """Parse ``FILE``, ``FILE@10:60``, ``FILE@10:`` or ``FILE@:60``: seconds after the first sample of the axis.

    A file whose name is the whole text takes precedence.

    Raises:
        RecordError: the range is invalid.
    """
    found = _RANGE.fullmatch(text)
    if found is None or Path(text).exists():
        return Wanted(Path(text))
    try:
        start, end = (float(part) if part else None for part in (found["start"], found["end"]))
    except ValueError:
        raise RecordError(f"{text}: a range is @START:END in seconds, such as @10:60, @10: or @:60") from None
    if start is not None and end is not None and start >= end:
        raise RecordError(f"{text}: the range ends before its start")
    return Wanted(Path(found["path"]), start, end)


def in_order_of_time(texts: Sequence[str], config: Config) -> list[str]:
    """Records in the order of their times; as they are given if these overlap, or if any has no dates.

    A shell lists log_10 before log_2, but heat goes on from one record to the next.  What is wrong with a file is left
    to those who use it.

    Args:
        texts: see ``wanted``.
        config: the configuration.
    """
    if len(texts) < 2:
        return list(texts)
    try:
        spans = {text: _span_us(RecordRange(text, config)) for text in texts}
    except (RecordError, DescriptionError):
        return list(texts)
    ordered = sorted(spans, key=spans.__getitem__)
    apart = len(ordered) == len(texts) and all(spans[a][1] < spans[b][0] for a, b in pairwise(ordered))
    return ordered if apart and spans[ordered[0]][0] > _DATED_US else list(texts)


def _span_us(record: RecordRange) -> tuple[int, int]:
    """Times of the first and of the last sample of any axis [us]; 0 and 0 without any."""
    ends = [int(block.t_us[at]) for step in record.steps() for block in step.samples.values() for at in (0, -1)]
    return min(ends, default=0), max(ends, default=0)


class RecordRange:
    """A file, or a range in it: the samples of all axes.

    Args:
        text: see ``wanted``.
        config: the configuration.

    Raises:
        RecordError, DescriptionError: as of ``read_record``; the range is invalid.
    """

    def __init__(self, text: str, config: Config) -> None:
        want = wanted(text)
        self._start_s = -math.inf if want.start_s is None else want.start_s
        self._end_s = math.inf if want.end_s is None else want.end_s
        self._record: FileRecord = read_record(want.path, config)
        self.path, self.name = want.path, Path(text).name

    @property
    def quality(self) -> RecordQuality:
        """The quality of what has been read so far, also before the range."""
        return self._record.quality

    @property
    def left_out(self) -> Sequence[str]:
        """Places that could not be read, with their faults; complete when the record has been read."""
        return self._record.left_out

    def steps(self) -> Iterator[RecordStep]:
        """Read the samples in order; possible once.

        Raises:
            RecordError: the file is damaged, or has no sample in the range.
        """
        first_us, last_s, found = dict[str, int](), dict[str, float](), False
        for step in self._record.steps():
            samples = {}
            for axis_id, block in step.samples.items():
                since_s = (block.t_us - first_us.setdefault(axis_id, int(block.t_us[0]))) * 1e-6
                last_s[axis_id] = float(since_s[-1])
                part = block.select((since_s >= self._start_s) & (since_s <= self._end_s))
                if part.size:
                    samples[axis_id], found = part, True
            yield RecordStep(samples, step.done)
            if last_s and min(last_s.values()) > self._end_s:
                break
        if last_s and not found:
            raise RecordError(
                f"{self.path}: no sample after {self._start_s:g} s; the record is {max(last_s.values()):g} s long"
            )
