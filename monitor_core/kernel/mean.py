"""A speed that the drive averages over its sampling interval: s' = speed, s = 0 at each sample, yhat = s / h.

The drive averages over its own interval.  After lost samples that is the last one of several: s begins again where it
begins.  The correction by K leaves s alone, as s begins again after it.
"""

from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import SETTLE
from monitor_core.kernel.compile import kernel

LOST = 1.75
"""Intervals: from so many on samples are missing in between, and the drive's own interval is the nominal one."""


@kernel
def own_interval(
    lanes: Any, interval: Floats, h_first: Floats, h: Floats, h_before: Floats, over: Floats, lost: Ints
) -> bool:
    """Cut what comes before the drive's own interval off h (W,): h_before; True if there is any.

    h is what is left of the interval after h_first, during which the torque before acts.  ``over`` (W,) is what the
    drive averages over.  A torque that comes late in an interval of which the beginning is to be cut off, which for
    whole numbers of intervals does not happen, takes its beginning with it.
    """
    any_lost = False
    for a in range(len(lanes)):
        whole = h_first[a] + h[a]
        lost[a] = whole > LOST * interval[a]
        h_before[a] = max(h[a] - interval[a], 0.0) if lost[a] else 0.0
        h[a] -= h_before[a]
        over[a] = h[a] if lost[a] else whole
        any_lost |= lost[a] != 0
    return any_lost


@kernel
def begin_again(lanes: Any, s: int, n: int, on: Ints, X: Floats) -> None:
    """s = 0 and its derivatives, in the z_i and in x of X."""
    for r in range(s, X.shape[0], n):
        for a in range(len(lanes)):
            X[r, a] = 0.0 if on[a] else X[r, a]


@kernel
def sampled(lanes: Any, does: Ints, on: Ints) -> None:
    """Where the drive has sampled (W,): also where the predictor passed its sample over."""
    for a in range(len(lanes)):
        on[a] = does[a] >= SETTLE


@kernel
def mean(lanes: Any, over: Floats, yhat: Floats, psi: Floats) -> None:
    """Yhat = s / h and psi_i = z_is / h.  A lane that does not move has h = 0."""
    for a in range(len(lanes)):
        yhat[a] = yhat[a] / over[a] if over[a] > 0.0 else 0.0
    for i in range(psi.shape[0]):
        for a in range(len(lanes)):
            psi[i, a] = psi[i, a] / over[a] if over[a] > 0.0 else 0.0
