"""Predictors of the multi-model detector, side by side: propagation, prediction errors, corrections."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import array_function, kernel, outlined
from monitor_core.kernel.llvm_vectors import EIGHT, load8, spread8, store
from monitor_core.kernel.propagate import choose_substeps, evaluate_inputs, propagate
from monitor_core.kernel.sample_interval import interval_gain, restart_integral, split_at_mean
from monitor_core.kernel.tables import TORQUE, Tables
from monitor_core.kernel.taylor_series import SECTIONS
from monitor_core.kernel.work_arrays import floats, ints, strided_product, table

(
    DELAY,
    TORQUE_SCALE,
    TORQUE_OFFSET,
    SCALE,
    OFFSET,
    FROZEN,
    STILL,
    PRECISION,
    LEVEL,
    LIMIT,
    ALLOWANCE,
    TOLERATED,
    UNEXPLAINED,
) = range(13)
"""Rows of ``own``: delay s; the acting torque is scale * measured + offset, N m; the measured output scale * true +
offset; 1: the output repeats itself; 1: holds only while the measured torque does; 1 / lam_i; 1/2 log(lam_0 / lam_i) -
allowance; h; allowance; the part of the allowance that counts as evidence of the cause all the same; share of the
evidence against the healthy axis that the active faults may leave unexplained."""
INTERVAL, LAM, LAM0, GAP, SETTLES, LOST, OUTLIER, OUTLIER_LEAST, OUTLIER_CREDIT, SHORTEST, BACK = range(11)
"""Rows of ``axis``; SHORTEST: of the usual intervals, us; BACK: the lane of the healthy axis."""
USUAL = 3
"""Intervals that are discretised in advance, a microsecond apart."""
TERMS = 4
"""Number of terms: a constant, and the effect of the held torque, of the one before, and of the next one."""
FARTHEST = 1e9
"""A predictor with an error of more standard deviations than this diverges, if another one predicts the axis."""


class Predictors(NamedTuple):
    """Constants of the hypotheses, H of them, a multiple of eight; those of the axis have one column."""

    V0: Floats  # (slots + 1, H) entries of A, B, C, and a zero
    weight: Floats  # (entries of A, H) d_col / d_row of the balancing diagonal d
    K: Floats  # (GAINS n, H) filter gain after 0, 1, 2 .. intervals, over the scale of the output
    rest: Floats  # (n, H)
    rigid: Floats  # (n, H)
    u_scale: Floats  # (m, H)
    usual_K: Floats  # (USUAL n, H) filter gain after each of the usual intervals
    terms: Floats  # (USUAL H/8 n (TERMS + n + len(moving)) 8,) factors of what x_r becomes after each of them, in the
    #                order of ``propagate_usual``: of eight hypotheses side by side, so that memory is read as it lies
    moving: NDArray[np.int64]  # (..,) which of the inputs that depend on the motion, and of the weight, act
    own: Floats  # (13, H)
    axis: Floats  # (11, 1)


class Torques(NamedTuple):
    """Measured torques that may act in an interval [N m]."""

    before: float  # of the sample before the last
    held: float  # of the last sample
    now: float  # of the sample that ends the interval


@kernel
def propagate_usual(
    n: int, usual: int, terms: Floats, moving: Ints, torque: Torques, u: Floats, x: Floats, new: Floats
) -> None:
    """x = Ad x + Bd u over this one of the usual intervals; all flat, H numbers a row; ``new`` is scratch."""
    H = x.size // n
    at = usual * H * n * (TERMS + n + moving.size)
    for a in range(0, H, EIGHT):
        for r in range(n):
            total = load8(terms, at) + load8(terms, at + EIGHT) * spread8(torque.held)
            total = total + load8(terms, at + 2 * EIGHT) * spread8(torque.before)
            total = total + load8(terms, at + 3 * EIGHT) * spread8(torque.now)
            at += TERMS * EIGHT
            for c in range(n):
                total = total + load8(terms, at + c * EIGHT) * load8(x, c * H + a)
            at += n * EIGHT
            for q in range(moving.size):
                total = total + load8(terms, at + q * EIGHT) * load8(u, moving[q] * H + a)
            at += moving.size * EIGHT
            store(new, r * H + a, total)
    for e in range(x.size):
        x[e] = new[e]


@kernel
def scale_torque(lanes: Any, kind: Ints, own: Floats, torque: float, u: Floats) -> None:
    """The acting torque under each hypothesis, from the measured torque."""
    for c in range(kind.size):
        if kind[c] == TORQUE:
            for a in range(len(lanes)):
                u[c, a] = own[TORQUE_SCALE, a] * torque + own[TORQUE_OFFSET, a]


@kernel
def torques_in_turn(
    lanes: Any, kind: Ints, own: Floats, h: float, torque: Torques, first: Floats, late: Floats, u: Floats
) -> None:
    """The two successive torques in an interval h: ``first`` (H,) for the time ``late`` (H,), then that in u.

    A late torque acts after the previous one; an early torque is followed by that of the next sample.
    """
    for a in range(len(lanes)):
        early = own[DELAY, a] < 0.0
        first[a] = own[TORQUE_SCALE, a] * (torque.held if early else torque.before) + own[TORQUE_OFFSET, a]
        late[a] = max(own[DELAY, a] + (h if early else 0.0), 0.0)
    for c in range(kind.size):
        if kind[c] == TORQUE:
            for a in range(len(lanes)):
                second = torque.now if own[DELAY, a] < 0.0 else torque.held
                u[c, a] = own[TORQUE_SCALE, a] * second + own[TORQUE_OFFSET, a]


@kernel
def _parts(lanes: Any, own: Floats, h: float, before: Floats, held: Floats, now: Floats) -> None:
    """Divide the interval h into parts (H,): with the previous torque, the held torque, and the next torque."""
    for a in range(len(lanes)):
        delay = own[DELAY, a]
        before[a] = min(max(delay, 0.0), h)
        now[a] = min(max(-delay, 0.0), h)
        held[a] = h - before[a] - now[a]


@array_function
def _over(
    lanes: Any, T: Tables, P: Predictors, torque: float, h: Floats, u: Floats, X: Floats, work: Floats, more: Floats
) -> None:  # fmt: skip
    """Propagate X over h (H,) under one torque, exactly (propagate.py)."""
    n, H, longest = T.n, len(lanes), 0.0
    for a in range(H):
        longest = max(longest, h[a])
    if longest == 0.0:
        return
    GX, du = table(n, H), np.zeros((0, T.m, H))
    steps, terms, norm = ints(H), ints(H), floats(H)
    scale_torque(lanes, T.kind, P.own, torque, u)
    evaluate_inputs(lanes, T.inputs, P.V0, u, du, GX)
    choose_substeps(lanes, T.A_row, P.weight, P.V0, h, steps, terms, norm)
    F, V = strided_product(T.product, 0, EIGHT, H), P.V0.reshape(P.V0.size)
    G, X_flat = GX.reshape(GX.size), X.reshape(X.size)
    propagate(lanes, F, V, G, h, steps, terms, X_flat, work, more)


@array_function
def propagate_interval(
    lanes: Any,
    T: Tables,
    P: Predictors,
    h: float,
    torque: Torques,
    u: Floats,
    x: Floats,
    over: Floats,
    K: Floats,
) -> None:
    """Propagate X over any interval h, in parts with different torques.

    K (n, H): filter gain after the interval.  ``over`` (H,): averaging interval of a mean speed.
    """
    n, H, wide = T.n, len(lanes), EIGHT
    before, held, now, cut = floats(H), floats(H), floats(H), floats(H)
    intervals, lams, lam, lost = floats(H), floats(H), floats(H), ints(H)
    work, more = floats(SECTIONS * n * T.product.blocks * wide), floats(4 * wide)
    for a in range(H):
        intervals[a], lams[a], over[a] = P.axis[INTERVAL, 0], P.axis[LAM, 0], h
    interval_gain(lanes, intervals, lams, P.K, over, over, lam, K)
    _parts(lanes, P.own, h, before, held, now)
    _over(lanes, T, P, torque.before, before, u, x, work, more)
    if T.mean >= 0:
        for a in range(H):
            held[a] += now[a]
        if split_at_mean(lanes, intervals, before, held, cut, over, lost):
            _over(lanes, T, P, torque.held, cut, u, x, work, more)
            restart_integral(lanes, T.mean, n, lost, x)
        for a in range(H):
            held[a] = max(held[a] - now[a], 0.0)
    _over(lanes, T, P, torque.held, held, u, x, work, more)
    _over(lanes, T, P, torque.now, now, u, x, work, more)


@kernel
def prediction_errors(lanes: Any, own: Floats, y: float, before: float, yhat: Floats, most: float, eps: Floats) -> int:
    """Compute e_i (H,); returns how many of them exceed ``most`` or are not finite."""
    beyond = 0
    for a in range(len(lanes)):
        e = y - own[OFFSET, a] - own[SCALE, a] * yhat[a]
        eps[a] = y - before if own[FROZEN, a] > 0.0 else e
        beyond += 0 if abs(eps[a]) <= most else 1
    return beyond


@outlined
def restart_diverged(most: float, eps: Floats, x: Floats) -> bool:
    """Restart predictors that diverge, |e_i| > most, from the state of the first; False if that is not finite, too.

    The gain of a hypothesis may be wrong for the true axis, for instance after rejected samples; one diverged predictor
    must not stop the others.
    """
    if not abs(eps[0]) < math.inf:
        return False
    for a in range(eps.size):
        if not abs(eps[a]) <= most:
            eps[a] = eps[0]
            for r in range(x.shape[0]):
                x[r, a] = x[r, 0]
    return True


@kernel
def has_gain(K: Floats) -> bool:
    """Whether any gain is not zero."""
    some = False
    for r in range(K.shape[0]):
        for a in range(K.shape[1]):
            some |= K[r, a] != 0.0
    return some


@kernel
def correct(lanes: Any, K: Floats, eps: Floats, x: Floats) -> None:
    """Innovations form: x_i = x_i + K_i e_i."""
    for r in range(K.shape[0]):
        for a in range(len(lanes)):
            x[r, a] += K[r, a] * eps[a]


@kernel
def correct_speed(lanes: Any, rest: Floats, rigid: Floats, own: Floats, h: float, eps: Floats, x: Floats) -> None:
    """Set angle and speed from the first samples after a start (admission.gain_of_speed)."""
    for r in range(x.shape[0]):
        for a in range(len(lanes)):
            x[r, a] += (rest[r, a] + rigid[r, a] / h) * eps[a] / own[SCALE, a]
