"""The predictor at fixed theta: prediction errors and their gradient over a whole record, for off-line fits.

    x+ = x + K eps,      z_i+ = z_i - K psi_i + dK_i eps,      then over the interval
    x  = Ad x+ + Bd u,   z_i  = Ad z_i+ + dAd_i x+ + dBd_i u + Bd du_i

with Ad, Bd and their derivatives computed once for each distinct interval (drive/discretization.py).  K = 0 simulates.
Friction is computed from the speed at the middle of the interval (friction.py).

The p columns z_i are stored side by side; only the first q have derivatives of Ad, Bd, C and of inputs.
"""

import math
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import array_function, entry, outlined
from monitor_core.kernel.friction import SMALLEST, tanh
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, TORQUE, WEIGHT

FROM_RECORD, FROM_STATE, FROM_OUTPUT = 0, 1, 2
"""Sources of the angle or speed that an input depends on: the measured output (the predicted one if it is missing), the
state that is the speed at the sensor, or the predicted output."""

_DIVERGED = 1e100


class RecordSamples(NamedTuple):
    """The samples of a record of N, as the predictor needs them."""

    step: Ints  # (N,) index of the held drive that leads to the next sample
    level: Ints  # (N,) index of the output
    u: Floats  # (N,)
    y: Floats  # (N,)
    measured: Ints  # (N,) whether y corrects the state
    counts: Ints  # (N,) whether its error counts
    weights: Floats  # (N, s) inputs of the kind WEIGHT, in their order


class FixedDrive(NamedTuple):
    """A drive at fixed theta, held over G intervals, with L outputs, and the gain of its predictor.

    If X has one input more than there are kinds, m' = m + 1, the last input is the torque of the sample before.
    """

    X: Floats  # (G, n, n + m')
    dX: Floats  # (G, n + m', n q)
    C: Floats  # (L, n)
    dC: Floats  # (L, n, q)
    K: Floats  # (n,)
    dK: Floats  # (n, p)


class MotionInputs(NamedTuple):
    """Inputs that depend on the motion, among m inputs; m' = m + 1 if the last is the torque of the sample before.

    The speed at the middle of an interval is v = v_0 + half (x, u) + sum of braked_c tanh(scale_c v).
    """

    kind: Ints  # (m,)
    source: Ints  # (m,)
    state: int  # of the speed at the sensor
    scale: Floats  # (L, m) factors of the angle or speed
    dscale: Floats  # (L, m, q)
    half: Floats  # (G, n + m') half an interval times the acceleration, by x and the inputs but friction
    dhalf: Floats  # (G, n + m', q)
    braked: Floats  # (G, m) the same by each friction
    dbraked: Floats  # (G, m, q)


@outlined
def _output(j: int, C: Floats, dC: Floats, varies: bool, x: Floats, b: int, Z: Floats, to: int, psi: Floats) -> float:
    """Prediction yhat = C x, its gradient psi_i = C z_i + dC_i x into a row of psi; ``varies``: dC is not zero."""
    yhat = 0.0
    for i in range(psi.shape[1]):
        psi[to, i] = 0.0
    for r in range(x.size):
        c = C[j, r]
        if c != 0.0:
            yhat += c * x[r]
            for i in range(psi.shape[1]):
                psi[to, i] += c * Z[b, r, i]
        if varies:
            for i in range(dC.shape[2]):
                psi[to, i] += dC[j, r, i] * x[r]
    return yhat


@outlined
def _correct(K: Floats, dK: Floats, eps: float, k: int, psi: Floats, x: Floats, b: int, Z: Floats) -> None:
    for r in range(x.size):
        x[r] += K[r] * eps
        for i in range(psi.shape[1]):
            Z[b, r, i] += dK[r, i] * eps - K[r] * psi[k, i]


@outlined
def _motion(
    source: int, state: int, measured: bool, y: float, j: int, C: Floats, dC: Floats, x: Floats, b: int, Z: Floats,
    slope: Floats,
) -> float:  # fmt: skip
    """Present angle or speed that an input depends on; its gradient is written to the first row of ``slope``."""
    for i in range(slope.shape[1]):
        slope[0, i] = 0.0
    if source == FROM_STATE:
        for i in range(slope.shape[1]):
            slope[0, i] = Z[b, state, i]
        return float(x[state])
    if source == FROM_RECORD and measured:
        return y
    return _output(j, C, dC, True, x, b, Z, 0, slope)


@outlined
def _gravity(c: int, j: int, M: MotionInputs, angle: float, n: int, b: int, Z: Floats, slope: Floats) -> float:
    """Input c, cosine or sine of the angle, with its derivatives into row n + c of Z."""
    a = M.scale[j, c] * angle
    f, rate = (math.cos(a), -math.sin(a)) if M.kind[c] == COSINE else (math.sin(a), math.cos(a))
    for i in range(slope.shape[1]):
        Z[b, n + c, i] = rate * M.scale[j, c] * slope[0, i]
    for i in range(M.dscale.shape[2]):
        Z[b, n + c, i] += rate * angle * M.dscale[j, c, i]
    return f


@outlined
def _hold_friction(
    g: int, j: int, M: MotionInputs, speed: float, x: Floats, w: Floats, b: int, Z: Floats, slope: Floats
) -> None:
    """Write the friction of interval g to w, which has the other inputs, and its derivatives to Z.

    ``slope`` (3, p): on entry, the gradient of the present speed in the first row; then the gradients of w, v and v_1
    of friction.py.
    """
    n, m, p, q = x.size, M.kind.size, slope.shape[1], M.dscale.shape[2]
    v, divisor = speed, 1.0
    for e in range(M.half.shape[1]):
        half, factor = M.half[g, e], x[e] if e < n else w[e]
        v += half * factor
        if half != 0.0 and e < n + m:
            for i in range(p):
                slope[0, i] += half * Z[b, e, i]
        for i in range(q):
            slope[0, i] += M.dhalf[g, e, i] * factor
    for i in range(p):
        slope[1, i] = slope[0, i]
        slope[2, i] = 0.0
    for c in range(m):
        if M.kind[c] == COULOMB:
            divisor -= M.braked[g, c] * M.scale[j, c]
            for i in range(q):
                slope[2, i] -= M.dbraked[g, c, i] * M.scale[j, c] + M.braked[g, c] * M.dscale[j, c, i]
    kept = divisor > SMALLEST
    divisor = divisor if kept else SMALLEST
    v1 = v / divisor
    for i in range(p):
        slope[2, i] = (slope[0, i] - (v1 * slope[2, i] if kept else 0.0)) / divisor
    for c in range(m):
        if M.kind[c] == COULOMB:
            f = tanh(M.scale[j, c] * v1)
            rate = M.braked[g, c] * (1.0 - f * f)
            v += M.braked[g, c] * f
            for i in range(p):
                slope[1, i] += rate * M.scale[j, c] * slope[2, i]
            for i in range(q):
                slope[1, i] += rate * v1 * M.dscale[j, c, i] + M.dbraked[g, c, i] * f
    for c in range(m):
        if M.kind[c] == COULOMB:
            f = tanh(M.scale[j, c] * v)
            rate = 1.0 - f * f
            w[n + c] = f
            for i in range(p):
                Z[b, n + c, i] = rate * M.scale[j, c] * slope[1, i]
            for i in range(q):
                Z[b, n + c, i] += rate * v * M.dscale[j, c, i]


@entry
def simulate_known(u: Floats, X: Floats, dX: Floats, C: Floats, dC: Floats, psi: Floats) -> None:
    """Gradient psi (N, q) of the simulated output from rest, with known inputs u (N, m) and equal intervals X, dX."""
    (n, q), wide = dC.shape, width(dC.shape[1])
    Ad, slopes = padded(X.reshape((1, *X.shape))), padded_slopes(dX.reshape((1, *dX.shape)), n, wide)
    x, w, flat = np.zeros(n), np.zeros(slopes.shape[1]), np.zeros((2, room(n) * wide))
    Z = flat.reshape((2, room(n), wide))
    C0, dC0 = C.reshape((1, n)), dC.reshape((1, n, q))
    for k in range(u.shape[0]):
        _output(0, C0, dC0, True, x, k & 1, Z, k, psi)
        for r in range(n):
            w[r] = x[r]
        for c in range(u.shape[1]):
            w[n + c] = u[k, c]
        move(0, Ad, w, x)
        force(0, slopes, w, 1 - (k & 1), flat)
        carry(0, Ad, n, Z.shape[1], k & 1, Z)


@outlined
def _corrects(K: Floats, dK: Floats) -> bool:
    """Whether K or a derivative of it is not zero."""
    for r in range(K.size):
        if K[r] != 0.0:
            return True
        for i in range(dK.shape[1]):
            if dK[r, i] != 0.0:
                return True
    return False


@outlined
def _varies(slopes: Floats) -> bool:
    """Whether an element of ``slopes`` (L, n, q) is not zero."""
    for j in range(slopes.shape[0]):
        for r in range(slopes.shape[1]):
            for i in range(slopes.shape[2]):
                if slopes[j, r, i] != 0.0:
                    return True
    return False


@outlined
def _moves(M: MotionInputs, measured: Ints) -> bool:
    """Whether an input has derivatives: friction, gravity of a predicted angle or with an estimated factor."""
    complete = True
    for k in range(measured.size):
        complete &= measured[k] != 0
    for c in range(M.kind.size):
        known = M.source[c] == FROM_RECORD and complete and M.kind[c] != COULOMB
        given = M.kind[c] == TORQUE or M.kind[c] == ONE or M.kind[c] == WEIGHT
        if not given and not known:
            return True
    return _varies(M.dscale)


@entry
def predict_record(
    samples: RecordSamples, drive: FixedDrive, motion: MotionInputs, x0: Floats, Z0: Floats, eps: Floats, psi: Floats
) -> bool:
    """Compute prediction errors eps (N,) and psi = d yhat / d theta (N, p) of a record; zero where they do not count.

    All errors of a measured y correct the state, which starts as x0 (n,) with the derivatives Z0 (n, p).

    Returns whether all values are finite; if not, the rest of the record is not computed.
    """
    step, level, u, y, measured, counts, weights = samples
    X, dX, C, dC, K, dK = drive
    (n, p), kind = Z0.shape, motion.kind
    m, wide = kind.size, width(p)
    Ad, slopes = padded(X), padded_slopes(dX, n, wide)
    flat = np.zeros((2, room(n + m) * wide))
    Z = flat.reshape((2, room(n + m), wide))
    Z[0, :n, :p] = Z0
    x, w, slope = x0.copy(), np.zeros(slopes.shape[1]), np.zeros((3, p))
    corrects, varies = _corrects(K, dK), _varies(dC)
    rows = room(n + m) if _moves(motion, measured) else room(n)
    for k in range(u.size):
        b, j = k & 1, level[k]
        if k > 0:
            for r in range(n):
                w[r] = x[r]
            move(step[k - 1], Ad, w, x)
            force(step[k - 1], slopes, w, b, flat)
            carry(step[k - 1], Ad, n, rows, 1 - b, Z)
        yhat = _output(j, C, dC, varies, x, b, Z, k, psi)
        if not abs(yhat) < _DIVERGED:
            return False
        eps[k] = 0.0
        if measured[k]:
            eps[k] = y[k] - yhat
            if corrects:
                _correct(K, dK, eps[k], k, psi, x, b, Z)
        if not counts[k]:
            eps[k] = 0.0
            for i in range(p):
                psi[k, i] = 0.0
        if X.shape[2] > n + m:
            w[n + m] = u[max(k - 1, 0)]
        friction, weight = -1, 0
        for c in range(m):
            if kind[c] == TORQUE:
                w[n + c] = u[k]
            elif kind[c] == ONE:
                w[n + c] = 1.0
            elif kind[c] == WEIGHT:
                w[n + c] = weights[k, weight]
                weight += 1
            elif kind[c] == COULOMB:
                friction = c
            else:
                v = _motion(motion.source[c], motion.state, measured[k] != 0, y[k], j, C, dC, x, b, Z, slope)
                w[n + c] = _gravity(c, j, motion, v, n, b, Z, slope)
        if friction >= 0:
            v = _motion(motion.source[friction], motion.state, measured[k] != 0, y[k], j, C, dC, x, b, Z, slope)
            _hold_friction(step[k], j, motion, v, x, w, b, Z, slope)
    return True


# --- One held interval, of the states and of many derivatives side by side, for the predictor at fixed theta ----------


# The cost of a short loop is its setup.  So six addends are summed in one loop, at places that are known to the
# compiler, and rows of zeros fill up the number.  Slices are avoided: numba counts references to each, which takes as
# long.


@outlined
def room(size: int) -> int:
    """Number of rows for ``size`` of them, padded with zeros: six go in one pass, the rest by threes (force, carry)."""
    return max(6, (size + 2) // 3 * 3)


@outlined
def width(p: int) -> int:
    """Number of columns for p of them: padded to whole SIMD vectors, as a remainder takes as long as all of them."""
    return (p + 7) // 8 * 8


@array_function
def padded(X: Floats) -> Floats:
    """X (G, n, n + m) with padded columns."""
    out = np.zeros((X.shape[0], X.shape[1], room(X.shape[2])))
    for g in range(X.shape[0]):
        for r in range(X.shape[1]):
            for c in range(X.shape[2]):
                out[g, r, c] = X[g, r, c]
    return out


@array_function
def padded_slopes(dX: Floats, n: int, p: int) -> Floats:
    """dX (G, n + m, n q) as (G, n + m, n p) with padded rows; zero for parameters without derivatives."""
    G, rows, q = dX.shape[0], dX.shape[1], dX.shape[2] // n
    out = np.zeros((G, room(rows), n * p))
    for g in range(G):
        for c in range(rows):
            for r in range(n):
                for i in range(q):
                    out[g, c, r * p + i] = dX[g, c, r * q + i]
    return out


@outlined
def force(g: int, dX: Floats, w: Floats, a: int, flat: Floats) -> None:
    """Rows 0 .. n of Z_a become dX w; ``flat`` (2, rows p) is Z as flat rows."""
    w0, w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4], w[5]
    for e in range(dX.shape[2]):
        some = dX[g, 0, e] * w0 + dX[g, 1, e] * w1 + dX[g, 2, e] * w2
        flat[a, e] = some + dX[g, 3, e] * w3 + dX[g, 4, e] * w4 + dX[g, 5, e] * w5
    for c in range(6, w.size, 3):
        w0, w1, w2 = w[c], w[c + 1], w[c + 2]
        for e in range(dX.shape[2]):
            flat[a, e] = flat[a, e] + dX[g, c, e] * w0 + dX[g, c + 1, e] * w1 + dX[g, c + 2, e] * w2


@outlined
def carry(g: int, X: Floats, n: int, rows: int, b: int, Z: Floats) -> None:
    """Rows 0 .. n of the other Z become Z + X Z_b; only the first ``rows`` rows of Z_b are used."""
    a, p = 1 - b, Z.shape[2]
    for r in range(n):
        x0, x1, x2, x3, x4, x5 = X[g, r, 0], X[g, r, 1], X[g, r, 2], X[g, r, 3], X[g, r, 4], X[g, r, 5]
        for i in range(p):
            some = Z[a, r, i] + x0 * Z[b, 0, i] + x1 * Z[b, 1, i] + x2 * Z[b, 2, i]
            Z[a, r, i] = some + x3 * Z[b, 3, i] + x4 * Z[b, 4, i] + x5 * Z[b, 5, i]
        for c in range(6, rows, 3):
            x0, x1, x2 = X[g, r, c], X[g, r, c + 1], X[g, r, c + 2]
            for i in range(p):
                Z[a, r, i] = Z[a, r, i] + x0 * Z[b, c, i] + x1 * Z[b, c + 1, i] + x2 * Z[b, c + 2, i]


@outlined
def move(g: int, X: Floats, w: Floats, x: Floats) -> None:
    """x becomes X (x, u)."""
    for r in range(x.size):
        total = 0.0
        for c in range(w.size):
            total += X[g, r, c] * w[c]
        x[r] = total
