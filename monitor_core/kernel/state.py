"""The state of a batch of axes: one array of floats and one of integers, a column per axis.

The whole state of a monitor is these two columns.  So a checkpoint is two arrays, and a lane can be moved, copied or
compared without knowing its content.  ``state_views`` is the only place that knows the order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel
from monitor_core.kernel.tables import GAINS, Constants, Tables

NEVER = np.iinfo(np.int64).min
"""Time stamp of an event that has not happened."""

SCHEMA = 7
"""Version of the order below; part of the key of every checkpoint."""

COUNTERS = (
    "used",
    "seeding",
    "settling",
    "gated",
    "outlier",
    "starved",
    "started",
    "gap",
    "not_finite",
    "not_increasing",
    "diverged",
    "projected",
)
"""Counters of samples by their use, each sample in one; ``projected`` counts updates of theta limited by a bound."""
(
    USED,
    SEEDING,
    SETTLING,
    GATED,
    OUTLIER,
    STARVED,
    STARTED,
    GAP,
    NOT_FINITE,
    NOT_INCREASING,
    DIVERGED,
    PROJECTED,
) = range(len(COUNTERS))

OBSERVED, WEAK, UNSEEN = 0, 1, 2
"""Present information on a parameter, compared with commissioning"""


class State(NamedTuple):
    """Views into the two arrays; letters as in the paper."""

    x: Floats  # (n, W) state of the predictor, at the last sample, after its correction
    z: Floats  # (p n, W) dx/dtheta_i, one after the other
    theta: Floats  # (p, W)
    P: Floats  # (p, p, W)
    g: Floats  # (2, p, W) CUSUM for an increase and for a decrease
    u: Floats  # (m, W) inputs held since the last sample; in the rows of friction a measured speed
    torque_before: Floats  # (W,) torque of the sample before, acts during the delay
    lam0_running: Floats  # (W,) running innovation variance
    P_nom: Floats  # (p, W) commissioned P_ii: P(0); the sum of P_ii while it is being found
    theta_seen: Floats  # (p, W) theta_i when it was last observed
    shift: Floats  # (p, W) theta_0(s) - theta_0, where nominal values follow signals s
    credit: Floats  # (W,) number of outliers that may be rejected now
    excitation: Floats  # (W,) running mean of psi' P psi over p (1 - lambda), each counting as 1 at most
    t: NDArray[np.int64]  # (W,) time of the last sample, us
    settled: NDArray[np.int64]  # (W,) time from which theta is updated, us
    seed_left: NDArray[np.int64]  # (W,) updates still needed to find P(0)
    onset: NDArray[np.int64]  # (2, p, W) time at which g was last zero, us
    observed: NDArray[np.int64]  # (p, W) OBSERVED, WEAK, UNSEEN
    since: NDArray[np.int64]  # (W,) updates since the information floor was last applied to P
    unobserved: NDArray[np.int64]  # (W,) number of directions that are not observed
    in_a_row: NDArray[np.int64]  # (W,) outliers up to the last sample; in a jolt SURELY, and samples until it is over
    left: NDArray[np.int64]  # (W,) samples to learn until evidence is noted
    noting: NDArray[np.int64]  # (W,) purpose of that evidence: COURSE, NAMING
    learned: NDArray[np.int64]  # (W,) samples learned so far
    mode: NDArray[np.int64]  # (W,) mode of the last predicted sample: SETTLE .. TRACK of kernel.admission
    tested: NDArray[np.int64]  # (p, W) samples at which the tests of a parameter ran
    counts: NDArray[np.int64]  # (len(COUNTERS), W)


def state_views(F: Floats, I: Ints, n: int, p: int, m: int) -> State:
    """Name the rows of the state of a batch: F (float_rows, W) and I (int_rows, W), both C-contiguous."""
    W = F.shape[1]
    a = n
    b = a + p * n
    c = b + p
    d = c + p * p
    e = d + 2 * p
    g = e + m
    s = g + 2 + p
    r = 3 + 2 * p
    return State(
        F[:a],
        F[a:b],
        F[b:c],
        F[c:d].reshape(p, p, W),
        F[d:e].reshape(2, p, W),
        F[e:g],
        F[g],
        F[g + 1],
        F[g + 2 : s],
        F[s : s + p],
        F[s + p : s + 2 * p],
        F[s + 2 * p],
        F[s + 2 * p + 1],
        I[0],
        I[1],
        I[2],
        I[3:r].reshape(2, p, W),
        I[r : r + p],
        I[r + p],
        I[r + p + 1],
        I[r + p + 2],
        I[r + p + 3],
        I[r + p + 4],
        I[r + p + 5],
        I[r + p + 6],
        I[r + p + 7 : r + 2 * p + 7],
        I[r + 2 * p + 7 :],
    )


def state_rows(n: int, p: int, m: int) -> tuple[int, int]:
    """Number of rows of the float array and of the integer array."""
    floats = n + p * n + p + p * p + 2 * p + m + 4 + 3 * p
    return floats, 10 + 4 * p + len(COUNTERS)


def constant_views(c: Floats, tables: Tables) -> Constants:
    """Name the rows of the constants of a batch (constant_rows, W)."""
    n, p, m = tables.n, tables.p, tables.m
    s = tables.slots
    t = s + tables.terms.slot.size
    w = t + tables.A_row.size
    k = w + GAINS * n
    r = k + 1 + 2 * n
    i = r + 8 * p
    b = i + m
    return Constants(
        c[:s],
        c[s:t],
        c[t:w],
        c[w:k],
        c[k],
        c[k + 1 : k + 1 + n],
        c[k + 1 + n : r],
        c[r : r + p],
        c[r + p : r + 2 * p],
        c[r + 2 * p : r + 3 * p],
        c[r + 3 * p : r + 4 * p],
        c[r + 4 * p : r + 5 * p],
        c[r + 5 * p : r + 6 * p],
        c[r + 6 * p : r + 7 * p],
        c[r + 7 * p : i],
        c[i:b],
        c[b],
        c[b + 1],
        c[b + 2],
        c[b + 3],
        c[b + 4],
        c[b + 5],
        c[b + 6],
        c[b + 7],
        c[b + 8],
        c[b + 9],
        c[b + 10],
        c[b + 11],
        c[b + 12],
        c[b + 13],
        c[b + 14],
        c[b + 15],
        c[b + 16],
        c[b + 17],
    )


kernel_state_views, kernel_constant_views = kernel(state_views), kernel(constant_views)
"""The same functions compiled for the kernel, without counting references to arrays"""
