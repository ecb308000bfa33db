"""Checks of samples: impossible or missing values, times, and length."""

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import find_peaks

from monitor_core.arrays import Bools, Floats
from monitor_core.identification.record_checks.findings import RecordFinding
from monitor_core.identification.record_checks.known_axis import KnownAxis
from monitor_core.identification.records.measured_record import GAP, Record
from monitor_core.samples import PHYSICAL_LIMITS
from monitor_core.wording import how_often

_HALF = 2
"""Number of samples on either side of the running median, so that a peak of one or two samples stands out"""
_STANDS_OUT = 10.0
"""An outlier exceeds the deviation that 90 % of the samples stay below by this factor (16 Gaussian sd)."""
_VISIBLE = 0.2
"""An outlier also exceeds this share of the range of 90 % of the values; a smaller one does little harm."""
_PEAK = 2.0
"""An outlier also exceeds the difference between the samples before and after it by this factor: a peak comes back, a
jump of the torque does not."""
_REFUSE = 0.01
"""A record with a larger share of outliers is refused, as its other samples cannot be trusted either."""


def implausible_values(record: Record) -> Iterator[RecordFinding]:
    """Absurd numbers, outliers, missing samples."""
    yield from _absurd(record)
    yield from _outliers(record)
    missing = 1 - float(np.mean(record.measured))
    if missing > 0:
        yield RecordFinding(
            "missing",
            "refuse" if missing > 0.5 else "warn",
            f"the {record.quantity} is missing or not finite at {np.count_nonzero(~record.measured)} of {len(record)} "
            f"samples, {100 * missing:.2g} %",
            missing,
        )


def outliers(values: Floats) -> Bools:
    """Which of the values (N,) stand out from their neighbours; those that are not finite do not."""
    out = np.zeros(values.shape, np.bool_)
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2 * _HALF + 1:
        return out
    v = values[known]
    distance = abs(v - _median(v, _HALF, _HALF))
    jump = abs(_median(v, 0, 2 * _HALF) - _median(v, 2 * _HALF, 0))
    low, high = np.quantile(v, (0.05, 0.95))
    far = distance > max(_STANDS_OUT * np.quantile(distance, 0.9), _VISIBLE * (high - low))
    out[known] = far & (distance > _PEAK * jump)
    return out


def _median(values: Floats, before: int, after: int) -> Floats:
    """Median of each value and the given numbers of values before and after it (N,)."""
    padded = np.pad(values, (before, after), mode="edge")
    return np.asarray(np.median(sliding_window_view(padded, before + after + 1), axis=1))


def _absurd(record: Record) -> Iterator[RecordFinding]:
    for what, unit, values in _quantities(record):
        beyond = abs(np.nan_to_num(values)) > PHYSICAL_LIMITS[what]
        if beyond.any():
            largest = float(np.nanmax(abs(values)))
            yield RecordFinding(
                "absurd",
                "refuse",
                f"the {what} is beyond {PHYSICAL_LIMITS[what]:g} {unit} at {np.count_nonzero(beyond)} samples, up to "
                f"{largest:.3g} {unit}: no motor reaches that",
                largest,
            )


def _outliers(record: Record) -> Iterator[RecordFinding]:
    for what, unit, values in _quantities(record):
        where = np.flatnonzero(outliers(values))
        if where.size:
            k = int(where[np.argmax(abs(values[where]))])
            share = where.size / len(record)
            yield RecordFinding(
                "outliers",
                "refuse" if share > _REFUSE else "warn",
                f"{where.size} values of the {what} stand out from their neighbours, the first at "
                f"{record.t[where[0]] - record.t[0]:.3f} s, the last at {record.t[where[-1]] - record.t[0]:.3f} s, the "
                f"largest is {values[k]:.4g} {unit}",
                where.size,
            )


def _quantities(record: Record) -> Iterator[tuple[str, str, Floats]]:
    yield "torque", "N m", record.u
    yield record.quantity, record.unit, record.y


# --- Length and times -------------------------------------------------------------------------------------------------


_FEWEST = 50
_PER_PARAMETER = 10
"""Least number of samples per parameter; with fewer, the error of the noise level exceeds a quarter, and no test that
uses it can be trusted."""
_TAUS_LEAST, _TAUS_ENOUGH = 1.0, 5.0
"""Length of a record in time constants: within one, the slowest motion looks like a straight line; after five, the
unknown initial state has decayed to less than 1 %."""
_LOST = 0.02
"""Share of lost samples that is reported: 2 % cause an error of 13 % in a damper if they are not noticed; here they
are, but the torque during the loss is still unknown."""
_JITTER, _JITTER_S = 0.02, 2e-4
"""Scatter of the intervals, as a share and in s: time stamps late by 0.3 ms give 2 % scatter of the friction."""
_STAMPS = -0.35
"""Correlation of neighbouring intervals: -0.5 for errors of the time stamps of a regular clock; 0 if the sampling
itself is irregular, which does no harm."""
_SLOW_S, _FEW, _STROKE = 0.1, 6, 0.2
"""Robots turn back within seconds: of an interval of this length [s] it is asked whether there are as many samples from
one reversal to the next.  With fewer, accelerations fall between them.  A reversal is one by this share of the range of
98 % of the angles or speeds: less may be noise."""
_ENOUGH = 40
"""Samples from one reversal to the next that are asked for"""
_MANY = 10
"""Fewer reversals show nothing: the axis may stand most of the time."""


def times(record: Record, known: KnownAxis) -> Iterator[RecordFinding]:
    """Too short, too slow, gaps, lost samples, jitter of the stamps."""
    yield from _too_short(record, known)
    yield from _too_slow(record)
    yield from _gaps(record)
    yield from _lost(record)
    yield from _jitter(record)


def _too_short(record: Record, known: KnownAxis) -> Iterator[RecordFinding]:
    count, least = int(np.count_nonzero(record.measured)), max(_FEWEST, _PER_PARAMETER * known.parameters)
    if count < least:
        purpose = f" for {known.parameters} parameters" if known.parameters else ""
        yield RecordFinding(
            "too-short",
            "refuse",
            f"only {count} measured samples; at least {least} are needed{purpose}",
            count,
        )
    if known.slowest_s is None or record.duration_s >= _TAUS_ENOUGH * known.slowest_s:
        return
    taus = record.duration_s / known.slowest_s
    yield RecordFinding(
        "too-short",
        "refuse" if taus < _TAUS_LEAST else "warn",
        f"the record is {record.duration_s:.3g} s long, which is {taus:.2g} times the slowest time constant of the "
        f"drive, {known.slowest_s:.3g} s; it should be at least {_TAUS_ENOUGH:g} times",
        taus,
    )


def _too_slow(record: Record) -> Iterator[RecordFinding]:
    apart = samples_too_far_apart(record)
    if apart is not None:
        yield RecordFinding(
            "too-slow",
            "warn",
            f"samples are {record.interval_s:.3g} s apart, which is {apart:.0f} from one reversal of the axis to the"
            " next: accelerations fall between them, and what a fit finds is not the drive; record at least every"
            f" {record.interval_s * apart / _ENOUGH:.1g} s",
            apart,
        )


def samples_too_far_apart(record: Record) -> float | None:
    """Samples from one reversal of the axis to the next, if they are too few to show its motion; None: they are not."""
    if record.interval_s < _SLOW_S or not record.measured.any():
        return None
    y = record.y[record.measured]
    low, high = np.quantile(y, (0.01, 0.99))
    turns = [find_peaks(way * y, prominence=_STROKE * (high - low))[0] for way in (1, -1)]
    apart = np.diff(np.sort(np.concatenate(turns)))
    return float(np.median(apart)) if apart.size >= _MANY and np.median(apart) < _FEW else None


def _gaps(record: Record) -> Iterator[RecordFinding]:
    intervals = record.intervals
    wide = intervals > GAP * record.interval_s
    if wide.any():
        k = int(np.argmax(intervals))
        yield RecordFinding(
            "gaps",
            "warn",
            f"{how_often(int(np.count_nonzero(wide)))} nothing was recorded for more than {GAP:g} intervals, longest "
            f"for {intervals[k]:.3g} s from {record.t[k] - record.t[0]:.3f} s on; the torque in a gap is not known",
            float(intervals[k]),
        )


def _lost(record: Record) -> Iterator[RecordFinding]:
    intervals = record.intervals
    near = intervals[intervals <= GAP * record.interval_s]
    lost = int((np.rint(near / record.interval_s) - 1).clip(min=0).sum())
    if lost > _LOST * (len(record) + lost):
        share = lost / (len(record) + lost)
        yield RecordFinding(
            "lost",
            "warn",
            f"{lost} samples, {100 * share:.2g} % of all, are missing between those recorded; the torque that acted "
            "there is assumed to equal that of the sample before",
            share,
        )


def _jitter(record: Record) -> Iterator[RecordFinding]:
    scatter = record.jitter_s
    if scatter <= max(_JITTER * record.interval_s, _JITTER_S):
        return
    d = record.intervals[record.intervals < GAP * record.interval_s]
    d = d - d.mean()
    correlation = float(d[1:] @ d[:-1] / (d @ d))
    if correlation < _STAMPS:
        yield RecordFinding(
            "jitter",
            "warn",
            f"the intervals of {1e3 * record.interval_s:.3g} ms scatter by {1e3 * scatter:.2g} ms, and a long one is "
            f"followed by a short one (correlation {correlation:.2f}), as with late time stamps of a regular clock; if "
            "it is that, it costs accuracy: prefer a sample counter; in a table that lacks no row, leave out the time, "
            "and rows are taken as evenly spaced",
            scatter,
        )
