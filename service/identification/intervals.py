"""Whether records are sampled as the configuration says: other units of time, or every how manieth sample."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from monitor_core.identification.record import Record
from service.identification.errors import IdentificationError

_SAME = 0.01
"""Relative; the same that a file of nominal values may differ from its axis."""
_FAR = 2.0
"""Times: that is another sampling, not a clock that is a little off."""
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}


def intervals(records: Sequence[Record], interval_s: float) -> Iterator[str]:
    """Doubts about the times of records, in sentences.

    Raises:
        IdentificationError: they are far from what is configured.
    """
    for record in records:
        ratio = record.interval_s / interval_s
        apart = f"its samples are {record.interval_s:.6g} s apart, but sample_interval_s = {interval_s:g}"
        differ = f"{record.name}: {apart}"
        if not 1 / _FAR < ratio < _FAR:
            raise IdentificationError(f"{differ}: {_unit(ratio)}")
        if not math.isclose(ratio, 1.0, rel_tol=_SAME):
            yield f"{differ}: what is found then belongs to this record's interval, and the daemon refuses it."


def _unit(ratio: float) -> str:
    """What is probably wrong."""
    for factor, unit in _UNITS.items():
        if math.isclose(ratio, factor, rel_tol=0.1):
            return f"times are to be in seconds, these look like {unit}"
    return "correct it, or the times, which are to be in seconds"
