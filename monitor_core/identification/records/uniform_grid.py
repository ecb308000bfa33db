"""Records on a regular grid, for methods that need a constant interval: ARX models, spectra.

Where a sample was lost the grid has a place at which nothing is known.  A record that is not on a grid, or sampled far
faster than the axis moves, is resampled, which costs: the torque within the new intervals is forgotten but for its
mean, and the errors of neighbouring samples become correlated.  A grey-box fit takes records as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import firwin, kaiserord, oaconvolve

from monitor_core.arrays import Bools, Floats
from monitor_core.identification.records.measured_record import Record

_TOLERANCE = 0.05
"""Largest deviation of a sample from its grid point, in intervals.  A tenth biases an inertia by 3 %."""


@dataclass(frozen=True, eq=False)
class Regular:
    """N samples, each one interval after the other; zero where nothing was measured."""

    interval_s: float
    u: Floats  # (N,) torque, N m
    y: Floats  # (N,) angle, rad, or speed, rad/s
    known: Bools  # (N,) both are


def on_grid(records: Sequence[Record] | Sequence[Regular]) -> tuple[Regular, ...]:
    """The records on a common grid; those that already are on a grid stay as they are.

    Raises:
        ValueError: intervals that differ, samples that are not on a grid (the text says how far off).
    """
    given = [record for record in records if isinstance(record, Regular)]
    if given:
        return tuple(given)
    rest = [record for record in records if isinstance(record, Record)]
    h = _common_interval(rest)
    return tuple(_on_grid(record, h) for record in rest)


def stretches(known: Bools) -> list[tuple[int, int]]:
    """Ranges (a, b) of samples in a row that are all known (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _common_interval(records: Sequence[Record]) -> float:
    intervals = [record.interval_s for record in records]
    h = float(np.median(intervals))
    for record, interval in zip(records, intervals, strict=True):
        if abs(interval - h) > 1e-3 * h:
            raise ValueError(
                f"record {record.name or '(no name)'} was sampled every {1e3 * interval:.5g} ms, the others every"
                f" {1e3 * h:.5g} ms: a discrete model has one interval, resample them"
            )
    return h


def _on_grid(record: Record, h: float) -> Regular:
    # Rounding of the interval would accumulate: each step is rounded separately.
    steps = record.intervals / h
    steps_rounded = np.maximum(np.rint(steps), 1).astype(np.int64)
    off = abs(steps - steps_rounded)
    if off.max() > _TOLERANCE:
        raise ValueError(
            f"record {record.name or '(no name)'}: {np.count_nonzero(off > _TOLERANCE)} of {off.size} intervals are"
            f" not {1e3 * h:.5g} ms or a multiple of it (up to {1e3 * h * off.max():.3g} ms off): a discrete model"
            " needs regular samples, resample it"
        )
    place = np.concatenate([[0], np.cumsum(steps_rounded)])
    u, y, known = np.zeros(place[-1] + 1), np.zeros(place[-1] + 1), np.zeros(place[-1] + 1, np.bool_)
    u[place], y[place] = record.u, np.where(record.measured, record.y, 0.0)
    known[place] = record.judged
    return Regular(h, u, y, known)


# --- Another grid: resampling without aliasing and without delay ------------------------------------------------------


# * The torque is held, so its mean over a new interval is exact: the integral of the torque is conserved, and so is the
#   momentum that it gives.  Of the reference drive under a torque of 0 to 30 Hz, recorded each millisecond, the true
#   model simulates the new output with an error of 0.07, 0.7 and 3 % at 2, 5 and 10 ms; with every n-th torque instead
#   of the mean it would be 3, 14 and 32 %.
# * Output and signals pass a low-pass filter against aliasing: a Kaiser-windowed sinc, flat within 0.1 % up to 0.8 of
#   the new Nyquist frequency and down by 60 dB at it.  It is symmetric and centred on each new sample, hence without
#   phase: a delay would be read as inertia (half a millisecond as 3 %), and a recursive filter run both ways, the
#   alternative, has no end to what it spreads from a missing sample.
# * Samples that are not on a regular grid are first put on one by a cubic spline.

PASS = 0.8
"""The filter is flat up to this share of the new Nyquist frequency."""
_RIPPLE_DB = 60.0
_REGULAR = 1e-3
"""A grid is regular when no time is further from it than this part of an interval."""


def resample(record: Record, interval_s: float) -> Record:
    """The record on the grid t[0], t[0] + interval_s, .., without aliasing and without delay.

    A new sample is valid where everything within one new interval around it was measured, and the filter does not
    reach over the ends of the record.  The interval is not shorter than that of the record, which may be irregular.

    Raises:
        ValueError: a record too short for two new samples.
    """
    count = int(np.floor(record.duration_s / interval_s * (1 + 1e-12) + 1e-9)) + 1
    if count < 2:
        raise ValueError(f"a record of {record.duration_s:g} s has no two samples {interval_s:g} s apart")
    t = record.t[0] + interval_s * np.arange(count)
    parts = max(1, int(np.ceil(interval_s / grid_interval(record) * (1 - _REGULAR))))
    y, valid = _filtered(record, record.y, t, parts)
    signals = {name: _filtered(record, values, t, parts) for name, values in record.signals.items()}
    named = {name: np.where(fine, values, np.nan) for name, (values, fine) in signals.items()}
    gate = None if record.gate is None else record.gate[np.searchsorted(record.t, t + 1e-12, side="right") - 1]
    return Record(t, mean_torque(record, t), y, record.quantity, record.name, valid, named, gate)


def mean_torque(record: Record, t: Floats) -> Floats:
    """The mean of the held torque from each time to the next (M,), N m; the last one is the torque held there.

    Times are within the record.
    """
    impulse = np.concatenate(([0.0], np.cumsum(record.u[:-1] * record.intervals)))
    means = np.diff(np.interp(t, record.t, impulse)) / np.diff(t)
    return np.append(means, record.u[np.searchsorted(record.t, t[-1] + 1e-12, side="right") - 1])


def grid_interval(record: Record) -> float:
    """The interval of the record, s, with more digits than a median of rounded times has."""
    h = record.interval_s
    steps = np.rint((record.t - record.t[0]) / h)
    better = record.duration_s / steps[-1]
    on_it = abs(record.t - record.t[0] - better * steps).max() < _REGULAR * h
    return float(better) if on_it else h


def _filtered(record: Record, values: Floats, t: Floats, parts: int) -> tuple[Floats, Bools]:
    """Values (M,) at the times t, and where they are reliable; each new interval is ``parts`` of a finer grid."""
    known = np.isfinite(values)
    interval = float(t[1] - t[0])
    if np.count_nonzero(known) < 2:
        return np.full(t.size, np.nan), np.zeros(t.size, np.bool_)
    fine = t[0] + interval / parts * np.arange((t.size - 1) * parts + 1)
    smooth = CubicSpline(record.t[known], values[known], bc_type="natural")(fine)
    reach = 0
    if parts > 1:
        taps = _taps(parts)
        reach = len(taps) // 2
        # Beyond the ends the signal is continued by point reflection; samples affected by that are not valid.
        smooth = oaconvolve(np.pad(smooth, reach, mode="reflect", reflect_type="odd"), taps, mode="valid")
    valid = _covered(record.t[known], t, max(interval, 1.5 * grid_interval(record)), interval if parts > 1 else 0.0)
    inside = np.arange(fine.size)[::parts]
    valid &= (inside >= reach) & (inside < fine.size - reach)
    return smooth[::parts], valid


def _taps(parts: int) -> Floats:
    """A low-pass filter whose taps are symmetric and sum to 1; its half length is a number of new intervals."""
    count, beta = kaiserord(_RIPPLE_DB, (1 - PASS) / parts)
    taps: Floats = firwin(2 * (count // 2) + 1, (1 + PASS) / 2 / parts, window=("kaiser", beta))
    return taps


def _covered(known: Floats, t: Floats, most: float, around: float) -> Bools:
    """Mask (M,) of the times t around which no two successive known samples are too far apart."""
    valid = (t >= known[0] - 1e-9) & (t <= known[-1] + 1e-9)
    for k in np.flatnonzero(np.diff(known) > most * (1 + _REGULAR)):
        valid &= (t <= known[k] - around + 1e-9) | (t >= known[k + 1] + around - 1e-9)
    return np.asarray(valid, np.bool_)
