"""A block of samples of a bank of axes through the recursion: the one entry into the kernel."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor_core.kernel import state as st_
from monitor_core.kernel.cusum import Events, cusum
from monitor_core.kernel.laurent import evaluate
from monitor_core.kernel.propagate import propagate, split
from monitor_core.kernel.recursion import (
    correct,
    find_P0,
    gain,
    predict,
    running_variance,
    update_P,
    update_theta,
)
from monitor_core.kernel.state import NEVER, State, constant_views, state_views
from monitor_core.kernel.tables import COULOMB, ONE, Constants, Floats, Ints, Tables


class Samples(NamedTuple):
    """Samples of all axes, axis last; axis a has count[a] samples, in the order of their receipt."""

    t: NDArray[np.int64]  # (N, W) time, us
    u: Floats  # (N, W) motor torque, N m
    y: Floats  # (N, W) motor speed, rad/s, or motor angle, rad
    count: NDArray[np.int64]  # (W,)


class Trace(NamedTuple):
    """What the recursion did at each sample; arrays of length 0 where it is not wanted.  NaN: no update."""

    eps: Floats  # (N, W)
    psi: Floats  # (N, p, W)
    theta: Floats  # (N, p, W)
    P: Floats  # (N, p, W) diagonal
    g: Floats  # (N, 2, p, W)


class _Scratch(NamedTuple):
    V: Floats
    term: Floats
    X: Floats
    t: Floats
    t_next: Floats
    scale: Floats
    steps: Ints
    order: Ints
    u: Floats
    h: Floats
    h_first: Floats
    yhat: Floats
    eps: Floats
    psi: Floats
    Ppsi: Floats
    S: Floats
    moves: Ints
    learns: Ints
    seeds: Ints
    watches: Ints
    hit: Ints


@njit(cache=True, nogil=True)
def _scratch(tables: Tables, con: Constants, W: int) -> _Scratch:
    n, p, m = tables.n, tables.p, tables.m
    return _Scratch(
        con.V0.copy(),
        np.zeros(W),
        np.zeros((p + 1, n, W)),
        np.zeros((p + 1, n, W)),
        np.zeros((p + 1, n, W)),
        np.zeros(W),
        np.zeros(W, np.int64),
        np.zeros(W, np.int64),
        np.zeros((m, W)),
        np.zeros(W),
        np.zeros(W),
        np.zeros(W),
        np.zeros(W),
        np.zeros((p, W)),
        np.zeros((p, W)),
        np.zeros(W),
        np.zeros(W, np.int64),
        np.zeros(W, np.int64),
        np.zeros(W, np.int64),
        np.zeros(W, np.int64),
        np.zeros(W, np.int64),
    )


@njit(cache=True, nogil=True)
def _admit(
    lanes: Any, tables: Tables, con: Constants, st: State, X: Floats, s: Samples, k: int, a0: int, sc: _Scratch
) -> bool:
    """Decide what each lane does with its sample k; True if any lane moves.  Sets moves, learns, seeds, h."""
    any_moves = False
    for a in range(len(lanes)):
        sc.moves[a] = 0
        sc.learns[a] = 0
        sc.seeds[a] = 0
        sc.watches[a] = 0
        sc.h[a] = 0.0
        sc.h_first[a] = 0.0
        if k >= s.count[a0 + a]:
            continue
        t, u, y = s.t[k, a0 + a], s.u[k, a0 + a], s.y[k, a0 + a]
        if not (math.isfinite(u) and math.isfinite(y)):
            st.counts[st_.NOT_FINITE, a] += 1
        elif st.t[a] != NEVER and st.t[a] - con.gap_us[a] <= t <= st.t[a]:
            st.counts[st_.NOT_INCREASING, a] += 1
        elif st.t[a] == NEVER or t < st.t[a] or t - st.t[a] > con.gap_us[a]:
            st.counts[st_.GAP, a] += st.t[a] != NEVER
            st.settled[a] = t + np.int64(con.settle_us[a])
            _rest(tables, con, st, X, a, t, u, y)
        else:
            any_moves = True
            sc.moves[a] = 1
            sc.h[a] = (t - st.t[a]) * 1e-6
            sc.h_first[a] = min(con.delay[a], sc.h[a])
            if t >= st.settled[a]:
                sc.seeds[a] = st.seed_left[a] > 0
                sc.learns[a] = 1
    return any_moves


@njit(cache=True, nogil=True)
def _rest(tables: Tables, con: Constants, st: State, X: Floats, a: int, t: int, u: float, y: float) -> None:
    """Start the predictor of lane a anew from this sample: the drive moves rigidly.  theta, P and g stay."""
    n, p = tables.n, tables.p
    for r in range(n):
        X[p, r, a] = con.rest[r, a] * y
        for i in range(p):
            X[i, r, a] = 0.0
    st.t[a] = t
    _hold(tables, con, st, X, a, u, y)
    st.torque_before[a] = u


@njit(cache=True, nogil=True)
def _hold(tables: Tables, con: Constants, st: State, X: Floats, a: int, u: float, y: float) -> None:
    """Inputs that act from this sample on: torque, friction of the speed, constant."""
    p = tables.p
    for c in range(tables.m):
        if tables.kind[c] == ONE:
            st.u[c, a] = 1.0
        elif tables.kind[c] == COULOMB:
            speed = X[p, tables.speed_state, a] if tables.filtered_speed else y
            f = math.tanh(speed / con.speed_scale[a])
            st.u[c, a] = f
            if tables.filtered_speed:
                slope = (1.0 - f * f) / con.speed_scale[a]
                for i in range(p):
                    st.du[i, c, a] = slope * X[i, tables.speed_state, a]
        else:
            st.torque_before[a] = st.u[c, a]
            st.u[c, a] = u


@njit(cache=True, nogil=True)
def _move(lanes: Any, tables: Tables, con: Constants, st: State, X: Floats, sc: _Scratch) -> None:
    """Over the interval: with the torque before during the delay, then with the torque of the last sample."""
    evaluate(lanes, tables, con, st.theta, sc.V, sc.term)
    late = False
    for a in range(len(lanes)):
        late = late or sc.h_first[a] > 0.0
    if late:
        for c in range(tables.m):
            for a in range(len(lanes)):
                sc.u[c, a] = st.torque_before[a] if tables.kind[c] == 0 else st.u[c, a]
        split(lanes, tables, con, sc.V, sc.h_first, sc.steps, sc.order)
        propagate(
            lanes, tables, sc.V, sc.u, st.du, sc.h_first, sc.steps, sc.order, X, sc.t, sc.t_next, sc.scale
        )
        for a in range(len(lanes)):
            sc.h[a] -= sc.h_first[a]
    split(lanes, tables, con, sc.V, sc.h, sc.steps, sc.order)
    propagate(lanes, tables, sc.V, st.u, st.du, sc.h, sc.steps, sc.order, X, sc.t, sc.t_next, sc.scale)


@njit(cache=True, nogil=True)
def _innovate(lanes: Any, con: Constants, st: State, s: Samples, k: int, a0: int, sc: _Scratch) -> None:
    """eps = y - yhat (eq. 11).  A predictor that has left the finite numbers is started anew by its next sample."""
    for a in range(len(lanes)):
        sc.eps[a] = s.y[k, a0 + a] - sc.yhat[a] if sc.moves[a] else 0.0
        if sc.moves[a] and not math.isfinite(sc.S[a] + sc.eps[a]):
            st.counts[st_.DIVERGED, a] += 1
            st.t[a] = NEVER
            sc.moves[a] = 0
            sc.learns[a] = 0
            sc.seeds[a] = 0
            sc.X[:, :, a] = 0.0
        sc.watches[a] = sc.learns[a] * (1 - sc.seeds[a])


@njit(cache=True, nogil=True)
def _finish(
    lanes: Any, tables: Tables, con: Constants, st: State, X: Floats, s: Samples, k: int, a0: int, sc: _Scratch
) -> None:
    for a in range(len(lanes)):
        if sc.moves[a]:
            st.t[a] = s.t[k, a0 + a]
            _hold(tables, con, st, X, a, s.u[k, a0 + a], s.y[k, a0 + a])
            st.counts[st_.USED, a] += sc.watches[a]
            st.counts[st_.SEEDING, a] += sc.seeds[a]
            st.counts[st_.SETTLING, a] += 1 - sc.learns[a]
            st.counts[st_.PROJECTED, a] += sc.hit[a]


@njit(cache=True, nogil=True)
def _record(lanes: Any, p: int, st: State, k: int, a0: int, sc: _Scratch, trace: Trace) -> None:
    for a in range(len(lanes)):
        b = a0 + a
        trace.eps[k, b] = sc.eps[a] if sc.learns[a] else math.nan
        for i in range(p):
            trace.psi[k, i, b] = sc.psi[i, a]
            trace.theta[k, i, b] = st.theta[i, a]
            trace.P[k, i, b] = st.P[i, i, a]
            trace.g[k, 0, i, b] = st.g[0, i, a]
            trace.g[k, 1, i, b] = st.g[1, i, a]


@njit(cache=True, nogil=True)
def run_lanes(
    lanes: Any,
    tables: Tables,
    C: Floats,
    F: Floats,
    I: Ints,  # noqa: E741
    s: Samples,
    a0: int,
    reset: bool,
    events: Events,
    trace: Trace,
) -> None:
    """Samples of lanes a0 .. a0 + W - 1; C, F, I are the constants and the state of just these lanes."""
    p = tables.p
    con = constant_views(C, tables)
    st = state_views(F, I, tables.n, p, tables.m)
    sc = _scratch(tables, con, F.shape[1])
    X = sc.X
    X[:p] = st.z
    X[p] = st.x
    most = 0
    for a in range(len(lanes)):
        most = max(most, s.count[a0 + a])
    for k in range(most):
        if _admit(lanes, tables, con, st, X, s, k, a0, sc):
            _move(lanes, tables, con, st, X, sc)
            predict(lanes, tables, sc.V, X, sc.yhat, sc.psi)
            gain(lanes, p, con, st.P, sc.psi, sc.Ppsi, sc.S)
            _innovate(lanes, con, st, s, k, a0, sc)
            update_theta(lanes, p, con, st, sc.eps, sc.Ppsi, sc.S, sc.watches, sc.hit)
            update_P(lanes, p, con, st.P, sc.Ppsi, sc.S, sc.learns)
            running_variance(lanes, con, st, sc.eps, sc.S, sc.learns)
            find_P0(lanes, p, con, st, sc.seeds)
            correct(lanes, tables, con, X, sc.eps, sc.psi, sc.moves)
            _finish(lanes, tables, con, st, X, s, k, a0, sc)
            cusum(lanes, p, con, st, sc.watches, a0, events, reset)
        if trace.eps.size:
            _record(lanes, p, st, k, a0, sc, trace)
    st.z[:] = X[:p]
    st.x[:] = X[p]


@njit(cache=True, nogil=True)
def run_axes(
    tables: Tables,
    C: Floats,
    F: Floats,
    I: Ints,  # noqa: E741
    s: Samples,
    reset: bool,
    events: Events,
    trace: Trace,
) -> None:
    """The bank axis by axis: the shape for few axes."""
    for a in range(F.shape[1]):
        con, f, i = C[:, a : a + 1].copy(), F[:, a : a + 1].copy(), I[:, a : a + 1].copy()
        run_lanes((0,), tables, con, f, i, s, a, reset, events, trace)
        F[:, a : a + 1] = f
        I[:, a : a + 1] = i


@njit(cache=True, nogil=True)
def run_side_by_side(
    tables: Tables,
    C: Floats,
    F: Floats,
    I: Ints,  # noqa: E741
    s: Samples,
    reset: bool,
    events: Events,
    trace: Trace,
) -> None:
    """The bank in lanes: the shape for many axes."""
    run_lanes(np.arange(F.shape[1]), tables, C, F, I, s, 0, reset, events, trace)
