"""Finds whether the motion in records repeats itself, as a program or a planned motion that is run again and again.

What a drive lacks repeats with the motion, and a fit makes up for it in every repetition alike.  So a half of such
records is no test of values from the other half: it tells that they hold for this motion, not that they are right.
"""

from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.torque_windows import rms_speed, windowed_parts

_SAME = 0.02
"""Largest mean square of what has changed after a repetition, as a part of that after a time that tells nothing.  A
robot repeats its motion within thousandths; the rest is for noise."""
_OTHER = 0.5
"""Before it repeats, the motion has changed by this part of that."""
_FINE, _SMOOTH = 160, 8
"""Values of the motion in its usual period; means are over so many of them, as accelerations are noisy."""
_MOST = 200_000
"""Values of the motion in all records; more are too slow."""
_FEWEST = 64
"""Fewest values that can show a repetition"""


def repeated_after(records: Sequence[Record]) -> float | None:
    """Time after which the motion in the records of an axis repeats itself, s; None: not during half of their length.

    Records are taken one after the other, so the same motion in each of several files repeats, too.  The motion is that
    of the axis, with all signals that vary, such as the angles of other axes.
    """
    parts, speed = windowed_parts(records), rms_speed(records)
    if not parts or not speed > 0:
        return None
    h = parts[0].h
    if any(abs(part.h / h - 1) > 0.01 for part in parts):
        return None
    names = sorted(set.intersection(*(set(part.signals) for part in parts)))
    angle = np.concatenate([part.angle - part.angle.mean() for part in parts])
    motions = [np.concatenate([part.y for part in parts])]
    motions += [np.concatenate([part.signals[name] for part in parts]) for name in names]
    usual = 2 * np.pi * float(np.sqrt(np.mean(angle**2))) / speed / h
    block = max(round(usual / _FINE), -(-len(angle) // _MOST), 1)
    smooth = [_means(motion, block) for motion in motions if np.isfinite(motion).all()]
    lag = _repetition([motion for motion in smooth if motion.size >= _FEWEST and np.ptp(motion) > 0])
    return None if lag is None else lag * block * h


def _means(values: Floats, block: int) -> Floats:
    """Means over blocks, smoothed over some of them."""
    count = len(values) // block
    means = values[: count * block].reshape(count, block).mean(axis=1)
    return np.convolve(means, np.full(_SMOOTH, 1 / _SMOOTH), mode="valid") if count >= _SMOOTH else np.zeros(0)


def _repetition(motions: Sequence[Floats]) -> int | None:
    """The lag after which all of these (N,) are the same; the first one is that of the axis."""
    if not motions:
        return None
    changed = np.array([_changes(motion) for motion in motions])
    other = np.flatnonzero(changed[0] > _OTHER)
    largest = changed.max(axis=0)
    same = np.flatnonzero(largest <= _SAME)
    same = same[same > other[0]] if other.size else same[:0]
    if not same.size:
        return None
    # The first run of lags that are about right has the best one in it.
    run = same[: int(np.argmax(np.append(np.diff(same) > 1, True))) + 1]
    return int(run[np.argmin(largest[run])])


def _changes(values: Floats) -> Floats:
    """Mean square change of values (N,) after each lag up to half of them, as a part of twice their variance."""
    x = values - values.mean()
    n = len(x)
    most = n // 2 + 2 * _SMOOTH  # two repetitions, although their ends are smoothed away
    spectrum = np.fft.rfft(x, 2 * n)
    products = np.fft.irfft(abs(spectrum) ** 2, 2 * n)[: most + 1]
    squares = np.concatenate(([0.0], np.cumsum(x**2)))
    lags = np.arange(most + 1)
    both = squares[n - lags] + squares[-1] - squares[lags]
    return np.asarray((both - 2 * products) / (2 * (n - lags) * x.var()))
