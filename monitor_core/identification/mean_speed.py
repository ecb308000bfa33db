"""A mean speed where theta is fixed: the held drive itself begins its way anew with each sample, and divides it by h.

The state s of Drive.with_mean_speed, s' = speed, is zero after a sample: no column of [Ad Bd] needs it.  Its row over h
is the mean speed.  After lost samples that is over the drive's own, last interval, as in the monitor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.identification.held_drive import Held, hold, hold_late
from monitor_core.identification.term_derivatives import Linear
from monitor_core.kernel.mean import LOST


def averaged(held: Held, s: int, over_s: Floats) -> Held:
    """The held drive with the mean of s over ``over_s`` (G,) [s] in place of s, which is zero at the beginning."""
    X, dX = held.X.copy(), held.dX.copy()
    X[:, s] /= over_s[:, np.newaxis]
    dX[:, :, s] /= over_s[:, np.newaxis, np.newaxis]
    X[:, :, s] = 0.0
    dX[:, :, :, s] = 0.0
    return Held(X, dX)


def hold_mean(
    of: Linear,
    torque: NDArray[np.bool_],
    intervals_s: Floats,
    late_s: float | None,
    s: int,
    interval_s: float,
) -> Held:
    """The drive over intervals (G,) [s], the nominal one ``interval_s``; ``late_s`` as in held.hold_late, or None."""
    late = np.minimum(late_s or 0.0, intervals_s)
    own_s = np.where(intervals_s > LOST * interval_s, np.minimum(intervals_s - late, interval_s), 0.0)
    before_s = intervals_s - own_s
    held = hold(of, before_s) if late_s is None else hold_late(of, torque, before_s, late_s)
    found = averaged(held, s, before_s)
    for g in np.flatnonzero(own_s).tolist():
        own = averaged(hold(of, own_s[g : g + 1]), s, own_s[g : g + 1])
        found.X[g], found.dX[g] = _after(own, Held(found.X[g : g + 1], found.dX[g : g + 1]))
    return found


def _after(own: Held, before: Held) -> tuple[Floats, Floats]:
    """The last interval after what came before it; the torque of before has long ceased to act in it."""
    n, k = own.X.shape[1:]
    A, B, X = own.X[0, :, :n], own.X[0, :, n:], before.X[0]
    out, slopes = A @ X, A @ before.dX[0]
    out[:, n:k] += B
    slopes[: own.dX.shape[1]] += own.dX[0, :, :, :n] @ X
    slopes[: own.dX.shape[1], :, n:k] += own.dX[0, :, :, n:]
    return out, slopes
