"""Multi-model detector: fixed predictors of one axis side by side, each with a CUSUM of log-likelihood ratios.

    e_i = y - yhat_i,     x_i = x_i + K_i e_i,     then over the interval:  x_i = Ad_i x_i + Bd_i u
    l_i = 1/2 log(lam_0 / lam_i) + e_0^2 / (2 lam_0) - e_i^2 / (2 lam_i) - allowance_i - unexplained_i
    g_i = max(0, g_i + l_i),     alarm when g_i > h_i

Hypothesis 0 is the reference: the present state of the axis with its active faults, which leave a share of their effect
unexplained (likelihood.py).  While the reference holds, the mean of exp(l_i) is 1 (without allowance), so the mean time
between false alarms of each hypothesis is at least exp(h_i) samples (Lorden).  theta is fixed, so the usual intervals
are discretised once: the nominal one, and those that are a microsecond shorter or longer, as times are rounded to
microseconds.  Any other interval is propagated as in the recursion (propagate.py).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import (
    DOUBTED,
    RESTART,
    SETTLE,
    SKIP,
    TRACK,
    Roles,
    Timing,
    classify_sample,
    close_gate,
    hold_inputs,
    is_first,
    restart_predictor,
)
from monitor_core.kernel.admission import GATED as CLOSED
from monitor_core.kernel.compile import entry, kernel, outlined
from monitor_core.kernel.friction import MiddleSpeed, hold_friction
from monitor_core.kernel.likelihood import (
    G,
    add_likelihood_ratios,
    log_likelihood_ratios,
    restart_paths,
    update_sums,
)
from monitor_core.kernel.outliers import OutlierConstants, check_start, reject_outliers
from monitor_core.kernel.predictors import (
    BACK,
    FARTHEST,
    GAP,
    INTERVAL,
    LAM,
    LAM0,
    LOST,
    OFFSET,
    OUTLIER,
    OUTLIER_CREDIT,
    OUTLIER_LEAST,
    SCALE,
    SETTLES,
    SHORTEST,
    USUAL,
    Predictors,
    Torques,
    correct,
    correct_speed,
    has_gain,
    prediction_errors,
    propagate_interval,
    propagate_usual,
    restart_diverged,
    torques_in_turn,
)
from monitor_core.kernel.recursion import predict
from monitor_core.kernel.sample_interval import divide_by_interval, restart_integral
from monitor_core.kernel.state import DIVERGED, GATED, NEVER, SETTLING, USED
from monitor_core.kernel.state import OUTLIER as OUTLIER_COUNT
from monitor_core.kernel.tables import Tables
from monitor_core.kernel.work_arrays import copy_rows, floats, ints, table

TORQUE_BEFORE, TORQUE_HELD, LAST_OUTPUT, CREDIT = range(4)
LAST, SETTLED, IN_A_ROW, PHASE, WAIT, CHECKS, SINCE, COUNTS = range(8)
WATCHING, PENDING, REFINING, CORRECTING = range(4)
"""Phases.  WATCHING: the first g > h stops a run.  PENDING: a change was detected and its cause is not known.
REFINING: the cause is known and its size becomes more certain.  CORRECTING: as WATCHING, while the finer steps around
that size show its error.  In the last three the WAIT-th tested sample from now stops a run."""


class Memory(NamedTuple):
    """State of the multi-model detector of one axis."""

    x: Floats  # (n, H) at the last sample, after its correction
    u: Floats  # (m, H) inputs held since
    sums: Floats  # (SUMS, H) rows of likelihood.py
    when: NDArray[np.int64]  # (2 + MARKS, H) us: g last 0; g last below SURE; marks, the latest first
    numbers: Floats  # (4, 1) torque of the sample before the last, of the last; last output; credit of outliers
    integers: NDArray[
        np.int64
    ]  # (COUNTS + len(COUNTERS), 1) time of the last sample; time settled; outliers in a row; phase; wait;
    #                          looks; time of the last g > h that began a change; what became of samples


class Block(NamedTuple):
    """Samples of one axis."""

    t: NDArray[np.int64]  # (N,) us
    u: Floats  # (N,) N m
    y: Floats  # (N,)
    gate: NDArray[np.bool_]  # (N, 1) whether to test; (0, 1): always
    weight: Floats  # (N,) torque of the weight, N m; NaN, or (0,): the last value


class BankTrace(NamedTuple):
    """Values at each sample; arrays of length 0 if no trace is wanted."""

    eps: Floats  # (N, H) innovations
    llr: Floats  # (N, H) l_i; NaN: not tested
    g: Floats  # (N, H)


class Sample(NamedTuple):
    """The present sample, an array (1,) each."""

    t: Ints  # us
    u: Floats  # N m
    y: Floats
    h: Floats  # interval before it, s
    roles: Roles
    eps: Floats  # innovation of hypothesis 0
    S: Floats
    lam: Floats
    lam0_running: Floats  # unused: the limit of an outlier comes from the records
    believed: Floats
    seed_left: Ints


class BankWork(NamedTuple):
    """Work arrays of a run."""

    X: Floats  # (n H,) the state, flat
    new: Floats  # (n H,) the next state
    acting: Floats  # (m, H) inputs over the interval
    acting_flat: Floats  # (m H,)
    over: Floats  # (H,) interval, s
    K: Floats  # (n, H) gain of an interval that is not usual
    yhat: Floats  # (H,)
    psi: Floats  # (0, H)
    eps: Floats  # (H,)
    llr: Floats  # (H,)
    before: Floats  # (H,)
    late: Floats  # (H,)
    motion: Floats  # (H,)
    weight: Floats  # (H,)
    doing: Ints  # (H,)
    last: Ints  # (H,)
    middle: MiddleSpeed


@kernel
def _take(k: int, block: Block, s: Sample) -> None:
    s.t[0], s.u[0], s.y[0], s.roles.mode[0] = block.t[k], block.u[k], block.y[k], TRACK


@kernel
def _inputs(lanes: Any, T: Tables, P: Predictors, M: Memory, torque: Torques, s: Sample, w: BankWork) -> None:
    """Set the inputs over the interval before the sample, and the length of the interval."""
    for a in range(len(lanes)):
        w.over[a] = s.h[0]
    if P.moving.size:
        copy_rows(M.u, w.acting)
    if P.moving.size and T.friction.number:
        torques_in_turn(lanes, T.kind, P.own, s.h[0], torque, w.before, w.late, w.acting)
        hold_friction(lanes, T.friction, T.kind, P.u_scale, P.V0, w.late, w.before, w.over, M.x, w.acting, None,
                      w.middle)  # fmt: skip


@kernel
def _end_mean(lanes: Any, T: Tables, M: Memory, w: BankWork) -> None:
    """Compute the mean speed of the interval, and restart the integral for the next one."""
    divide_by_interval(lanes, w.over, w.yhat, w.psi)
    for a in range(len(lanes)):
        w.doing[a] = 1
    restart_integral(lanes, T.mean, T.n, w.doing, M.x)


@kernel
def _forget_state(M: Memory, s: Sample, w: BankWork) -> None:
    """Restart with the next sample, as all hypotheses have diverged."""
    M.integers[COUNTS + DIVERGED, 0] += 1
    M.integers[LAST, 0] = NEVER
    s.roles.mode[0] = SKIP
    for e in range(w.X.size):
        w.X[e] = 0.0


@kernel
def _admit(lane: Any, P: Predictors, M: Memory, limits: OutlierConstants, s: Sample, w: BankWork) -> None:
    """Reject the sample if it is an outlier by the innovation of hypothesis 0; restart if the start was wrong."""
    roles, axis, integers = s.roles, P.axis, M.integers
    roles.moves[0], roles.learns[0], roles.tracks[0] = 1, roles.mode[0] == TRACK, roles.mode[0] == TRACK
    s.lam[0] = s.S[0] = axis[LAM, 0]
    s.eps[0] = w.eps[0]
    reject_outliers(lane, limits, s.lam, s.lam0_running, s.eps, s.S, M.numbers[CREDIT], integers[IN_A_ROW], roles,
                    s.believed)  # fmt: skip
    check_start(lane, axis[SETTLES], axis[INTERVAL], s.t, integers[SETTLED], integers[IN_A_ROW], integers[COUNTS:],
                roles.mode)  # fmt: skip


@kernel
def _correct(
    lanes: Any, T: Tables, P: Predictors, M: Memory, usual: int, gains: bool, turns: bool, s: Sample, w: BankWork
) -> None:
    """x = x + K eps; for the first samples after a start, set x as if the axis moved rigidly."""
    mode, integers = s.roles.mode, M.integers
    first = is_first(s.t[0], integers[SETTLED, 0], P.axis[SETTLES, 0], s.h[0])
    if turns and first and mode[0] == SETTLE:
        integers[IN_A_ROW, 0] = 0
        correct_speed(lanes, P.rest, P.rigid, P.own, s.h[0], w.eps, M.x)
    elif s.roles.moves[0] and gains:
        if 0 <= usual < USUAL:
            correct(lanes, P.usual_K[usual * T.n : (usual + 1) * T.n], w.eps, M.x)
        else:
            correct(lanes, w.K, w.eps, M.x)


@kernel
def _test(lanes: Any, P: Predictors, M: Memory, s: Sample, w: BankWork) -> None:
    """Update g of each hypothesis; WAIT becomes 0 if the run must stop for a decision."""
    numbers, integers = M.numbers, M.integers
    new_torque, new_output = s.u[0] != numbers[TORQUE_HELD, 0], s.y[0] != numbers[LAST_OUTPUT, 0]
    log_likelihood_ratios(lanes, P.own, int(P.axis[BACK, 0]), new_torque, new_output, w.eps, w.llr)
    phase = integers[PHASE, 0]
    watching = phase in (WATCHING, CORRECTING)
    crossed = update_sums(lanes, P.own, s.t[0], watching, w.llr, M.sums, M.when)
    if phase != WATCHING:
        integers[WAIT, 0] = max(integers[WAIT, 0] - 1, 0)
        add_likelihood_ratios(lanes, P.own, w.eps, M.sums)
    if watching and crossed:
        integers[WAIT, 0] = 0


@kernel
def _restart(lanes: Any, P: Predictors, M: Memory, s: Sample, w: BankWork) -> None:
    """Restart x from the measured output, as if the axis moved rigidly with it."""
    for a in range(len(lanes)):
        w.motion[a] = (s.y[0] - P.own[OFFSET, a]) / P.own[SCALE, a]
        w.doing[a] = RESTART
    restart_predictor(lanes, w.doing, P.rest, w.motion, M.x)
    restart_paths(s.t[0], M.when)
    M.numbers[TORQUE_HELD, 0] = s.u[0]


@kernel
def _hold(lanes: Any, T: Tables, P: Predictors, M: Memory, weight: float, s: Sample, w: BankWork) -> None:
    """Hold the inputs until the next sample."""
    if P.moving.size:
        for a in range(len(lanes)):
            w.motion[a] = (s.y[0] - P.own[OFFSET, a]) / P.own[SCALE, a]
            w.doing[a] = TRACK
            w.weight[a] = weight
        hold_inputs(lanes, T, P.u_scale, P.rest, w.last, w.motion, w.motion, w.weight, w.doing, w.last, M.u, w.before)
    numbers = M.numbers
    M.integers[LAST, 0] = s.t[0]
    numbers[TORQUE_BEFORE, 0] = numbers[TORQUE_HELD, 0]
    numbers[TORQUE_HELD, 0], numbers[LAST_OUTPUT, 0] = s.u[0], s.y[0]


@kernel
def _tally(mode: int, counts: Ints) -> None:
    counts[USED, 0] += mode == TRACK
    counts[SETTLING, 0] += mode == SETTLE
    counts[GATED, 0] += mode == CLOSED
    counts[OUTLIER_COUNT, 0] += mode == DOUBTED


@outlined
def _record(k: int, moved: bool, tested: bool, w: BankWork, sums: Floats, to: BankTrace) -> None:
    for a in range(to.g.shape[1]):
        to.eps[k, a] = w.eps[a] if moved else math.nan
        to.llr[k, a] = w.llr[a] if tested else math.nan
        to.g[k, a] = sums[G, a]


@entry
def run_hypotheses(lanes: Any, T: Tables, P: Predictors, M: Memory, block: Block, start: int, trace: BankTrace) -> int:
    """Run samples from ``start`` on until a decision is due; returns the number of samples taken.

    ``lanes``: an array of H numbers.
    """
    lane = (0,)
    n, m, H, axis, numbers, integers = T.n, T.m, len(lanes), P.axis, M.numbers, M.integers
    roles = Roles(ints(1), ints(1), ints(1), ints(1))
    s = Sample(ints(1), floats(1), floats(1), floats(1), roles, floats(1), floats(1), floats(1), floats(1), floats(1),
               ints(1))  # fmt: skip
    acting, yhat, psi, eps, llr, motion = table(m, H), floats(H), table(0, H), floats(H), floats(H), floats(H)
    # These arrays are computed later in each sample; until then they serve as scratch.
    middle = MiddleSpeed(table(m, H), yhat, eps, llr, motion, psi, psi, psi)
    w = BankWork(M.x.reshape(M.x.size), floats(n * H), acting, acting.reshape(acting.size), floats(H), table(n, H),
                 yhat, psi, eps, llr, floats(H), floats(H), motion, floats(H), ints(H), ints(H), middle)  # fmt: skip
    counts, mode, shortest = integers[COUNTS:], roles.mode, int(axis[SHORTEST, 0])
    timing = Timing(axis[GAP], axis[SETTLES], axis[INTERVAL], axis[LOST])
    limits = OutlierConstants(axis[OUTLIER], axis[OUTLIER_LEAST], axis[OUTLIER_CREDIT])
    turns = has_gain(P.K) and has_gain(P.rigid)
    gains, most = has_gain(P.K), FARTHEST * math.sqrt(axis[LAM0, 0])
    for k in range(start, block.t.size):
        _take(k, block, s)
        classify_sample(lane, s.t, s.u, s.y, timing, integers[LAST], integers[SETTLED], s.seed_left, counts, mode, s.h)
        if block.gate.shape[0]:
            close_gate(lane, k, 0, block.gate, mode)
        tested = False
        if mode[0] >= SETTLE:
            torque = Torques(numbers[TORQUE_BEFORE, 0], numbers[TORQUE_HELD, 0], s.u[0])
            _inputs(lanes, T, P, M, torque, s, w)
            usual = s.t[0] - integers[LAST, 0] - shortest
            if 0 <= usual < USUAL:
                propagate_usual(n, usual, P.terms, P.moving, torque, w.acting_flat, w.X, w.new)
            else:
                propagate_interval(lanes, T, P, s.h[0], torque, w.acting, M.x, w.over, w.K)
            predict(lanes, T.outputs, P.V0, M.x, w.yhat, w.psi)
            if T.mean >= 0:
                _end_mean(lanes, T, M, w)
            beyond = prediction_errors(lanes, P.own, s.y[0], numbers[LAST_OUTPUT, 0], w.yhat, most, w.eps)
            if beyond > 0 and not restart_diverged(most, w.eps, M.x):
                _forget_state(M, s, w)
            else:
                _admit(lane, P, M, limits, s, w)
                _correct(lanes, T, P, M, usual, gains, turns, s, w)
                tested = roles.tracks[0] != 0
                if tested:
                    _test(lanes, P, M, s, w)
        if mode[0] == RESTART:
            _restart(lanes, P, M, s, w)
        if mode[0] != SKIP:
            _hold(lanes, T, P, M, block.weight[k] if block.weight.size else math.nan, s, w)
        _tally(mode[0], counts)
        if trace.g.shape[0]:
            _record(k, mode[0] >= SETTLE, tested, w, M.sums, trace)
        if tested and integers[WAIT, 0] == 0:
            return k + 1
    return block.t.size
