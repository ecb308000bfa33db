"""A block of samples of a batch of axes through the recursion: the entry point of the kernel."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import (
    DOUBTED,
    GATED,
    IDLE,
    SEED,
    SETTLE,
    SKIP,
    TRACK,
    classify_sample,
    close_gate,
    follow_conditions,
    form_innovation,
    hold_inputs,
    restart_predictor,
)
from monitor_core.kernel.compile import entry, kernel, outlined
from monitor_core.kernel.cusum import (
    Events,
    compute_deviations,
    note_crossings,
    note_recoveries,
    update_cusum,
)
from monitor_core.kernel.evidence import EvidenceColumns, gather_evidence, samples_until_kept
from monitor_core.kernel.llvm_vectors import EIGHT
from monitor_core.kernel.outliers import check_start, reject_outliers, update_running_variance
from monitor_core.kernel.propagate import choose_substeps, evaluate_coefficients, evaluate_inputs, propagate
from monitor_core.kernel.recursion import (
    correct,
    drift_P,
    find_P0,
    gain,
    predict,
    propagate_joint,
    update_P,
    update_theta,
)
from monitor_core.kernel.sample_interval import (
    divide_by_interval,
    interval_gain,
    mark_sampled,
    random_walk,
    restart_integral,
    split_at_delay,
    split_at_mean,
    switch_torque,
    time_since_correction,
)
from monitor_core.kernel.state import GATED as GATED_COUNT
from monitor_core.kernel.state import (
    OUTLIER,
    PROJECTED,
    SEEDING,
    SETTLING,
    STARVED,
    USED,
    kernel_constant_views,
    kernel_state_views,
)
from monitor_core.kernel.supervision import apply_information_floor, check_excitation, select_tests
from monitor_core.kernel.tables import Tables
from monitor_core.kernel.taylor_series import SECTIONS
from monitor_core.kernel.work_arrays import (
    copy_rows,
    flags,
    floats,
    ints,
    largest,
    put_columns,
    strided,
    table,
    take_columns,
)


class BatchSamples(NamedTuple):
    """Samples of all axes, axis last; axis a has number[a] samples, in the order of their receipt."""

    t: NDArray[np.int64]  # (N, W) time, us
    u: Floats  # (N, W) motor torque, N m
    y: Floats  # (N, W) motor speed or its mean over the interval before, rad/s, or motor angle, rad
    number: NDArray[np.int64]  # (W,)
    shift: Floats  # (N, p, W) theta_0(s) - theta_0; (0, p, W): as before
    gate: NDArray[np.bool_]  # (N, W) whether to learn; (0, W): always


class Trace(NamedTuple):
    """Values of the recursion at each sample; arrays of length 0 where no trace is wanted.  eps NaN: no update.

    Entries beyond the samples of an axis have no meaning.
    """

    eps: Floats  # (N, W)
    psi: Floats  # (N, p, W)
    theta: Floats  # (N, p, W)
    P: Floats  # (N, p, W) diagonal
    g: Floats  # (N, 2, p, W) after an alarm: where it starts again
    shift: Floats  # (N, p, W) theta_0(s) - theta_0
    mode: Floats  # (N, W) what became of the sample, of kernel.admission: TRACK, GATED ..
    observed: Floats  # (N, p, W) OBSERVED, WEAK, UNSEEN


@kernel
def _take(
    lanes: Any,
    k: int,
    a0: int,
    s_t: Ints,
    s_u: Floats,
    s_y: Floats,
    number: Ints,
    t: Ints,
    u: Floats,
    y: Floats,
    mode: Ints,
    learns: Ints,
) -> None:
    """The samples k of the lanes; a lane without a sample k skips."""
    for a in range(len(lanes)):
        mode[a] = SKIP
        learns[a] = 0
    for a in range(min(len(lanes), number.size - a0)):
        t[a], u[a], y[a] = s_t[k, a0 + a], s_u[k, a0 + a], s_y[k, a0 + a]
        mode[a] = TRACK if k < number[a0 + a] else SKIP


@kernel
def _tally(lanes: Any, mode: Ints, hit: Ints, counts: Ints) -> None:
    for a in range(len(lanes)):
        counts[USED, a] += mode[a] == TRACK
        counts[SEEDING, a] += mode[a] == SEED
        counts[SETTLING, a] += mode[a] == SETTLE
        counts[GATED_COUNT, a] += mode[a] == GATED
        counts[OUTLIER, a] += mode[a] == DOUBTED
        counts[STARVED, a] += mode[a] == IDLE
        counts[PROJECTED, a] += hit[a]


@outlined
def _record(
    lanes: Any,
    k: int,
    a0: int,
    learns: Ints,
    eps: Floats,
    psi: Floats,
    theta: Floats,
    P: Floats,
    g: Floats,
    shift: Floats,
    mode: Ints,
    observed: Ints,
    to_eps: Floats,
    to_psi: Floats,
    to_theta: Floats,
    to_P: Floats,
    to_g: Floats,
    to_shift: Floats,
    to_mode: Floats,
    to_observed: Floats,
) -> None:
    for a in range(min(len(lanes), to_eps.shape[1] - a0)):
        b = a0 + a
        to_eps[k, b] = eps[a] if learns[a] else math.nan
        to_mode[k, b] = mode[a]
        for i in range(theta.shape[0]):
            to_psi[k, i, b] = psi[i, a]
            to_theta[k, i, b] = theta[i, a]
            to_P[k, i, b] = P[i, i, a]
            to_g[k, 0, i, b] = g[0, i, a]
            to_g[k, 1, i, b] = g[1, i, a]
            to_shift[k, i, b] = shift[i, a]
            to_observed[k, i, b] = observed[i, a]


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

    ``kept_t`` (KEPT, axes) and ``kept_d`` (KEPT kept_numbers, axes) are state, too, but are seldom used.

    ``lanes``: an array of a multiple of eight, or (0,); the branch for the other shape is not compiled.

    Lanes beyond the last axis repeat it without samples; their results are discarded.
    """
    T, tr, W, z = tables, trace, len(lanes), tables.p * tables.n
    filled, what, value = events.filled, events.what, events.value
    # Local names: each call that gets a field of a tuple counts a reference to it, atomically.
    A_row, A_start, more_start, more_slot, part_start = (
        T.A_row,
        T.A_start,
        T.more_start,
        T.more_slot,
        T.part_start,
    )
    in_row, in_slot, in_col, in_par, kind = T.in_row, T.in_slot, T.in_col, T.in_par, T.kind
    out_slot, out_src, out_par = T.out_slot, T.out_src, T.out_par
    term_slot, factor_start, factor_par, factor_exp = T.term_slot, T.factor_start, T.factor_par, T.factor_exp
    for a0 in range(0, F.shape[1], W):
        C_, F_, I_ = take_columns(C, a0, W), take_columns(F, a0, W), take_columns(I, a0, W)
        con, st = kernel_constant_views(C_, T), kernel_state_views(F_, I_, T.n, T.p, T.m)
        X, G, V = table(z + T.n, W), table(z + T.n, W), table(T.slots + 1, W)
        X_, G_, V_ = X.reshape(X.size), G.reshape(G.size), V.reshape(V.size)
        wide = 1 if W == 1 else EIGHT
        work, more = floats(SECTIONS * T.n * T.blocks * wide), floats(max(T.more_slot.size, 4 * wide))
        at_A, at_more, at_part = strided(T.A_at, wide), strided(T.more_col, wide), strided(T.part_col, wide)
        place, part_slot = strided(T.part_place, wide), strided(T.part_slot, W)
        psi, Ppsi, d, nu, u_first = table(T.p, W), table(T.p, W), table(T.p, W), table(T.p, W), table(T.m, W)
        u, y, h, h_first = floats(W), floats(W), floats(W), floats(W)
        h_before, over, ago, lost = floats(W), floats(W), floats(W), ints(W)
        lam, K = floats(W), table(T.n, W)
        yhat, eps, believed, S = floats(W), floats(W), floats(W), floats(W)
        N, L, Y, tests = table(T.p, T.p), table(T.p, T.p), table(T.p, T.p), flags(T.p, W)
        t, mode, steps, terms = ints(W), ints(W), ints(W), ints(W)
        moves, learns, tracks, hit, fit = ints(W), ints(W), ints(W), ints(W), ints(W)
        moved, joint = table(T.p, W), con.joint.max() > 0.0
        share, drift = floats(W), con.drift.max() > 0.0
        V0, coef, weight, theta, P = con.V0, con.coef, con.weight, st.theta, st.P
        norm = floats(W)
        delay = theta[T.late] if T.late >= 0 else con.delay
        until = samples_until_kept(lanes, con.span, st.learned)
        copy_rows(V0, V, 0)
        copy_rows(st.z, X, 0)
        copy_rows(st.x, X, z)
        # One line for each step of the recursion.
        # fmt: off
        for k in range(largest(samples.number, a0, W)):
            _take(lanes, k, a0, samples.t, samples.u, samples.y, samples.number, t, u, y, mode, learns)
            moving = classify_sample(lanes, t, u, y, con.gap_us, con.settle_us, con.interval, con.lost_us, st.t,
                                     st.settled, st.seed_left, st.counts, mode, h)
            if samples.shift.shape[0]:
                follow_conditions(lanes, k, a0, samples.shift, con.lower, con.upper, st.shift, theta, st.theta_seen,
                                  mode)
            if samples.gate.shape[0]:
                close_gate(lanes, k, a0, samples.gate, mode)
            if moving:
                time_since_correction(lanes, con.interval, h, st.in_a_row, ago)
                interval_gain(lanes, con.interval, con.lam, con.K, h, ago, lam, K)
                if drift:
                    random_walk(lanes, con.drift, st.seed_left, lam, share)
                evaluate_coefficients(lanes, term_slot, factor_start, factor_par, factor_exp, V0, coef, theta, V)
                if split_at_delay(lanes, kind, delay, st.torque_before, st.u, h, h_first, u_first):
                    evaluate_inputs(lanes, in_row, in_slot, in_col, in_par, V, u_first, st.du, G)
                    choose_substeps(lanes, A_row, weight, V, h_first, steps, terms, norm)
                    propagate(lanes, T.n, T.p, T.blocks, A_start, at_A, more_start, at_more, more_slot, part_start,
                              place, at_part, part_slot, V_, G_, h_first, steps, terms, X_, work, more)
                if T.late >= 0:
                    switch_torque(lanes, in_row, in_slot, in_col, kind, T.late, T.p, V, delay, u_first, st.u, h_first,
                                  h, X)
                evaluate_inputs(lanes, in_row, in_slot, in_col, in_par, V, st.u, st.du, G)
                if T.mean >= 0 and split_at_mean(lanes, con.interval, h_first, h, h_before, over, lost):
                    choose_substeps(lanes, A_row, weight, V, h_before, steps, terms, norm)
                    propagate(lanes, T.n, T.p, T.blocks, A_start, at_A, more_start, at_more, more_slot, part_start,
                              place, at_part, part_slot, V_, G_, h_before, steps, terms, X_, work, more)
                    restart_integral(lanes, T.mean, T.n, lost, X)
                choose_substeps(lanes, A_row, weight, V, h, steps, terms, norm)
                propagate(lanes, T.n, T.p, T.blocks, A_start, at_A, more_start, at_more, more_slot, part_start, place,
                          at_part, part_slot, V_, G_, h, steps, terms, X_, work, more)
                predict(lanes, out_slot, out_src, out_par, V, X, yhat, psi)
                if T.mean >= 0:
                    divide_by_interval(lanes, over, yhat, psi)
                gain(lanes, lam, P, psi, Ppsi, S)
                check_excitation(lanes, lam, con.lam, con.min_excitation, S, st.excitation, mode, st.unobserved,
                                 st.observed)
                form_innovation(lanes, y, yhat, S, st.t, st.counts, mode, moves, learns, tracks, eps, X)
                reject_outliers(lanes, con.outlier, lam, st.lam0_running, eps, S, st.credit, st.in_a_row, mode, moves,
                                learns, tracks, believed)
                check_start(lanes, con.settle_us, con.interval, t, st.settled, st.in_a_row, st.counts, mode)
                update_theta(lanes, con.lower, con.upper, theta, st.observed, believed, Ppsi, S, tracks, hit, moved)
                update_P(lanes, lam, P, Ppsi, S, learns, fit)
                if drift:
                    drift_P(lanes, share, st.P_nom, P, fit)
                find_P0(lanes, con.min_excitation, con.P_uninformed, con.seed, st.seed_left, st.P_nom, P, mode)
                apply_information_floor(lanes, con.floor, con.min_excitation, con.span, con.lam, con.drift, st.P_nom,
                                        tracks, st.since, st.unobserved, st.observed, con.scale, P, N, L, Y)
                select_tests(lanes, con.tested, st.observed, theta, tracks, st.theta_seen, tests)
                update_running_variance(lanes, lam, con.lam_slow, st.lam0_running, eps, S, mode)
                correct(lanes, K, X, eps, psi, moves)
                if joint:
                    propagate_joint(lanes, con.joint, X, moved)
                if T.mean >= 0:
                    mark_sampled(lanes, mode, lost)
                    restart_integral(lanes, T.mean, T.n, lost, X)
                _tally(lanes, mode, hit, st.counts)
                compute_deviations(lanes, con.theta0, st.shift, con.alpha1, con.allowance, con.lam0, theta, P, d, nu)
                if update_cusum(lanes, con.h, t, st.g, st.onset, st.below_nu, d, nu, tests):
                    note_crossings(lanes, con.h, t, st.g, st.onset, d, con.widen, st.P_nom, P, tests, a0, reset,
                                   con.recovery_samples, st.left, st.noting, filled, what, value)
                gather_evidence(lanes, con.recovery_samples, con.span, t, st.left, until, st.noting, st.learned,
                                st.below_nu, st.lam0_running, theta, d, P, st.observed, tracks, a0, kept_t, kept_d,
                                filled, noted)
                note_recoveries(lanes, con.recovery_samples, t, st.below_nu, d, P, tests, a0, filled, what, value)
            restart_predictor(lanes, mode, con.rest, y, X)
            hold_inputs(lanes, kind, T.speed_state, T.filtered_speed, con.u_scale, t, u, y, mode, X, st.t, st.u, st.du,
                        st.torque_before)
            if tr.eps.size:
                _record(lanes, k, a0, learns, eps, psi, theta, P, st.g, st.shift, mode, st.observed, tr.eps, tr.psi,
                        tr.theta, tr.P, tr.g, tr.shift, tr.mode, tr.observed)
        # fmt: on
        copy_rows(X[:z], st.z, 0)
        copy_rows(X[z:], st.x, 0)
        put_columns(F_, F, a0)
        put_columns(I_, I, a0)
