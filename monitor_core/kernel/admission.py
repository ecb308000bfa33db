"""First and last step for a sample: classify it, and hold its inputs until the next sample."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, part
from monitor_core.kernel.state import DIVERGED, GAP, NEVER, NOT_FINITE, NOT_INCREASING, STARTED
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, TORQUE, WEIGHT, Tables


class Timing(NamedTuple):
    """Time limits that decide how a sample is used; fields of the Constants."""

    gap_us: Floats  # (W,) a longer interval restarts the predictor
    settle_us: Floats  # (W,) no update of theta for this time after a restart
    interval: Floats  # (W,) s, nominal
    lost_us: Floats  # (W,) no update of theta for this time after each lost sample except the first


class Roles(NamedTuple):
    """Use of this sample by each lane (W,)."""

    mode: Ints  # SKIP .. TRACK
    moves: Ints  # 1: the state is corrected
    learns: Ints  # 1: P is updated
    tracks: Ints  # 1: theta is updated


SKIP, RESTART, SETTLE, GATED, DOUBTED, IDLE, SEED, TRACK = 0, 1, 2, 3, 4, 5, 6, 7
"""Modes of a lane.  SKIP: do nothing.  RESTART: restart the predictor.  SETTLE, GATED, DOUBTED, IDLE: predict only,
because the predictor has just started, the gate is closed, the sample is an outlier, or there is no excitation.  SEED:
also update P to find P(0).  TRACK: update everything."""


@kernel
def classify_sample(
    lanes: Any,
    t: Ints,
    u: Floats,
    y: Floats,
    timing: Timing,
    last: Ints,
    settled: Ints,
    seed_left: Ints,
    counts: Ints,
    mode: Ints,
    h: Floats,
) -> bool:
    """Set the mode of each lane for its sample (t, u, y), and the interval h (W,) in s; True if any lane moves.

    A sample whose time is not after the last one is skipped; a time that is earlier by more than a gap means that the
    clock was set.  If more than one sample was lost, the torque in between is unknown; then the state is wrong for a
    while, and theta is not updated.
    """
    gap_us, settle_us, interval, lost_us = timing.gap_us, timing.settle_us, timing.interval, timing.lost_us
    any_moves = False
    for a in range(len(lanes)):
        h[a] = 0.0
        if mode[a] == SKIP:
            continue
        mode[a] = SKIP
        if not (math.isfinite(u[a]) and math.isfinite(y[a])):
            counts[NOT_FINITE, a] += 1
        elif last[a] == NEVER:
            counts[STARTED, a] += 1
            mode[a] = RESTART
        elif last[a] - gap_us[a] <= t[a] <= last[a]:
            counts[NOT_INCREASING, a] += 1
        elif t[a] < last[a] or t[a] - last[a] > gap_us[a]:
            counts[GAP, a] += 1
            mode[a] = RESTART
        else:
            any_moves = True
            h[a] = (t[a] - last[a]) * 1e-6
            lost = h[a] / interval[a] - 2.0
            if lost > 0.5:
                settled[a] = max(settled[a], t[a] + int(lost * lost_us[a]))
            if t[a] < settled[a]:
                mode[a] = SETTLE
            else:
                mode[a] = SEED if seed_left[a] > 0 else TRACK
        if mode[a] == RESTART:
            settled[a] = t[a] + int(settle_us[a])
    return any_moves


@kernel
def restart_predictor(lanes: Any, mode: Ints, state_of_y: Floats, y: Floats, X: Floats) -> None:
    """Restart predictors: the drive moves rigidly with the output of this sample.  theta, P and g stay."""
    n = state_of_y.shape[0]
    z = X.shape[0] - n
    for a in range(len(lanes)):
        if mode[a] == RESTART:
            for r in range(z):
                X[r, a] = 0.0
            for r in range(n):
                X[z + r, a] = state_of_y[r, a] * y[a]


@kernel
def is_first(t: int, settled: int, settle_us: float, h: float) -> bool:
    """Whether a sample that settles is one of the first three after the start, by its interval h [s]."""
    return 0.5 <= (t - settled + settle_us) / (h * 1e6) <= 3.5


@kernel
def gain_of_speed(
    lanes: Any,
    timing: Timing,
    rest: Floats,
    rigid: Floats,
    t: Ints,
    settled: Ints,
    h: Floats,
    mode: Ints,
    first: Ints,
    K: Floats,
) -> None:
    """If y is an angle, set the speed from the increments of y over the first samples after a start.

    An axis may start in the middle of a fast motion, and the filter gain would take many time constants to find its
    speed.  Three increments are used, so that a single outlier, even the very first sample, has no lasting effect.
    ``first`` (W,): 1 for lanes at such a sample.
    """
    for a in range(len(lanes)):
        first[a] = 0
        if mode[a] == SETTLE and is_first(t[a], settled[a], timing.settle_us[a], h[a]):
            most = 0.0
            for r in range(rigid.shape[0]):
                most = max(most, abs(rigid[r, a]))
            if most > 0.0:
                first[a] = 1
                for r in range(rigid.shape[0]):
                    K[r, a] = rest[r, a] + rigid[r, a] / h[a]


@kernel
def follow_first(lanes: Any, first: Ints, moves: Ints, in_a_row: Ints) -> None:
    """Correct the state by the first samples even if they are outliers."""
    for a in range(len(lanes)):
        if first[a]:
            moves[a], in_a_row[a] = 1, 0


@kernel
def form_innovation(
    lanes: Any,
    y: Floats,
    yhat: Floats,
    S: Floats,
    last: Ints,
    counts: Ints,
    roles: Roles,
    eps: Floats,
    X: Floats,
) -> None:
    """eps = y - yhat (eq. 11).  A predictor whose values are no longer finite restarts with its next sample."""
    mode, moves, learns, tracks = roles.mode, roles.moves, roles.learns, roles.tracks
    for a in range(len(lanes)):
        if mode[a] >= SETTLE and not math.isfinite(y[a] - yhat[a] + S[a]):
            counts[DIVERGED, a] += 1
            last[a] = NEVER
            mode[a] = SKIP
            for r in range(X.shape[0]):
                X[r, a] = 0.0
        moves[a] = mode[a] >= SETTLE
        learns[a] = mode[a] >= SEED
        tracks[a] = mode[a] == TRACK
        eps[a] = y[a] - yhat[a] if moves[a] else 0.0


@part
def hold_inputs(
    lanes: Any,
    T: Tables,
    u_scale: Floats,
    rest: Floats,
    t: Ints,
    torque: Floats,
    y: Floats,
    weight: Floats,
    mode: Ints,
    last: Ints,
    u: Floats,
    torque_before: Floats,
) -> None:
    """Hold the inputs of the sample from now on: torque, constant, weight, gravity at the measured angle.

    If the weight (W,) is not known (NaN), the last one is kept.

    Friction is computed after the next interval (friction.py).  Until then a measured speed is kept, in the unit of its
    state: rest y.
    """
    speed_state = T.friction.state
    for a in range(len(lanes)):
        before = last[a]
        last[a] = t[a] if mode[a] != SKIP else before
    for c in range(T.kind.size):
        kind = T.kind[c]
        if kind == TORQUE:
            for a in range(len(lanes)):
                held, older, now = u[c, a], torque_before[a], torque[a]
                torque_before[a] = older if mode[a] == SKIP else now if mode[a] == RESTART else held
                u[c, a] = held if mode[a] == SKIP else now
        elif kind == ONE:
            for a in range(len(lanes)):
                held = u[c, a]
                u[c, a] = held if mode[a] == SKIP else 1.0
        elif kind == COULOMB:
            for a in range(len(lanes)):
                held, motion = u[c, a], rest[speed_state, a] * y[a] if speed_state >= 0 else y[a]
                u[c, a] = held if mode[a] == SKIP else motion
        elif kind == WEIGHT:
            for a in range(len(lanes)):
                if mode[a] != SKIP and math.isfinite(weight[a]):
                    u[c, a] = weight[a]
        else:
            for a in range(len(lanes)):
                angle = u_scale[c, a] * y[a]
                if mode[a] == SKIP:
                    continue
                # Nearly all hypotheses for an axis have the same angle, and the sine takes most of the time here.
                if a > 0 and mode[a - 1] != SKIP and angle == u_scale[c, a - 1] * y[a - 1]:
                    u[c, a] = u[c, a - 1]
                else:
                    u[c, a] = math.cos(angle) if kind == COSINE else math.sin(angle)


# --- Operating conditions: nominal values that follow signals, and gates ----------------------------------------------


@kernel
def follow_conditions(
    lanes: Any,
    k: int,
    a0: int,
    to: Floats,
    lower: Floats,
    upper: Floats,
    shift: Floats,
    theta: Floats,
    theta_seen: Floats,
    mode: Ints,
) -> None:
    """Move theta_0(s) to ``to[k]`` (p, W), and the estimate with it, so that theta - theta_0(s) stays the same.

    NaN means that the conditions are unknown: the last ones are kept, and theta is not updated.
    """
    for i in range(shift.shape[0]):
        for a in range(len(lanes)):
            wanted = to[k, i, min(a0 + a, to.shape[2] - 1)]
            step = wanted - shift[i, a]
            if mode[a] == SKIP:
                continue
            if abs(step) < math.inf:
                shift[i, a] = wanted
                theta[i, a] = min(max(theta[i, a] + step, lower[i, a]), upper[i, a])
                theta_seen[i, a] += step
            elif mode[a] >= SEED:
                mode[a] = GATED


@kernel
def close_gate(lanes: Any, k: int, a0: int, gate: NDArray[np.bool_], mode: Ints) -> None:
    """Where the gate (N, W) is closed, only predict and correct the state; theta is not updated."""
    for a in range(len(lanes)):
        if mode[a] >= SEED and not gate[k, min(a0 + a, gate.shape[1] - 1)]:
            mode[a] = GATED
