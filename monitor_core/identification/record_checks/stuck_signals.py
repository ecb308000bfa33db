"""Checks for a constant or saturated torque, and for a stuck sensor although the axis moves."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.identification.record_checks.findings import RecordFinding
from monitor_core.identification.records.measured_record import Record
from monitor_core.wording import how_often

_SAME = 1e-9
"""Differences below this share of the range are rounding errors."""
_HELD = 0.95
"""A torque is constant if more than this share of samples equal the one before.  With a controller at a quarter of the
sampling rate the share is 0.75; a staircase of long steps excites little but standstill and constant speed."""
_AT_END = 0.01
"""Share of the samples at the largest or at the smallest torque from which saturation is suspected."""
_PILE = 4.0
"""A saturated torque has this many times more samples at its end than at the next value: a sine in steps has 2.4."""
_LEVELS = 10
"""A torque with at most this number of values is an intended staircase or random binary signal."""
_STUCK = 20
"""Least number of equal samples in a row of a stuck signal"""
_UNUSUAL = 10.0
"""Least ratio of a stuck run to the mean run of equal values during motion; runs of a coarse encoder are alike."""
_JUMP = 3.0
"""A jump is this many times the speed that is exceeded in a tenth of the steps."""
_DIGITS = 3.0
"""A step of at most this number of last digits may be the beginning of a motion, or the end of a constant speed."""
_MOSTLY = 0.5
"""Share of the samples from which a signal counts as mostly stuck."""
_MOVING = 0.5
"""Below this share of the typical speed the axis may come to a standstill, held by friction."""
_STANDS = 0.1
"""The same limit for a measured speed: a constant speed under a varying torque is a standstill only near 0."""
_ABRUPT = 0.6
"""A stop or start is abrupt if its speed exceeds this share of the speed one step further from the standstill; with a
constant acceleration it is a third."""


class Runs(NamedTuple):
    """Runs of equal values: index of the first value of each run, and its length."""

    start: Ints
    length: Ints


def signals(record: Record) -> Iterator[RecordFinding]:
    """Constant or saturated torque, a stuck output."""
    if np.ptp(record.u) <= _SAME * max(1e-6, float(abs(record.u).max())):
        yield RecordFinding(
            "constant-torque",
            "refuse",
            f"the torque is {record.u[0]:.4g} N m throughout: no parameter can be estimated from it",
            float(record.u[0]),
        )
        return
    yield from _held(record.u)
    yield from _saturated(record.u)
    yield from _stuck(record)


def runs(values: Floats) -> Runs:
    """All runs of equal values."""
    start = np.flatnonzero(np.concatenate(([True], np.diff(values) != 0)))
    return Runs(start, np.diff(np.append(start, len(values))))


def _held(u: Floats) -> Iterator[RecordFinding]:
    changes = int(np.count_nonzero(np.diff(u)))
    share = 1 - changes / (len(u) - 1)
    if share > _HELD:
        yield RecordFinding(
            "constant-torque",
            "warn",
            f"the torque stays as it was at {100 * share:.3g} % of the samples and changes only {changes} times: it "
            "carries little information",
            share,
        )


def _saturated(u: Floats) -> Iterator[RecordFinding]:
    values, counts = np.unique(u, return_counts=True)
    if len(values) <= _LEVELS:
        return
    for end, next_to_it in ((-1, -2), (0, 1)):
        share = float(counts[end] / len(u))
        if share > _AT_END and counts[end] > _PILE * counts[next_to_it]:
            yield RecordFinding(
                "saturated",
                "warn",
                f"{100 * share:.3g} % of the samples have the {'largest' if end else 'smallest'} torque of all, "
                f"{values[end]:.4g} N m: if the record is cut off at a limit, the real torque was another one",
                share,
            )


def _stuck(record: Record) -> Iterator[RecordFinding]:
    k = np.flatnonzero(record.measured)
    if k.size < 2:
        return
    t, y = record.t[k], record.y[k]
    if np.ptp(y) <= _SAME * max(1e-9, float(abs(y).max())):
        value = f"{y[0]:.6g} {record.unit}"
        yield RecordFinding(
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


def _says_stuck(record: Record, t: Floats, found: Runs) -> RecordFinding:
    longest = int(np.argmax(found.length))
    share = float(found.length.sum() / len(record))
    return RecordFinding(
        "stuck",
        "refuse" if share > _MOSTLY else "warn",
        f"the {record.quantity} stays the same to the last digit {how_often(found.start.size)} while the axis moves, "
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
