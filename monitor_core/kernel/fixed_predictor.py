"""The predictor at fixed theta: prediction errors and their gradient over a whole record, for off-line fits.

    x+ = x + K eps,      z_i+ = z_i - K psi_i + dK_i eps,      then over the interval
    x  = Ad x+ + Bd u,   z_i  = Ad z_i+ + dAd_i x+ + dBd_i u + Bd du_i

with Ad, Bd and their derivatives computed once for each distinct interval (matrix_exponential.py).  K = 0 simulates.
The p columns z_i are stored side by side; only the first q have derivatives of Ad, Bd, C and of inputs.
"""

import math

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import array_function, entry, outlined
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, TORQUE

FROM_RECORD, FROM_STATE, FROM_OUTPUT = 0, 1, 2
"""Where the angle or speed comes from that an input depends on: the measured output (the predicted one where that is
missing), the state of the speed at the sensor, or the predicted output."""

_DIVERGED = 1e100


@outlined
def _output(
    j: int, C: Floats, dC: Floats, varies: bool, x: Floats, b: int, Z: Floats, to: int, psi: Floats
) -> float:
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
def _function(kind: int, a: float) -> tuple[float, float]:
    """An input that depends on the motion, and its derivative."""
    if kind == COULOMB:
        f = math.tanh(a)
        return f, 1.0 - f * f
    if kind == COSINE:
        return math.cos(a), -math.sin(a)
    return math.sin(a), math.cos(a)


@outlined
def _of_motion(
    c: int,
    kind: int,
    source: int,
    state: int,
    measured: bool,
    y: float,
    j: int,
    scale: Floats,
    dscale: Floats,
    C: Floats,
    dC: Floats,
    x: Floats,
    b: int,
    Z: Floats,
    slope: Floats,
) -> float:
    """Input c, f(scale v) of the angle or speed v, with its derivatives into row n + c of Z.

    ``slope`` (1, p) is scratch.
    """
    to, v = x.size + c, y
    for i in range(slope.shape[1]):
        slope[0, i] = 0.0
    if source == FROM_STATE:
        v = x[state]
        for i in range(slope.shape[1]):
            slope[0, i] = Z[b, state, i]
    elif source != FROM_RECORD or not measured:
        v = _output(j, C, dC, True, x, b, Z, 0, slope)
    f, rate = _function(kind, scale[j, c] * v)
    for i in range(slope.shape[1]):
        Z[b, to, i] = rate * scale[j, c] * slope[0, i]
    for i in range(dscale.shape[2]):
        Z[b, to, i] += rate * v * dscale[j, c, i]
    return f


@entry
def simulate_known(u: Floats, X: Floats, dX: Floats, C: Floats, dC: Floats, psi: Floats) -> None:
    """Gradient psi (N, q) of the simulated output from rest, all inputs u (N, m) known, one interval X, dX."""
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
    """Whether anything in ``slopes`` (L, n, q) is not zero."""
    for j in range(slopes.shape[0]):
        for r in range(slopes.shape[1]):
            for i in range(slopes.shape[2]):
                if slopes[j, r, i] != 0.0:
                    return True
    return False


@outlined
def _moves(kind: Ints, source: Ints, measured: Ints, dscale: Floats) -> bool:
    """Whether an input has derivatives: of predicted motion, or of measured motion scaled by a parameter."""
    complete = True
    for k in range(measured.size):
        complete &= measured[k] != 0
    for c in range(kind.size):
        if kind[c] != TORQUE and kind[c] != ONE and not (source[c] == FROM_RECORD and complete):
            return True
    return _varies(dscale)


@entry
def predict_record(
    step: Ints,
    level: Ints,
    u: Floats,
    y: Floats,
    measured: Ints,
    kind: Ints,
    source: Ints,
    state: int,
    scale: Floats,
    dscale: Floats,
    X: Floats,
    dX: Floats,
    C: Floats,
    dC: Floats,
    K: Floats,
    dK: Floats,
    x0: Floats,
    Z0: Floats,
    eps: Floats,
    psi: Floats,
) -> bool:
    """Prediction errors eps (N,) and psi = d yhat / d theta (N, p) of a record; zero where y was not measured.

    ``step`` (N,) is the index of the held X (G, n, n + m') and dX (G, n + m', n q) that lead to the next sample,
    ``level`` (N,) the index of the outputs C (L, n), dC (L, n, q) and input scales scale (L, m), dscale (L, m, q).
    Where X has one input more than there are kinds, m' = m + 1, that is the torque of the sample before.

    Returns whether all values are finite; if not, the rest of the record is left out.
    """
    (n, p), m = Z0.shape, kind.size
    wide = width(p)
    Ad, slopes = padded(X), padded_slopes(dX, n, wide)
    flat = np.zeros((2, room(n + m) * wide))
    Z = flat.reshape((2, room(n + m), wide))
    Z[0, :n, :p] = Z0
    x, w, slope = x0.copy(), np.zeros(slopes.shape[1]), np.zeros((1, p))
    corrects, varies = _corrects(K, dK), _varies(dC)
    rows = room(n + m) if _moves(kind, source, measured, dscale) else room(n)
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
        else:
            for i in range(p):
                psi[k, i] = 0.0
        for c in range(m):
            if kind[c] == TORQUE:
                w[n + c] = u[k]
            elif kind[c] == ONE:
                w[n + c] = 1.0
            else:
                w[n + c] = _of_motion(
                    c, kind[c], source[c], state, measured[k] != 0, y[k],
                    j, scale, dscale, C, dC, x, b, Z, slope,
                )  # fmt: skip
        if X.shape[2] > n + m:
            w[n + m] = u[max(k - 1, 0)]
    return True


# --- One held interval, of the states and of many derivatives side by side, for the predictor at fixed theta ----------


# What a short loop costs is its beginning.  Hence six addends in one, at places that are known when it is compiled, and
# rows of zeros that make up the number.  No slices either: numba counts references to each, which takes as long.


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
