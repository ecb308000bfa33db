"""What the values of a signal show by themselves: counts, an angle that wraps, values that are held, a stuck signal."""

from typing import Literal, NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.identification.record_checks.stuck_signals import Runs, runs, stuck_runs
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import rigid_fit, speed_scales

_WHOLE = 1e-6
"""Away from a whole number: a value that went through a table or a factor is rounded."""
_MANY = 50
"""Different values: fewer may be whole by chance, as those of a staircase."""
_LARGE = 100.0
"""A smaller largest value in whole units is a coarse signal, not one of counts."""
_JUMPS = 0.5
"""Of the range: a step as large is the wrap of an angle, or none is."""
_SAME = 0.02
"""Relative; wraps differ by what the axis moves from one sample to the next."""
_TURN = (360.0, 2 * np.pi, 1.0)
_HARDLY = 0.1
"""Of the period: what an angle that wraps moves in a sample; or, where that is more, by what it changes, .."""
_MOSTLY = 0.95
""".. in this part of the samples: beside a missing row an angle moves twice as far."""
_HELD = 0.9
"""Part of the values that are held for the same number of samples, or for a multiple of it."""
_HELD_AT_LEAST = 50
"""Values."""
_FINE = 1.5
"""Steps of the resolution: an encoder that is too coarse for the sampling goes by single steps."""
_MOST_HELD = 20
_STUCK_S, _STUCK_RUN = 0.2, 10.0
"""A torque that stays as it was: s, and times its mean run."""
_WORKS_S, _WORKS_RUN = 1.0, 20.0
"""A motion that stays as it was: s, and times its median run."""
_WORKS = 0.5
"""Of the range of the torque beside such stretches: an axis that stands needs less than one that moves.  A weight may
change while it stands; so that is asked only of a motion that never comes back."""
_FAR = 3.0
"""Times the step that is exceeded in a tenth of the samples."""
_SURE, _EXPLAINS = 4.0, 0.5
"""Standard deviations of an inertia, and the part of the torque that one mass explains, to say that the axis moves."""
_MOST_CHANGES = 2
"""Under a constant torque a speed may rise and fall once, as with a weight; not rise, fall and rise."""
_SPEED = 0.5
"""Of the root mean square of the speed: smaller changes are ignored."""


class Span(NamedTuple):
    """A stretch of a record, s after its first sample."""

    start_s: float
    end_s: float


def whole_numbers(values: Floats) -> bool:
    """Whether all values (N,) are whole, and so many and so large that it is no chance: counts, or per mille."""
    finite = values[np.isfinite(values)]
    if not finite.size or float(abs(finite).max()) < _LARGE:
        return False
    nearest = np.rint(finite)
    return bool((abs(finite - nearest) < _WHOLE * np.maximum(1.0, abs(finite))).all()) and (
        np.unique(nearest).size >= _MANY
    )


def wrap_of(angle: Floats) -> float | None:
    """Period after which an angle (N,) starts again, in its own unit; None: it does not.

    A turn (360, 2 pi, 1), or a power of two.
    """
    finite = angle[np.isfinite(angle)]
    if finite.size < 2 or not (extent := float(np.ptp(finite))) > 0:
        return None
    steps = np.diff(finite)
    jumps = abs(steps[abs(steps) > _JUMPS * extent])
    if not jumps.size or 2 * jumps.size > finite.size:
        return None
    others = abs(steps[abs(steps) <= _JUMPS * extent])
    usual = float(np.quantile(others, 0.99)) if others.size else 0.0
    for period in (*_TURN, 2.0 ** round(float(np.log2(jumps.max())))):
        near = max(_SAME * period, 2 * usual)
        # An angle that wraps stays within one period, and hardly moves in a sample; or fills it, and goes on as before.
        changes = abs((np.diff(steps) + period / 2) % period - period / 2)
        goes_on = extent > period * (1 - _SAME) and float(np.quantile(changes, _MOSTLY)) < _HARDLY * period
        smooth = usual < _HARDLY * period or goes_on
        if extent <= period * (1 + _SAME) and smooth and (abs(jumps - period) < near).all():
            return float(period)
    return None


def held_for(values: Floats) -> int:
    """For how many samples each of the values (N,) is held: 1, or more where they come from a slower source.

    A coarse encoder holds its values, too, but for as long as each step takes.
    """
    found = runs(values[np.isfinite(values)])
    moved = abs(np.diff(values[np.isfinite(values)][found.start]))
    length = found.length[1:-1]  # the first and the last may have been cut
    if length.size < _HELD_AT_LEAST or not (np.median(moved) > _FINE * moved[moved > 0].min()):
        return 1
    counts = np.bincount(length[length <= _MOST_HELD], minlength=3)
    held = int(np.argmax(counts))
    if held < 2 or np.count_nonzero(length % held == 0) < _HELD * length.size:
        return 1
    return held


def stuck_spans(record: Record, signal: Literal["torque", "motion"]) -> list[Span]:
    """Where a signal stays the same to the last digit although the axis shows that it cannot have."""
    if signal == "motion":
        k = np.flatnonzero(record.measured)
        found, t = _stuck_motion(record, record.u[k]), record.t[k] if k.size else record.t
    else:
        found, t = _stuck_torque(record), record.t
    since = t - record.t[0]
    ends = found.start + found.length - 1
    return [Span(float(since[a]), float(since[b])) for a, b in zip(found.start, ends, strict=True)]


def _stuck_motion(record: Record, u: Floats) -> Runs:
    """A motion that stays as it was while the axis moves, or while the torque works as it does when it moves."""
    found = stuck_runs(record)
    y = record.y[record.measured]
    if y.size < 2 or np.ptp(y) == 0:
        return found
    every = runs(y)
    least = max(_WORKS_S / record.interval_s, _WORKS_RUN * float(np.median(every.length)))
    still = np.zeros(y.size, np.bool_)
    for a, b in zip(found.start, found.start + found.length, strict=True):
        still[a:b] = True
    long = [(a, a + n) for a, n in zip(every.start, every.length, strict=True) if n >= least]
    beside = np.ones(y.size, np.bool_)
    for a, b in long:
        beside[a:b] = False
    if np.count_nonzero(beside) < _HELD_AT_LEAST:
        return found
    usual = _extent(u[beside])
    ends = [(a, b) for a, b in long if not still[a] and (a == 0 or b == y.size)]
    works = [(a, b) for a, b in ends if _extent(u[a:b]) > _WORKS * usual]
    if record.quantity == "speed":
        # From full speed to nothing within a sample, or back: no signal, no standstill.
        far = abs(np.diff(y)) > _FAR * np.quantile(abs(np.diff(y)[np.diff(y) != 0]), 0.9)
        far = np.concatenate(([False], far, [False]))
        works += [(a, b) for a, b in long if not still[a] and (far[a] or far[b]) and (a, b) not in works]
    if works and not _drives(record, beside):
        works = []
    start = np.concatenate([found.start, [a for a, _ in works]]).astype(np.int64)
    length = np.concatenate([found.length, [b - a for a, b in works]]).astype(np.int64)
    order = np.argsort(start)
    return Runs(start[order], length[order])


def _drives(record: Record, beside: Bools) -> bool:
    """Whether torque and motion fit in these measured samples (M,): the axis moves by its torque there."""
    part = record.select(np.flatnonzero(record.measured)[beside])
    fit = rigid_fit(part, speed_scales([part])[1])
    return fit is not None and abs(fit.inertia) > _SURE * fit.sd and fit.explained > _EXPLAINS


def _extent(values: Floats) -> float:
    low, high = np.quantile(values, (0.05, 0.95))
    return float(high - low)


def _stuck_torque(record: Record) -> Runs:
    """A torque that stays as it was while the motion goes on as if it did not."""
    found = runs(record.u)
    if found.start.size == 1:
        return found
    seconds = found.length * record.interval_s
    usual = float(np.median(found.length))
    candidates = np.flatnonzero((seconds > _STUCK_S) & (found.length > _STUCK_RUN * usual))
    wrong = [k for k in candidates.tolist() if _changes(record, found, k) >= _MOST_CHANGES]
    return Runs(found.start[wrong], found.length[wrong])


def _changes(record: Record, found: Runs, k: int) -> int:
    """How often the speed turns from rising to falling or back within a run."""
    t, y = record.t[record.measured], record.y[record.measured]
    if t.size < 2:
        return 0
    motion = np.interp(record.t, t, y)
    speed = np.gradient(motion, record.t) if record.quantity == "angle" else motion
    smooth = np.convolve(speed, np.full(9, 1 / 9), mode="same")
    enough = _SPEED * float(np.sqrt(np.mean(smooth**2)))
    part = smooth[found.start[k] : found.start[k] + found.length[k]]
    steps = np.diff(np.rint(part / enough)) if enough > 0 else np.zeros(0)
    return int(np.count_nonzero(np.diff(np.sign(steps[steps != 0]))))
