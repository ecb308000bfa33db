"""A second output in the same sample: the speed beside the angle, both as the drive measures them.

With noises that do not depend on each other a Kalman filter may take the outputs of one instant one after the other
(Anderson and Moore, Optimal Filtering, 6.1), and so may the least squares of theta.  So the second is an update of its
own after the first, with no time in between: lambda = 1, its gain is the one that is left when the first has been used,
and its innovations are scaled to the variance of the first one's, which sets what each counts.

* Its prediction is that of the corrected state:  yhat2 + c eps, psi2 - c psi, c = C2 K.  theta's first step is taken
  off its innovation, psi2' (theta - theta before), as both gradients belong to the theta before.
* The first decides what becomes of a sample.  Without it there is none; where it waits, settles, is gated or doubted,
  the second corrects the state and nothing else.  P(0), observation, CUSUM and counters come once, after both.
* The second may be missing (NaN), or an outlier by a gate of its own: the sample then goes on without.  Where it is
  missing the first has the gain that it has alone, so that a predictor that lacks the second for long stays true.
* How much there is to learn from is told by both gradients, also while the second is missing.
"""

import math
from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import DOUBTED, SETTLE, SKIP
from monitor_core.kernel.compile import aside
from monitor_core.kernel.interval import for_interval
from monitor_core.kernel.outliers import running_variance, sift
from monitor_core.kernel.recursion import correct, gain, predict, update_P, update_theta
from monitor_core.kernel.state import MISSING2, OUTLIER2
from monitor_core.kernel.tables import GAINS

VECTORS, MARKS = 8, 6
"""Rows of floats, beside three for each parameter, and of integers that the two functions have between them."""


@aside
def foresee(
    lanes: Any,
    k: int,
    a0: int,
    samples: Floats,
    slot: Ints,
    src: Ints,
    par: Ints,
    scale: Floats,
    V: Floats,
    X: Floats,
    gains: Floats,
    interval: Floats,
    lam: Floats,
    h_first: Floats,
    h: Floats,
    K: Floats,
    K2: Floats,
    P: Floats,
    psi: Floats,
    work: Floats,
    more: Floats,
) -> None:
    """Predict the second output and its gradient, both scaled; ``more`` (W,) becomes psi2' P psi2.

    ``samples`` (N, W), or (0, W) where it is missing throughout.  K2 (2 n, W) becomes its gain, and that of the first
    output alone, which K (n, W) becomes where the second is missing; ``gains`` as in Constants.
    """
    p, n = psi.shape[0], K.shape[0]
    y, yhat, c, whole, zero = work[0], work[1], work[2], work[3], work[4]
    psi2, Ppsi = work[VECTORS : VECTORS + p], work[VECTORS + p : VECTORS + 2 * p]
    for a in range(len(lanes)):
        whole[a] = h_first[a] + h[a]
    for which in range(2):
        of = gains[(1 + which) * GAINS * n : (2 + which) * GAINS * n]
        for_interval(lanes, interval, lam, of, whole, whole, zero, K2[which * n : (which + 1) * n])
    for a in range(len(lanes)):
        zero[a] = c[a] = 0.0
        y[a] = samples[k, min(a0 + a, samples.shape[1] - 1)] if samples.shape[0] else math.nan
        for r in range(n):
            K[r, a] = K[r, a] if math.isfinite(y[a]) else K2[n + r, a]
    predict(lanes, slot, src, par, V, X, yhat, psi2)
    for q in range(slot.size):
        if par[q] < 0:
            for a in range(len(lanes)):
                c[a] += V[slot[q], a] * K[src[q] - p * n, a]
    for i in range(p):
        for a in range(len(lanes)):
            psi2[i, a] = scale[0, a] * (psi2[i, a] - c[a] * psi[i, a])
    gain(lanes, zero, P, psi2, Ppsi, more)


@aside
def second(
    lanes: Any,
    lower: Floats,
    upper: Floats,
    slot: Ints,
    src: Ints,
    par: Ints,
    scale: Floats,
    V: Floats,
    outlier: Floats,
    lam_slow: Floats,
    lam0_running: Floats,
    credit: Floats,
    in_a_row: Ints,
    counts: Ints,
    K: Floats,
    K2: Floats,
    P: Floats,
    theta: Floats,
    observed: Ints,
    psi: Floats,
    eps: Floats,
    does: Ints,
    moves: Ints,
    learns: Ints,
    tracks: Ints,
    hit: Ints,
    moved: Floats,
    X: Floats,
    work: Floats,
    marks: Ints,
) -> None:
    """The update with the second output: theta, P, state; ``moved`` (p, W) becomes the whole step of theta."""
    p, n = psi.shape[0], K.shape[0]
    y, yhat, c, eps2, step, S, one, believed = (
        work[0],
        work[1],
        work[2],
        work[3],
        work[4],
        work[5],
        work[6],
        work[7],
    )
    psi2, Ppsi, moved2 = (
        work[VECTORS : VECTORS + p],
        work[VECTORS + p : VECTORS + 2 * p],
        work[VECTORS + 2 * p :],
    )
    does2, moves2, learns2, tracks2, fit, hit2 = marks[0], marks[1], marks[2], marks[3], marks[4], marks[5]
    for a in range(len(lanes)):
        one[a] = 1.0
        here = does[a] >= SETTLE and math.isfinite(y[a])
        counts[MISSING2, a] += does[a] >= SETTLE and not here
        eps2[a] = scale[0, a] * (y[a] - yhat[a] - (c[a] * eps[a] if moves[a] else 0.0)) if here else 0.0
        step[a] = eps2[a]
        does2[a] = does[a] if here else SKIP
        moves2[a] = here
        learns2[a] = learns[a] if here else 0
        tracks2[a] = tracks[a] if here else 0
    for i in range(p):
        for a in range(len(lanes)):
            psi2[i, a] += 0.0 if moves[a] else scale[0, a] * c[a] * psi[i, a]
    for q in range(slot.size):
        if par[q] >= 0 and src[q] >= p * n:  # C2_i K eps, of the correction of x
            for a in range(len(lanes)):
                more = V[slot[q], a] * K[src[q] - p * n, a] * eps[a]
                psi2[par[q], a] += scale[0, a] * more if moves[a] else 0.0
    for i in range(p):
        for a in range(len(lanes)):
            step[a] -= psi2[i, a] * moved[i, a] if does2[a] != SKIP else 0.0
    gain(lanes, one, P, psi2, Ppsi, S)
    sift(
        lanes,
        outlier,
        one,
        lam0_running[0],
        step,
        S,
        credit[0],
        in_a_row[0],
        does2,
        moves2,
        learns2,
        tracks2,
        believed,
    )
    update_theta(lanes, lower, upper, theta, observed, believed, Ppsi, S, tracks2, hit2, moved2)
    update_P(lanes, one, P, Ppsi, S, learns2, fit)
    running_variance(lanes, one, lam_slow, lam0_running[0], step, S, does2)
    correct(lanes, K2[:n], X, eps2, psi2, moves2)
    for a in range(len(lanes)):
        counts[OUTLIER2, a] += does2[a] == DOUBTED and does[a] != DOUBTED
        hit[a] = max(hit[a], hit2[a])
    for i in range(p):
        for a in range(len(lanes)):
            moved[i, a] += moved2[i, a]
