"""Runs a block of samples of a batch of axes through the recursion: the entry point of the kernel."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import (
    SETTLE,
    SKIP,
    TRACK,
    Roles,
    Timing,
    classify_sample,
    close_gate,
    follow_conditions,
    follow_first,
    gain_of_speed,
    hold_inputs,
    restart_predictor,
)
from monitor_core.kernel.compile import compile_part, entry, kernel, outlined
from monitor_core.kernel.cusum import Events
from monitor_core.kernel.evidence import EvidenceColumns, Kept, count_until_kept
from monitor_core.kernel.friction import MiddleSpeed, hold_friction
from monitor_core.kernel.llvm_vectors import EIGHT
from monitor_core.kernel.propagate import choose_substeps, evaluate_coefficients, evaluate_inputs, propagate
from monitor_core.kernel.recursion import correct, gain, predict, propagate_joint
from monitor_core.kernel.sample_interval import (
    divide_by_interval,
    interval_gain,
    mark_sampled,
    restart_integral,
    split_at_delay,
    split_at_mean,
    switch_torque,
    time_since_correction,
)
from monitor_core.kernel.state import (
    State,
    constant_views,
    kernel_constant_views,
    kernel_state_views,
    state_views,
)
from monitor_core.kernel.tables import Product, Tables
from monitor_core.kernel.taylor_series import SECTIONS
from monitor_core.kernel.update import Work, update_estimates, update_tests
from monitor_core.kernel.work_arrays import (
    any_positive,
    copy_rows,
    flags,
    floats,
    ints,
    largest,
    put_columns,
    strided_product,
    table,
    take_columns,
)


class BatchSamples(NamedTuple):
    """Samples of all axes, axis last; axis a has number[a] samples, in the order of their receipt."""

    t: NDArray[np.int64]  # (N, W) time, us
    u: Floats  # (N, W) motor torque, N m
    y: Floats  # (N, W) motor speed or its mean over the interval before, rad/s, or motor angle, rad
    number: NDArray[np.int64]  # (W,)
    shift: Floats  # (N, p, W) theta_0(s) - theta_0; (0, p, W): unchanged
    gate: NDArray[np.bool_]  # (N, W) whether theta may be updated; (0, W): always
    weight: Floats  # (N, W) torque of the weight, N m; NaN, or (0, W): the last value


class Trace(NamedTuple):
    """Values of the recursion at each sample; arrays of length 0 if no trace is wanted.

    eps NaN: no update.  yhat NaN: no prediction.

    Entries beyond the samples of an axis have no meaning.
    """

    eps: Floats  # (N, W)
    yhat: Floats  # (N, W) prediction of y, also for samples that do not update theta
    psi: Floats  # (N, p, W)
    theta: Floats  # (N, p, W)
    P: Floats  # (N, p, W) diagonal
    g: Floats  # (N, 2, p, W) after the restart at an alarm
    shift: Floats  # (N, p, W) theta_0(s) - theta_0
    mode: Floats  # (N, W) use of the sample: TRACK, GATED .. of kernel.admission
    observed: Floats  # (N, p, W) OBSERVED, WEAK, UNSEEN


@kernel
def _take(
    lanes: Any,
    k: int,
    a0: int,
    samples: BatchSamples,
    t: Ints,
    u: Floats,
    y: Floats,
    weight: Floats,
    roles: Roles,
) -> None:
    """Take sample k of each lane; a lane without a sample k skips."""
    mode, learns, number = roles.mode, roles.learns, samples.number
    for a in range(len(lanes)):
        mode[a] = SKIP
        learns[a] = 0
    for a in range(min(len(lanes), number.size - a0)):
        t[a], u[a], y[a] = samples.t[k, a0 + a], samples.u[k, a0 + a], samples.y[k, a0 + a]
        mode[a] = TRACK if k < number[a0 + a] else SKIP
        weight[a] = samples.weight[k, a0 + a] if samples.weight.shape[0] else math.nan


@outlined
def _record(lanes: Any, k: int, a0: int, w: Work, st: State, to: Trace) -> None:
    theta, P, g = st.theta, st.P, st.g
    for a in range(min(len(lanes), to.eps.shape[1] - a0)):
        b = a0 + a
        to.eps[k, b] = w.eps[a] if w.roles.learns[a] else math.nan
        to.yhat[k, b] = w.yhat[a] if w.roles.mode[a] >= SETTLE else math.nan
        to.mode[k, b] = w.roles.mode[a]
        for i in range(theta.shape[0]):
            to.psi[k, i, b] = w.psi[i, a]
            to.theta[k, i, b] = theta[i, a]
            to.P[k, i, b] = P[i, i, a]
            to.g[k, 0, i, b] = g[0, i, a]
            to.g[k, 1, i, b] = g[1, i, a]
            to.shift[k, i, b] = st.shift[i, a]
            to.observed[k, i, b] = st.observed[i, a]


class Propagation(NamedTuple):
    """Arrays of the propagation from one sample to the next, and of its inputs; X also as a flat view."""

    X: Floats  # (p n + n, W) z and x
    G: Floats  # (p n + n, W) contribution of the inputs
    V: Floats  # (slots + 1, W) entries of A, B, C and their derivatives
    X_flat: Floats
    G_flat: Floats
    V_flat: Floats
    work: Floats
    more: Floats
    K: Floats  # (n, W) filter gain
    u: Floats  # (W,) torque
    u_first: Floats  # (m, W) inputs before the delay
    acting: Floats  # (m, W) inputs
    du: Floats  # (p, m, W) their derivatives
    weight: Floats  # (W,) torque of the weight
    steps: Ints  # (W,) substeps
    terms: Ints  # (W,) terms of the series
    norm: Floats  # (W,)
    middle: MiddleSpeed


class Intervals(NamedTuple):
    """Parts of the interval before a sample, (W,) each."""

    h: Floats  # s
    first: Floats  # until the delayed torque changes, s
    before: Floats  # before the mean begins, s
    over: Floats  # of the mean, s
    ago: Floats  # since the last correction
    lost: Ints  # whether the mean is lost
    is_first: Ints  # whether it is the first sample after settling


@entry
def run(
    lanes: Any,
    tables: Tables,
    C: Floats,
    F: Floats,
    I: Ints,
    kept_t: Ints,
    kept_d: Floats,
    samples: BatchSamples,
    reset: bool,
    events: Events,
    noted: EvidenceColumns,
    trace: Trace,
) -> None:
    """Run a block of samples through a batch with constants C and state F, I, ``len(lanes)`` axes at a time.

    ``kept_t`` and ``kept_d``: fields of ``Kept``, a part of the state that is rarely used.

    ``lanes``: an array of a multiple of eight, or (0,); the branch for the other shape is not compiled.

    Lanes beyond the last axis repeat it without samples; their results are discarded.
    """
    T, z, kept = tables, tables.p * tables.n, Kept(kept_t, kept_d)
    W = 0 + len(lanes)  # not the literal 1: numba would compile functions with this argument again
    n, p, wide = T.n, T.p, 1 if len(lanes) == 1 else EIGHT
    F_X = T.product if len(lanes) == 1 else strided_product(T.product, p, wide, W)
    for a0 in range(0, F.shape[1], W):
        # The arrays are created here and not passed in, so that the compiler knows that they do not overlap.
        C_, F_, I_ = take_columns(C, a0, W), take_columns(F, a0, W), take_columns(I, a0, W)
        roles = Roles(ints(W), ints(W), ints(W), ints(W))
        w = Work(roles, ints(W), floats(W), floats(W), floats(W), floats(W), floats(W), floats(W),
                 table(p, W), table(p, W), table(p, W), table(p, W), table(p, W), ints(W), ints(W), ints(W),
                 flags(p, W), (table(p, p), table(p, p), table(p, p)))  # fmt: skip
        # These arrays are computed later in each sample; until then they serve as scratch.
        middle = MiddleSpeed(table(T.m, W), w.yhat, w.eps, w.S, w.believed, w.psi, w.Ppsi, w.moved)
        X, G, V = table(z + n, W), table(z + n, W), table(T.slots + 1, W)
        x = Propagation(X, G, V, X.reshape(X.size), G.reshape(G.size), V.reshape(V.size),
                        floats(SECTIONS * n * T.product.blocks * wide), floats(max(T.product.more_slot.size, 4 * wide)),
                        table(n, W), floats(W), table(T.m, W), table(T.m, W), table(p * T.m, W).reshape(p, T.m, W),
                        floats(W), ints(W), ints(W), floats(W), middle)  # fmt: skip
        i = Intervals(floats(W), floats(W), floats(W), floats(W), floats(W), ints(W), ints(W))
        _run_samples(lanes, T, F_X, C_, F_, I_, samples, a0, w, x, i, reset, kept, events, noted, trace)
        put_columns(F_, F, a0)
        put_columns(I_, I, a0)


@kernel
def _run_samples(
    lanes: Any,
    T: Tables,
    F_X: Product,
    C: Floats,
    F: Floats,
    I: Ints,
    samples: BatchSamples,
    a0: int,
    w: Work,
    x: Propagation,
    i: Intervals,
    reset: bool,
    kept: Kept,
    events: Events,
    noted: EvidenceColumns,
    trace: Trace,
) -> None:
    """The samples of some lanes, one after the other: one line for each step of the recursion.

    C, F, I: constants and state of these lanes only.  This is a separate function so that it need not count references
    to arrays, which would double the code of ``run``.
    """
    con, st, z = kernel_constant_views(C, T), kernel_state_views(F, I, T.n, T.p, T.m), T.p * T.n
    roles, t, y, yhat, eps, S, lam, psi = w.roles, w.t, w.y, w.yhat, w.eps, w.S, w.lam, w.psi
    X, G, V, X_, G_, V_, mode, theta = x.X, x.G, x.V, x.X_flat, x.G_flat, x.V_flat, w.roles.mode, st.theta
    K, acting, du, steps, terms, norm, h = x.K, x.acting, x.du, x.steps, x.terms, x.norm, i.h
    timing = Timing(con.gap_us, con.settle_us, con.interval, con.lost_us)
    joint = any_positive(con.joint)
    delay = theta[T.late] if T.late >= 0 else con.delay
    count_until_kept(lanes, con.span, st.learned, w.until)
    copy_rows(con.V0, V)
    copy_rows(st.z, X)
    copy_rows(st.x, X[z:])
    # fmt: off
    for k in range(largest(samples.number, a0, len(lanes))):
        _take(lanes, k, a0, samples, t, x.u, y, x.weight, roles)
        moving = classify_sample(lanes, t, x.u, y, timing, st.t, st.settled, st.seed_left, st.counts, mode, h)
        if samples.shift.shape[0]:
            follow_conditions(lanes, k, a0, samples.shift, con.lower, con.upper, st.shift, theta, st.theta_seen, mode)
        if samples.gate.shape[0]:
            close_gate(lanes, k, a0, samples.gate, mode)
        if moving:
            time_since_correction(lanes, con.interval, h, st.in_a_row, i.ago)
            interval_gain(lanes, con.interval, con.lam, con.K, h, i.ago, lam, K)
            gain_of_speed(lanes, timing, con.rest, con.rigid, t, st.settled, h, mode, i.is_first, K)
            evaluate_coefficients(lanes, T.terms, con.V0, con.coef, theta, V)
            copy_rows(st.u, acting)
            if T.friction.number:
                hold_friction(lanes, T.friction, T.kind, con.u_scale, V, delay, st.torque_before, h, X, acting, du,
                              x.middle)
            if split_at_delay(lanes, T.kind, delay, st.torque_before, acting, h, i.first, x.u_first):
                evaluate_inputs(lanes, T.inputs, V, x.u_first, du, G)
                choose_substeps(lanes, T.A_row, con.weight, V, i.first, steps, terms, norm)
                propagate(lanes, F_X, V_, G_, i.first, steps, terms, X_, x.work, x.more)
            if T.late >= 0:
                switch_torque(lanes, T.inputs, T.kind, T.late, T.p, V, delay, x.u_first, acting, i.first, h, X)
            evaluate_inputs(lanes, T.inputs, V, acting, du, G)
            if T.mean >= 0 and split_at_mean(lanes, con.interval, i.first, h, i.before, i.over, i.lost):
                choose_substeps(lanes, T.A_row, con.weight, V, i.before, steps, terms, norm)
                propagate(lanes, F_X, V_, G_, i.before, steps, terms, X_, x.work, x.more)
                restart_integral(lanes, T.mean, T.n, i.lost, X)
            choose_substeps(lanes, T.A_row, con.weight, V, h, steps, terms, norm)
            propagate(lanes, F_X, V_, G_, h, steps, terms, X_, x.work, x.more)
            predict(lanes, T.outputs, V, X, yhat, psi)
            if T.mean >= 0:
                divide_by_interval(lanes, i.over, yhat, psi)
            gain(lanes, lam, st.P, psi, w.Ppsi, S)
            update_estimates(lanes, con, st, w, X)
            follow_first(lanes, i.is_first, roles.moves, st.in_a_row)
            correct(lanes, K, X, eps, psi, roles.moves)
            if joint:
                propagate_joint(lanes, con.joint, X, w.moved)
            if T.mean >= 0:
                mark_sampled(lanes, mode, i.lost)
                restart_integral(lanes, T.mean, T.n, i.lost, X)
            update_tests(lanes, con, st, w, a0, reset, kept, events, noted)
        restart_predictor(lanes, mode, con.rest, y, X)
        hold_inputs(lanes, T, con.u_scale, con.rest, t, x.u, y, x.weight, mode, st.t, st.u, st.torque_before)
        if trace.eps.size:
            _record(lanes, k, a0, w, st, trace)
    # fmt: on
    copy_rows(X[:z], st.z)
    copy_rows(X[z:], st.x)


def compile_parts(
    lanes: Any,
    tables: Tables,
    C: Floats,
    F: Floats,
    I: Ints,
    kept: Kept,
    reset: bool,
    events: Events,
    noted: EvidenceColumns,
) -> None:
    """Compile the parts of ``run`` that are cached separately, or load them from the cache.

    On a cold start a second process does this while the first compiles the beginning of ``run``.
    """
    T, n, p, W = tables, tables.n, tables.p, len(lanes)
    con, st = constant_views(C[:, :W].copy(), T), state_views(F[:, :W].copy(), I[:, :W].copy(), n, p, T.m)
    x, xs, N = np.zeros(W), np.zeros((p, W)), np.zeros((p, p))
    k, ks = np.zeros(W, np.int64), np.zeros((p, W), np.int64)
    w = Work(Roles(k, k, k, k), k, x, x, x, x, x, x, xs, xs, xs, xs, xs, k, k, k, ks, (N, N, N))
    compile_part(propagate, lanes, T.product, x, x, x, k, k, x, x, x)
    compile_part(update_estimates, lanes, con, st, w, xs)
    compile_part(update_tests, lanes, con, st, w, 0, reset, kept, events, noted)
    compile_part(hold_inputs, lanes, T, con.u_scale, con.rest, k, x, x, x, k, st.t, st.u, st.torque_before)
