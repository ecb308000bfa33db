"""What is wrong with the length of a record and with its times."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from monitor_core.identification.record import Record
from monitor_core.identification.record_checks.finding import Finding, Known

_FEWEST = 50
_PER_PARAMETER = 10
"""Residuals of fewer samples for each parameter tell the noise no better than within a quarter, so nothing tested
against it can be trusted."""
_TAUS_LEAST, _TAUS_ENOUGH = 1.0, 5.0
"""Within one time constant of the slowest motion it looks like a straight line; after five the unknown initial state
has decayed to less than 1 %."""
_GAP = 10.0
"""Typical intervals; the daemon, too, starts its predictor afresh there unless told otherwise."""
_LOST = 0.02
"""Part of all samples: 2 % lost cost 13 % of a damper when they go unnoticed; here they are noticed, but the torque
between is still not known."""
_JITTER, _JITTER_S = 0.02, 2e-4
"""Scatter of the intervals, as part of them and in s: stamps late by 0.3 ms give 2 % spread in the friction."""
_STAMPS = -0.35
"""Correlation of neighbouring intervals: -0.5 for errors of the stamps about a regular clock; 0 where the sampling
itself is irregular, which costs nothing."""


def times(record: Record, known: Known) -> Iterator[Finding]:
    """Too short, gaps, lost samples, jitter of the stamps."""
    yield from _too_short(record, known)
    yield from _gaps(record)
    yield from _lost(record)
    yield from _jitter(record)


def _too_short(record: Record, known: Known) -> Iterator[Finding]:
    count, least = int(np.count_nonzero(record.measured)), max(_FEWEST, _PER_PARAMETER * known.parameters)
    if count < least:
        purpose = f" for {known.parameters} parameters" if known.parameters else ""
        yield Finding(
            "too-short",
            "refuse",
            f"only {count} measured samples; at least {least} are needed{purpose}",
            count,
        )
    if known.slowest_s is None or record.duration_s >= _TAUS_ENOUGH * known.slowest_s:
        return
    taus = record.duration_s / known.slowest_s
    yield Finding(
        "too-short",
        "refuse" if taus < _TAUS_LEAST else "warn",
        f"the record is {record.duration_s:.3g} s long, which is {taus:.2g} times the slowest time constant of the "
        f"drive, {known.slowest_s:.3g} s; it should be at least {_TAUS_ENOUGH:g} times",
        taus,
    )


def _gaps(record: Record) -> Iterator[Finding]:
    intervals = record.intervals
    wide = intervals > _GAP * record.interval_s
    if wide.any():
        k = int(np.argmax(intervals))
        yield Finding(
            "gaps",
            "warn",
            f"{_times(int(np.count_nonzero(wide)))} nothing was recorded for more than {_GAP:g} intervals, longest for "
            f"{intervals[k]:.3g} s from {record.t[k] - record.t[0]:.3f} s on; the torque in a gap is not known: cut "
            "the record there",
            float(intervals[k]),
        )


def _lost(record: Record) -> Iterator[Finding]:
    intervals = record.intervals
    near = intervals[intervals <= _GAP * record.interval_s]
    lost = int((np.rint(near / record.interval_s) - 1).clip(min=0).sum())
    if lost > _LOST * (len(record) + lost):
        share = lost / (len(record) + lost)
        yield Finding(
            "lost",
            "warn",
            f"{lost} samples, {100 * share:.2g} % of all, are missing between those recorded; the torque that acted "
            "there is taken to be that of the sample before",
            share,
        )


def _jitter(record: Record) -> Iterator[Finding]:
    scatter = record.jitter_s
    if scatter <= max(_JITTER * record.interval_s, _JITTER_S):
        return
    d = record.intervals[record.intervals < _GAP * record.interval_s]
    d = d - d.mean()
    correlation = float(d[1:] @ d[:-1] / (d @ d))
    if correlation < _STAMPS:
        yield Finding(
            "jitter",
            "warn",
            f"the intervals of {1e3 * record.interval_s:.3g} ms scatter by {1e3 * scatter:.2g} ms, and a long one is "
            f"followed by a short one (correlation {correlation:.2f}), as with late time stamps of a regular clock; if "
            "it is that, it costs accuracy: prefer a sample counter",
            scatter,
        )


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
