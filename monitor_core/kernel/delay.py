"""The torque acts later than its sample says: an interval in two parts, and what a later step would have changed."""

from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import aside, kernel
from monitor_core.kernel.tables import TORQUE


@kernel
def delayed(
    lanes: Any,
    kind: Ints,
    delay: Floats,
    torque_before: Floats,
    u: Floats,
    h: Floats,
    h_first: Floats,
    u_first: Floats,
) -> bool:
    """Split the interval where the torque acts late: h_first with the torque before, then h.  True if any does."""
    late = False
    for a in range(len(lanes)):
        h_first[a] = min(max(delay[a], 0.0), h[a])
        h[a] -= h_first[a]
        late |= h_first[a] > 0.0
    for c in range(kind.size):
        for a in range(len(lanes)):
            u_first[c, a] = torque_before[a] if kind[c] == TORQUE else u[c, a]
    return late


@aside
def switch(
    lanes: Any,
    row: Ints,
    slot: Ints,
    col: Ints,
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
    """The torque steps from u_first to u; where its delay is a parameter, what a later step would have changed.

    dx/d(delay) = B (u_first - u), from here on propagated like the other z_i.  A torque that acts before its sample
    (delay < 0) has moved x by that much in the time before, to first order.
    """
    z = p * (X.shape[0] // (p + 1))
    n = X.shape[0] - z
    for q in range(row.size):
        if kind[col[q]] == TORQUE:
            for a in range(len(lanes)):
                kick = V[slot[q], a] * (u_first[col[q], a] - u[col[q], a]) if h[a] + h_first[a] > 0.0 else 0.0
                X[row[q], a] += min(delay[a], 0.0) * kick
                if row[q] >= z:
                    X[late * n + row[q] - z, a] += kick
