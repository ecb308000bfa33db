"""A drive with its inputs held over an interval, and the derivatives of that, once for each distinct interval."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import zero_order_hold_slopes
from monitor_core.identification.term_derivatives import Linear


class Held(NamedTuple):
    """x(t + h) = X (x, u), X = [Ad Bd], for G intervals; derivatives have the parameter as second axis."""

    X: Floats  # (G, n, n + m)
    dX: Floats  # (G, p, n, n + m)


def hold(of: Linear, intervals_s: Floats) -> Held:
    """The drive over these intervals (G,), in s, exactly."""
    dA, dB = (np.moveaxis(slopes, 2, 0) for slopes in (of.dA, of.dB))
    return Held(*zero_order_hold_slopes(of.A, of.B, dA, dB, intervals_s))


def hold_late(of: Linear, torque: NDArray[np.bool_], intervals_s: Floats, delay_s: float) -> Held:
    """The drive with its torque delayed by tau_d: until then that of the sample before acts, a further input.

        [t, t + tau_d): u[k-1],   [t + tau_d, t + h): u[k];   the other inputs do not wait

    ``torque`` (m,) says which inputs are the motor torque.  The derivative with respect to tau_d is the last one.
    A delay beyond the interval ends with it, as in the monitor.
    """
    n, m = of.B.shape
    whole = hold(of, intervals_s)
    late = np.minimum(delay_s, intervals_s)
    rest = hold(of, intervals_s - late)
    G, p = whole.dX.shape[:2]
    X, dX = np.empty((G, n, n + m + 1)), np.zeros((G, p + 1, n, n + m + 1))
    columns = np.flatnonzero(np.concatenate([np.zeros(n, bool), torque]))
    for to, all_, last in ((X, whole.X, rest.X), (dX[:, :p], whole.dX, rest.dX)):
        to[..., : n + m] = all_
        to[..., columns] = last[..., columns]
        to[..., n + m] = (all_[..., columns] - last[..., columns]).sum(axis=-1)
    # d/dtau of what acts over the rest: the integrand at its end, exp(A (h - tau)) B.
    edge = (rest.X[:, :, :n] @ of.B[:, torque]) * (delay_s <= intervals_s)[:, None, None]
    dX[:, p][..., columns] = -edge
    dX[:, p, :, n + m] = edge.sum(axis=-1)
    return Held(X, dX)
