"""The actual interval of a sample: forgetting factor, filter gain, delayed torque, mean speed."""

import math
from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import SETTLE
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.outliers import SURELY
from monitor_core.kernel.tables import GAINS, TORQUE, InputTerms

_EQUAL_S = 1e-9
"""Intervals that differ by less than a microsecond, in which they are counted, are equal."""


@kernel
def time_since_correction(lanes: Any, interval: Floats, h: Floats, in_a_row: Ints, ago: Floats) -> None:
    """Time since the last correction of the state (W,): h, plus an interval for each outlier rejected since then."""
    for a in range(len(lanes)):
        ago[a] = h[a] + (interval[a] * in_a_row[a] if in_a_row[a] < SURELY else 0.0)


@kernel
def interval_gain(
    lanes: Any, interval: Floats, lam: Floats, K: Floats, h: Floats, ago: Floats, lam_h: Floats, K_h: Floats
) -> None:
    """lambda^(h / interval) (W,), and K (n, W) for the time ``ago`` (W,) since the last correction.

    The memory is a time: a missing sample reduces the information like a received one.  The gain grows as the
    prediction becomes uncertain; it is interpolated between the gains after 0, 1, 2 .. whole intervals, the rows of
    ``K``.
    """
    n, usual = K_h.shape[0], True
    for a in range(len(lanes)):
        lam_h[a] = lam[a]
        usual &= (abs(h[a] - interval[a]) < _EQUAL_S) & (abs(ago[a] - interval[a]) < _EQUAL_S)
    if usual:
        for i in range(n):
            for a in range(len(lanes)):
                K_h[i, a] = K[n + i, a]
        return
    for a in range(len(lanes)):
        if abs(h[a] - interval[a]) >= _EQUAL_S:
            lam_h[a] = math.exp(h[a] / interval[a] * math.log(lam[a]))
        r = 1.0 if abs(ago[a] - interval[a]) < _EQUAL_S else ago[a] / interval[a]
        k = min(int(r), GAINS - 2)
        part = min(r - k, 1.0)
        for i in range(n):
            before = K[k * n + i, a]
            K_h[i, a] = before + part * (K[(k + 1) * n + i, a] - before) if part > 0.0 else before


# --- Delayed torque: the interval in two parts, and the derivative with respect to the delay --------------------------


@kernel
def split_at_delay(
    lanes: Any,
    kind: Ints,
    delay: Floats,
    torque_before: Floats,
    u: Floats,
    h: Floats,
    h_first: Floats,
    u_first: Floats,
) -> bool:
    """Split the interval if the torque acts late: h_first with the previous torque, then h.  True if a lane splits."""
    late = False
    for a in range(len(lanes)):
        h_first[a] = min(max(delay[a], 0.0), h[a])
        h[a] -= h_first[a]
        late |= h_first[a] > 0.0
    for c in range(kind.size):
        for a in range(len(lanes)):
            u_first[c, a] = torque_before[a] if kind[c] == TORQUE else u[c, a]
    return late


@outlined
def switch_torque(
    lanes: Any,
    inputs: InputTerms,
    kind: Ints,
    late: int,
    p: int,
    V: Floats,
    delay: Floats,
    u_first: Floats,
    u: Floats,
    h_first: Floats,
    h: Floats,
    X: Floats,
) -> None:
    """Step the torque from u_first to u; if its delay is a parameter, add the effect of a later step to its gradient.

    dx/d(delay) = B (u_first - u), which is propagated like the other z_i from here on.  A torque that acts before its
    sample (delay < 0) has moved x by that much already, to first order.
    """
    row, slot, col = inputs.row, inputs.slot, inputs.col
    z = p * (X.shape[0] // (p + 1))
    n = X.shape[0] - z
    for q in range(row.size):
        if kind[col[q]] == TORQUE:
            for a in range(len(lanes)):
                kick = V[slot[q], a] * (u_first[col[q], a] - u[col[q], a]) if h[a] + h_first[a] > 0.0 else 0.0
                X[row[q], a] += min(delay[a], 0.0) * kick
                if row[q] >= z:
                    X[late * n + row[q] - z, a] += kick


# --- A speed that the drive averages over its sampling interval: s' = speed, s = 0 at each sample, yhat = s / h -------


# The drive averages over its own interval.  After lost samples this is the last of several intervals, and s is reset at
# its beginning.  The correction by K does not change s, as s is reset after it.

LOST = 1.75
"""Number of intervals from which samples are missing; then the averaging interval of the drive is the nominal one."""


@kernel
def split_at_mean(
    lanes: Any, interval: Floats, h_first: Floats, h: Floats, h_before: Floats, over: Floats, lost: Ints
) -> bool:
    """Split h (W,) where the averaging interval of the drive begins, after h_before.  True if a lane splits.

    On entry h is the rest of the interval after h_first, during which the previous torque acts.  ``over`` (W,):
    averaging interval of the drive.  If the torque changes before the averaging interval begins, which does not happen
    for whole numbers of intervals, its earlier part is lost.
    """
    any_lost = False
    for a in range(len(lanes)):
        interval_h = h_first[a] + h[a]
        lost[a] = interval_h > LOST * interval[a]
        h_before[a] = max(h[a] - interval[a], 0.0) if lost[a] else 0.0
        h[a] -= h_before[a]
        over[a] = h[a] if lost[a] else interval_h
        any_lost |= lost[a] != 0
    return any_lost


@kernel
def restart_integral(lanes: Any, s: int, n: int, on: Ints, X: Floats) -> None:
    """Reset s and its derivatives to 0, in x and the z_i of X."""
    for r in range(s, X.shape[0], n):
        for a in range(len(lanes)):
            X[r, a] = 0.0 if on[a] else X[r, a]


@kernel
def mark_sampled(lanes: Any, mode: Ints, on: Ints) -> None:
    """Mark the lanes (W,) in which the drive has taken a sample, including rejected ones."""
    for a in range(len(lanes)):
        on[a] = mode[a] >= SETTLE


@kernel
def divide_by_interval(lanes: Any, over: Floats, yhat: Floats, psi: Floats) -> None:
    """Yhat = s / h and psi_i = z_is / h.  A lane that does not move has h = 0."""
    for a in range(len(lanes)):
        yhat[a] = yhat[a] / over[a] if over[a] > 0.0 else 0.0
    for i in range(psi.shape[0]):
        for a in range(len(lanes)):
            psi[i, a] = psi[i, a] / over[a] if over[a] > 0.0 else 0.0
