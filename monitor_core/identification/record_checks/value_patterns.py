"""Patterns in the values of a signal: motion, counts, an angle that wraps, held values, a stuck signal."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.record_checks.stuck_signals import Runs, runs, stuck_runs
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import rigid_fit, speed_scales

_MIN_RANGE_PER_STEP = 12.0
"""Range of a moving signal over its usual step; for noise this ratio is six."""
_OUTLIER_SHARE = 0.005
"""Share of values at either end that may be outliers."""
_CLOSE_S, _ALIKE = 0.05, 0.5
"""Interval [s] up to which neighbouring samples of a motion are alike, by this correlation; noise has none."""
_WHOLE = 1e-6
"""Tolerance for a whole number, as a value that went through a table or a factor is rounded."""
_MANY = 50
"""Least number of different values; fewer may be whole by chance, as in a staircase."""
_LARGE = 100.0
"""Least maximum of counts; a signal of smaller whole numbers is a coarse one."""
_JUMPS = 0.5
"""Only steps above this share of the range may be wraps of an angle."""
_SAME = 0.02
"""Relative tolerance of wraps, which differ by the motion from one sample to the next."""
_TURN = (360.0, 2 * np.pi, 1.0)
_HARDLY = 0.1
"""An angle that wraps moves by less than this share of the period in a sample; or its step changes by less .."""
_MOSTLY = 0.95
""".. in this share of the samples, as next to a missing row an angle moves twice as far."""
_HELD = 0.9
"""Least share of values that are held for the same number of samples, or for a multiple of it."""
_HELD_AT_LEAST = 50
"""Least number of values."""
_FINE = 1.5
"""Least typical step in units of the smallest one: an encoder that is too coarse for the sampling moves by single
steps."""
_MOST_HELD = 20
_STUCK_S, _STUCK_RUN = 0.2, 10.0
"""Least length of a run of a stuck torque: in s, and in mean runs."""
_WORKS_S, _WORKS_RUN = 1.0, 20.0
"""Least length of a run of a stuck motion: in s, and in median runs."""
_WORKS = 0.5
"""Least range of the torque in a stuck motion, as a share of the range elsewhere: an axis needs less torque at
standstill than in motion.  A weight may change at standstill, so this is used only for a motion that never comes
back."""
_FAR = 3.0
"""Abrupt stops and starts exceed the step that is exceeded in a tenth of the samples by this factor."""
_SURE, _EXPLAINS = 4.0, 0.5
"""The axis moves if one mass explains this share of the torque, and its inertia is this number of sd above zero."""
_MOST_CHANGES = 2
"""Under a constant torque a speed may rise and fall once, as with a weight, but not rise, fall and rise."""
_SPEED = 0.5
"""Changes of the speed below this share of its root mean square are ignored."""


class Span(NamedTuple):
    """A stretch of a record, s after its first sample."""

    start_s: float
    end_s: float


def moves(values: Floats, quantity: Output) -> bool:
    """Whether an angle or a speed (N,) shows a moving axis and not only noise or changes of the last digit."""
    values = values[np.isfinite(values)]
    steps = abs(np.diff(values))
    if not steps.any():
        return quantity == "speed" and bool(values.any())
    usual = float(np.median(steps[steps > 0]))
    low, middle, high = np.quantile(values, (_OUTLIER_SHARE, 0.5, 1 - _OUTLIER_SHARE))
    return bool(
        high - low > _MIN_RANGE_PER_STEP * usual or (quantity == "speed" and abs(middle) > _MIN_RANGE_PER_STEP * usual)
    )


def stands(record: Record) -> bool:
    """Whether the motion is noise only.  Of samples that are far apart a motion looks the same, so it is not asked."""
    y = record.y[record.measured]
    if record.interval_s > _CLOSE_S or moves(y, record.quantity):
        return False
    off = y - y.mean()
    return float(off[1:] @ off[:-1]) < _ALIKE * float(off @ off)


def whole_numbers(values: Floats) -> bool:
    """Whether all values (N,) are whole numbers, too many and too large for chance: counts, or per mille."""
    finite = values[np.isfinite(values)]
    if not finite.size or float(abs(finite).max()) < _LARGE:
        return False
    nearest = np.rint(finite)
    return bool((abs(finite - nearest) < _WHOLE * np.maximum(1.0, abs(finite))).all()) and (
        np.unique(nearest).size >= _MANY
    )


def wrap_of(angle: Floats) -> float | None:
    """Period after which an angle (N,) wraps, in its own unit; None: it does not wrap.

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
    """Number of samples for which each of the values (N,) is held: above 1 if they come from a slower source.

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
    """Spans in which a signal stays the same to the last digit although the axis must have changed it."""
    if signal == "motion":
        k = np.flatnonzero(record.measured)
        found, t = _stuck_motion(record, record.u[k]), record.t[k] if k.size else record.t
    else:
        found, t = _stuck_torque(record), record.t
    since = t - record.t[0]
    ends = found.start + found.length - 1
    return [Span(float(since[a]), float(since[b])) for a, b in zip(found.start, ends, strict=True)]


def _stuck_motion(record: Record, u: Floats) -> Runs:
    """Runs of a constant motion signal while the axis moves, or while the torque varies as it does during motion."""
    found = stuck_runs(record)
    y = record.y[record.measured]
    if y.size < 2 or np.ptp(y) == 0:
        return found
    every = runs(y)
    least = max(_WORKS_S / record.interval_s, _WORKS_RUN * float(np.median(every.length)))
    long = [(a, a + n) for a, n in zip(every.start, every.length, strict=True) if n >= least]
    beside = ~_within(long, y.size)
    if np.count_nonzero(beside) < _HELD_AT_LEAST:
        return found
    usual, is_far = _extent(u[beside]), _far_steps(y) if record.quantity == "speed" else np.zeros(y.size + 1, np.bool_)

    def is_stuck(a: int, b: int) -> bool:
        never_comes_back = (a == 0 or b == y.size) and _extent(u[a:b]) > _WORKS * usual
        return never_comes_back or bool(is_far[a] or is_far[b])

    known = _within(list(zip(found.start, found.start + found.length, strict=True)), y.size)
    more = [(a, b) for a, b in long if not known[a] and is_stuck(a, b)]
    if not more or not _drives(record, beside):
        return found
    start = np.concatenate([found.start, [a for a, _ in more]]).astype(np.int64)
    length = np.concatenate([found.length, [b - a for a, b in more]]).astype(np.int64)
    order = np.argsort(start)
    return Runs(start[order], length[order])


def _within(stretches: Sequence[tuple[int, int]], size: int) -> Bools:
    """Which of so many samples are in one of these stretches."""
    found = np.zeros(size, np.bool_)
    for a, b in stretches:
        found[a:b] = True
    return found


def _far_steps(y: Floats) -> Bools:
    """Before which samples of a speed (N,), and after the last (N + 1,), it goes from full speed to nothing, or back.

    Within a sample: that is no signal, no standstill.
    """
    steps = abs(np.diff(y))
    far = steps > _FAR * np.quantile(steps[steps != 0], 0.9)
    return np.concatenate(([False], far, [False]))


def _drives(record: Record, beside: Bools) -> bool:
    """Whether torque and motion fit in these measured samples (M,): the axis moves by its torque there."""
    part = record.select(np.flatnonzero(record.measured)[beside])
    fit = rigid_fit(part, speed_scales([part])[1])
    return fit is not None and abs(fit.inertia) > _SURE * fit.sd and fit.explained > _EXPLAINS


def _extent(values: Floats) -> float:
    low, high = np.quantile(values, (0.05, 0.95))
    return float(high - low)


def _stuck_torque(record: Record) -> Runs:
    """Runs of a constant torque signal while the motion shows that the torque varies."""
    found = runs(record.u)
    if found.start.size == 1:
        return found
    seconds = found.length * record.interval_s
    usual = float(np.median(found.length))
    candidates = np.flatnonzero((seconds > _STUCK_S) & (found.length > _STUCK_RUN * usual))
    wrong = [k for k in candidates.tolist() if _changes(record, found, k) >= _MOST_CHANGES]
    return Runs(found.start[wrong], found.length[wrong])


def _changes(record: Record, found: Runs, k: int) -> int:
    """Number of changes between rising and falling speed within a run."""
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
