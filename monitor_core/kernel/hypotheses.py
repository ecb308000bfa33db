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
from monitor_core.kernel.likelihood import G, log_likelihood_ratios, restart_paths, update_sums
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
WATCHING, PENDING, REFINING = 0, 1, 2
"""Phases.  WATCHING: the first g > h stops a run.  PENDING: a change was detected and its cause is not known.
REFINING: the cause is known and its size becomes more certain.  In the last two the WAIT-th tested sample from now
stops a run."""


class Memory(NamedTuple):
    """State of the multi-model detector of one axis."""

    x: Floats  # (n, H) at the last sample, after its correction
    u: Floats  # (m, H) inputs held since
    sums: Floats  # (3, H) g; decrease of its path since the last mark; evidence in addition to g
    when: NDArray[np.int64]  # (2 + MARKS, H) us: g last 0; g last below SURE; marks, the latest first
    numbers: (
        Floats  # (4, 1) torque of the sample before the last, of the last; last output; credit of outliers
    )
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


@kernel
def _request_stop(crossed: bool, integers: Ints) -> None:
    """Set WAIT to 0 where the run must stop for a decision."""
    if integers[PHASE, 0] == WATCHING:
        integers[WAIT, 0] = 0 if crossed else 1
    else:
        integers[WAIT, 0] = max(integers[WAIT, 0] - 1, 0)


@kernel
def _tally(mode: int, counts: Ints) -> None:
    counts[USED, 0] += mode == TRACK
    counts[SETTLING, 0] += mode == SETTLE
    counts[GATED, 0] += mode == CLOSED
    counts[OUTLIER_COUNT, 0] += mode == DOUBTED


@outlined
def _record(k: int, moved: bool, tested: bool, eps: Floats, llr: Floats, sums: Floats, to: BankTrace) -> None:
    for a in range(to.g.shape[1]):
        to.eps[k, a] = eps[a] if moved else math.nan
        to.llr[k, a] = llr[a] if tested else math.nan
        to.g[k, a] = sums[G, a]


@entry
def run_hypotheses(
    lanes: Any, T: Tables, P: Predictors, M: Memory, block: Block, start: int, trace: BankTrace
) -> int:
    """Run samples from ``start`` on until a decision is due; returns the number of samples taken.

    ``lanes``: an array of H numbers.
    """
    lane = (0,)
    n, m, H = T.n, T.m, len(lanes)
    x, u, own, axis = M.x, M.u, P.own, P.axis
    acting = table(m, H)
    X, flat_u, new = x.reshape(x.size), acting.reshape(acting.size), floats(n * H)
    psi, before, motion = table(0, H), floats(H), floats(H)
    over, yhat, eps, llr, K = floats(H), floats(H), floats(H), floats(H), table(n, H)
    late, weight = floats(H), floats(H)
    # These arrays are computed later in each sample; until then they serve as scratch.
    middle = MiddleSpeed(table(m, H), yhat, eps, llr, motion, psi, psi, psi)
    doing, last = ints(H), ints(H)
    t, ut, y, mode, h, lam = ints(1), floats(1), floats(1), ints(1), floats(1), floats(1)
    moves, learns, tracks, seed_left = ints(1), ints(1), ints(1), ints(1)
    e0, believed, S = floats(1), floats(1), floats(1)
    untracked = floats(1)  # no running variance: the limit is that of the records
    numbers, integers = M.numbers, M.integers
    counts = integers[COUNTS:]
    timing = Timing(axis[GAP], axis[SETTLES], axis[INTERVAL], axis[LOST])
    limits = OutlierConstants(axis[OUTLIER], axis[OUTLIER_LEAST], axis[OUTLIER_CREDIT])
    roles = Roles(mode, moves, learns, tracks)
    shortest, back = int(axis[SHORTEST, 0]), int(axis[BACK, 0])
    turns = has_gain(P.K) and has_gain(P.rigid)
    gains, most = has_gain(P.K), FARTHEST * math.sqrt(axis[LAM0, 0])
    # fmt: off
    for k in range(start, block.t.size):
        t[0], ut[0], y[0], mode[0] = block.t[k], block.u[k], block.y[k], TRACK
        classify_sample(lane, t, ut, y, timing, integers[LAST], integers[SETTLED], seed_left, counts, mode, h)
        if block.gate.shape[0]:
            close_gate(lane, k, 0, block.gate, mode)
        tested = False
        if mode[0] >= SETTLE:
            for a in range(H):
                over[a] = h[0]
            torque = Torques(numbers[TORQUE_BEFORE, 0], numbers[TORQUE_HELD, 0], ut[0])
            if P.moving.size:
                copy_rows(u, acting)
            if P.moving.size and T.friction.number:
                torques_in_turn(lanes, T.kind, own, h[0], torque, before, late, acting)
                hold_friction(lanes, T.friction, T.kind, P.u_scale, P.V0, late, before, over, x, acting, None,
                              middle)
            usual = t[0] - integers[LAST, 0] - shortest
            if 0 <= usual < USUAL:
                propagate_usual(n, usual, P.terms, P.moving, torque, flat_u, X, new)
                K_now = P.usual_K[usual * n : (usual + 1) * n]
            else:
                propagate_interval(lanes, T, P, h[0], torque, acting, x, over, K)
                K_now = K
            predict(lanes, T.outputs, P.V0, x, yhat, psi)
            if T.mean >= 0:
                divide_by_interval(lanes, over, yhat, psi)
                for a in range(H):
                    doing[a] = 1
                restart_integral(lanes, T.mean, n, doing, x)
            beyond = prediction_errors(lanes, own, y[0], numbers[LAST_OUTPUT, 0], yhat, most, eps)
            if beyond > 0 and not restart_diverged(most, eps, x):
                counts[DIVERGED, 0] += 1
                integers[LAST, 0] = NEVER
                mode[0] = SKIP
                for e in range(X.size):
                    X[e] = 0.0
            else:
                moves[0], learns[0], tracks[0] = 1, mode[0] == TRACK, mode[0] == TRACK
                lam[0] = S[0] = axis[LAM, 0]
                e0[0] = eps[0]
                reject_outliers(lane, limits, lam, untracked, e0, S, numbers[CREDIT], integers[IN_A_ROW], roles,
                                believed)
                check_start(lane, axis[SETTLES], axis[INTERVAL], t, integers[SETTLED], integers[IN_A_ROW], counts,
                            mode)
                first = is_first(t[0], integers[SETTLED, 0], axis[SETTLES, 0], h[0])
                if turns and first and mode[0] == SETTLE:
                    integers[IN_A_ROW, 0] = 0
                    correct_speed(lanes, P.rest, P.rigid, own, h[0], eps, x)
                elif moves[0] and gains:
                    correct(lanes, K_now, eps, x)
                if tracks[0]:
                    tested = True
                    log_likelihood_ratios(lanes, own, back, ut[0] != numbers[TORQUE_HELD, 0],
                                          y[0] != numbers[LAST_OUTPUT, 0], eps, llr)
                    crossed = update_sums(lanes, own, t[0], integers[PHASE, 0] == WATCHING, llr, M.sums, M.when)
                    _request_stop(crossed, integers)
        if mode[0] == RESTART:
            for a in range(H):
                motion[a] = (y[0] - own[OFFSET, a]) / own[SCALE, a]
                doing[a] = RESTART
            restart_predictor(lanes, doing, P.rest, motion, x)
            restart_paths(t[0], M.when)
            numbers[TORQUE_HELD, 0] = ut[0]
        if mode[0] != SKIP:
            if P.moving.size:
                for a in range(H):
                    motion[a] = (y[0] - own[OFFSET, a]) / own[SCALE, a]
                    doing[a] = TRACK
                    weight[a] = block.weight[k] if block.weight.size else math.nan
                hold_inputs(lanes, T, P.u_scale, P.rest, last, motion, motion, weight, doing, last, u, before)
            integers[LAST, 0] = t[0]
            numbers[TORQUE_BEFORE, 0] = numbers[TORQUE_HELD, 0]
            numbers[TORQUE_HELD, 0], numbers[LAST_OUTPUT, 0] = ut[0], y[0]
        _tally(mode[0], counts)
        if trace.g.shape[0]:
            _record(k, mode[0] >= SETTLE, tested, eps, llr, M.sums, trace)
        if tested and integers[WAIT, 0] == 0:
            return k + 1
    # fmt: on
    return block.t.size
