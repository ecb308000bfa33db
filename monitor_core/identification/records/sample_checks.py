"""Checks of single signals: samples that cannot be or are missing, times, length, and signals that do not move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.identification.records.measured_record import Finding, Known, Record
from monitor_core.samples import PHYSICAL_LIMITS

_HALF = 2
"""Samples on either side of the running median: a peak of one or two samples stands out."""
_STANDS_OUT = 10.0
"""Times what 90 % of the samples stay below: for Gaussian noise that is 16 standard deviations."""
_VISIBLE = 0.2
"""As part of the range in which 90 % of the values lie: less than that does little harm."""
_PEAK = 2.0
"""Times the difference of what comes before and after: a peak comes back, a jump of the torque does not."""
_REFUSE = 0.01
"""Part of all samples: where there are so many, those that do not stand out will not be right either."""


def strange(record: Record) -> Iterator[Finding]:
    """Absurd numbers, outliers, missing samples."""
    yield from _absurd(record)
    yield from _outliers(record)
    missing = 1 - float(np.mean(record.measured))
    if missing > 0:
        yield Finding(
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
    """Of each value and so many before and after it (N,)."""
    padded = np.pad(values, (before, after), mode="edge")
    return np.asarray(np.median(sliding_window_view(padded, before + after + 1), axis=1))


def _absurd(record: Record) -> Iterator[Finding]:
    for what, unit, values in _quantities(record):
        beyond = abs(np.nan_to_num(values)) > PHYSICAL_LIMITS[what]
        if beyond.any():
            largest = float(np.nanmax(abs(values)))
            yield Finding(
                "absurd",
                "refuse",
                f"the {what} is beyond {PHYSICAL_LIMITS[what]:g} {unit} at {np.count_nonzero(beyond)} samples, up to "
                f"{largest:.3g} {unit}: no motor does that",
                largest,
            )


def _outliers(record: Record) -> Iterator[Finding]:
    for what, unit, values in _quantities(record):
        where = np.flatnonzero(outliers(values))
        if where.size:
            k = int(where[np.argmax(abs(values[where]))])
            share = where.size / len(record)
            yield Finding(
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
"""Residuals of fewer samples for each parameter determine the noise no better than within a quarter, so nothing tested
against it can be trusted."""
_TAUS_LEAST, _TAUS_ENOUGH = 1.0, 5.0
"""Within one time constant of the slowest motion it looks like a straight line; after five the unknown initial state
has decayed to less than 1 %."""
_GAP = 10.0
"""Typical intervals; the daemon, too, starts its predictor afresh there unless configured otherwise."""
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
            "it is that, it costs accuracy: prefer a sample counter; in a table that lacks no row, leave out the time, "
            "and rows are taken as evenly spaced",
            scatter,
        )


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


# --- Torque that does not move or is cut off, and a sensor that does not move although the axis does ------------------


_SAME = 1e-9
"""Of the range: differences below that are rounding."""
_HELD = 0.95
"""Part of the samples whose torque is that of the sample before: a controller of a quarter of the sampling rate has
0.75, and a staircase of long steps excites little but standstill and constant speed."""
_AT_END = 0.01
"""Part of the samples at the largest or at the smallest torque."""
_PILE = 4.0
"""Times as many there as at the next value: of a sine in steps it is 2.4, of a sine cut off there is no limit."""
_LEVELS = 10
"""A torque of so few values was meant to be a staircase or a random binary signal."""
_STUCK = 20
"""Samples in a row."""
_UNUSUAL = 10.0
"""Times the mean run of equal values while the axis moves: a coarse encoder has runs, but of similar length."""
_JUMP = 3.0
"""Times the speed that is exceeded in a tenth of the steps."""
_DIGITS = 3.0
"""A step of so few last digits may be the beginning of a motion, or the end of a constant speed."""
_MOSTLY = 0.5
"""Part of the samples."""
_MOVING = 0.5
"""Of the typical speed: below that the axis may well come to a standstill, held by friction."""
_STANDS = 0.1
"""The same of a measured speed: what does not change while the torque does is a standstill only if it is next to 0."""
_ABRUPT = 0.6
"""Of the speed one step further from the standstill: with a constant acceleration it is a third."""


class Runs(NamedTuple):
    """Stretches of equal values: index of the first of each, and how many."""

    start: Ints
    length: Ints


def signals(record: Record) -> Iterator[Finding]:
    """Constant or saturated torque, a stuck output."""
    if np.ptp(record.u) <= _SAME * max(1e-6, float(abs(record.u).max())):
        yield Finding(
            "constant-torque",
            "refuse",
            f"the torque is {record.u[0]:.4g} N m throughout: nothing can be learned from it",
            float(record.u[0]),
        )
        return
    yield from _held(record.u)
    yield from _saturated(record.u)
    yield from _stuck(record)


def runs(values: Floats) -> Runs:
    """Of equal values."""
    start = np.flatnonzero(np.concatenate(([True], np.diff(values) != 0)))
    return Runs(start, np.diff(np.append(start, len(values))))


def _held(u: Floats) -> Iterator[Finding]:
    changes = int(np.count_nonzero(np.diff(u)))
    share = 1 - changes / (len(u) - 1)
    if share > _HELD:
        yield Finding(
            "constant-torque",
            "warn",
            f"the torque stays as it was at {100 * share:.3g} % of the samples and changes only {changes} times: there "
            "is little to learn from it",
            share,
        )


def _saturated(u: Floats) -> Iterator[Finding]:
    values, counts = np.unique(u, return_counts=True)
    if len(values) <= _LEVELS:
        return
    for end, next_to_it in ((-1, -2), (0, 1)):
        share = float(counts[end] / len(u))
        if share > _AT_END and counts[end] > _PILE * counts[next_to_it]:
            yield Finding(
                "saturated",
                "warn",
                f"{100 * share:.3g} % of the samples have the {'largest' if end else 'smallest'} torque of all, "
                f"{values[end]:.4g} N m: if a limit cuts off what is recorded, the drive got another torque",
                share,
            )


def _stuck(record: Record) -> Iterator[Finding]:
    k = np.flatnonzero(record.measured)
    if k.size < 2:
        return
    t, y = record.t[k], record.y[k]
    if np.ptp(y) <= _SAME * max(1e-9, float(abs(y).max())):
        value = f"{y[0]:.6g} {record.unit}"
        yield Finding(
            "stuck", "refuse", f"the {record.quantity} is {value} throughout, whatever the torque", y[0]
        )
        return
    if (found := stuck_runs(record)).start.size:
        yield _says_stuck(record, t, found)


def stuck_runs(record: Record) -> Runs:
    """Stretches of the measured samples in which the motion stays the same to the last digit while the axis moves.

    A motion that never changes is one such stretch, if the torque does.
    """
    k = np.flatnonzero(record.measured)
    if k.size < 2:
        return Runs(np.zeros(0, np.int64), np.zeros(0, np.int64))
    t, y, u = record.t[k], record.y[k], record.u[k]
    found = runs(y)
    if found.start.size == 1:
        return found
    moves = _moves(t, y, found, record)
    mean = float(found.length[moves].mean()) if moves.any() else 1.0
    stuck = moves & (found.length >= max(_STUCK, _UNUSUAL * mean)) & _torque_moves(u, found)
    return Runs(found.start[stuck], found.length[stuck])


def _says_stuck(record: Record, t: Floats, found: Runs) -> Finding:
    longest = int(np.argmax(found.length))
    share = float(found.length.sum() / len(record))
    return Finding(
        "stuck",
        "refuse" if share > _MOSTLY else "warn",
        f"the {record.quantity} stays the same to the last digit {_times(found.start.size)} while the axis moves, "
        f"longest for {found.length[longest]} samples from {t[found.start[longest]] - record.t[0]:.3f} s on: a stuck "
        "sensor or a lost connection",
        float(found.length[longest]),
    )


def _moves(t: Floats, y: Floats, found: Runs, record: Record) -> Bools:
    """Whether the axis moves in each run: by its speed there, or by the steps of the angle into and out of it.

    Where the angle freezes while the axis moves, it stops from full speed, and when it comes back it goes on at full
    speed or makes up for all in one jump; one that is lost jumps to another value.  An axis that comes to rest is
    slower in the last step before and in the first one after.
    """
    steps = abs(np.diff(y[found.start]))
    visible = steps > _DIGITS * steps.min()
    if record.quantity == "speed":
        speed = abs(y[found.start])
        return np.asarray((speed > _STANDS * np.median(speed)) & np.append(visible, True), np.bool_)
    elapsed = t[found.start[1:]] - t[found.start[1:] - 1]
    speed = steps / elapsed
    clear = (speed > _MOVING * np.median(speed)) & visible
    starts = clear & (speed > _ABRUPT * np.append(speed[1:], np.inf))
    stops = clear & (speed > _ABRUPT * np.append(np.inf, speed[:-1]))
    jumps = clear & (speed > _JUMP * np.quantile(speed, 0.9))
    abrupt = np.append(starts, True) & np.append(False, stops)
    return np.asarray(abrupt | np.append(jumps, False) | np.append(False, jumps), np.bool_)


def _torque_moves(u: Floats, found: Runs) -> Bools:
    """Whether the torque changes within each run."""
    changes = np.concatenate(([0], np.cumsum(np.diff(u) != 0)))
    return np.asarray(changes[found.start + found.length - 1] > changes[found.start], np.bool_)
