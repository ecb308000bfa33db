"""The predictor at fixed theta: prediction errors and their gradient over a whole record, for off-line fits.

    x+ = x + K eps,      z_i+ = z_i - K psi_i + dK_i eps,      then over the interval
    x  = Ad x+ + Bd u,   z_i  = Ad z_i+ + dAd_i x+ + dBd_i u + Bd du_i

with Ad, Bd and their derivatives made once for each distinct interval (exponential.py).  K = 0 simulates.
The p columns z_i stand side by side; of them only the first q have derivatives of Ad, Bd, C and of inputs.
"""

import math

import numpy as np

from monitor_core.kernel.compile import entry, kernel
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, TORQUE, Floats, Ints

FROM_RECORD, FROM_STATE, FROM_OUTPUT = 0, 1, 2
"""Where the angle or speed comes from that an input depends on: the measured output (the predicted one where that is
missing), the state of the speed at the sensor, or the predicted output."""

_DIVERGED = 1e100


@kernel
def _output(C: Floats, dC: Floats, x: Floats, Z: Floats, psi: Floats) -> float:
    """Prediction yhat = C x and its gradient psi_i = C z_i + dC_i x."""
    yhat = 0.0
    psi[:] = 0.0
    for r in range(x.size):
        yhat += C[r] * x[r]
        if C[r] != 0.0:
            for i in range(psi.size):
                psi[i] += C[r] * Z[r, i]
        for i in range(dC.shape[1]):
            psi[i] += dC[r, i] * x[r]
    return yhat


@kernel
def _correct(K: Floats, dK: Floats, eps: float, psi: Floats, x: Floats, Z: Floats) -> None:
    for r in range(x.size):
        x[r] += K[r] * eps
        for i in range(psi.size):
            Z[r, i] += dK[r, i] * eps - K[r] * psi[i]


@kernel
def _argument(
    source: int,
    state: int,
    measured: bool,
    y: float,
    C: Floats,
    dC: Floats,
    x: Floats,
    Z: Floats,
    slope: Floats,
) -> float:
    """The angle or speed that an input depends on, and its gradient into ``slope`` (p,)."""
    slope[:] = 0.0
    if source == FROM_STATE:
        slope[:] = Z[state]
        return float(x[state])
    if source == FROM_RECORD and measured:
        return y
    return _output(C, dC, x, Z, slope)


@kernel
def _function(kind: int, a: float) -> tuple[float, float]:
    """An input of the motion and its derivative."""
    if kind == COULOMB:
        f = math.tanh(a)
        return f, 1.0 - f * f
    if kind == COSINE:
        return math.cos(a), -math.sin(a)
    return math.sin(a), math.cos(a)


@kernel
def _hold(
    kind: Ints,
    source: Ints,
    state: int,
    torque: float,
    before: float,
    measured: bool,
    y: float,
    scale: Floats,
    dscale: Floats,
    C: Floats,
    dC: Floats,
    x: Floats,
    Z: Floats,
    slope: Floats,
    w: Floats,
    du: Floats,
) -> None:
    """The inputs from now on, behind the n states in w, and their derivatives du (m, p)."""
    n, m = x.size, kind.size
    if w.size > n + m:
        w[n + m] = before
    for c in range(m):
        if kind[c] == TORQUE:
            w[n + c] = torque
        elif kind[c] == ONE:
            w[n + c] = 1.0
        else:
            v = _argument(source[c], state, measured, y, C, dC, x, Z, slope)
            w[n + c], rate = _function(kind[c], scale[c] * v)
            for i in range(slope.size):
                du[c, i] = rate * scale[c] * slope[i]
            for i in range(dscale.shape[1]):
                du[c, i] += rate * v * dscale[c, i]


@kernel
def _propagate(
    X: Floats, dX: Floats, moves: bool, du: Floats, w: Floats, x: Floats, Z: Floats, F: Floats, Znext: Floats
) -> None:
    """Over one interval; X = [Ad Bd] (n, n + m), dX (n + m, n q); F (n q,) and Znext (n, p) are scratch."""
    n, p = Z.shape
    q = F.size // n
    F[:] = 0.0
    for c in range(w.size):
        wc = w[c]
        for e in range(F.size):
            F[e] += dX[c, e] * wc
    for r in range(n):
        to = Znext[r]
        to[:] = 0.0
        for i in range(q):
            to[i] = F[r * q + i]
        for c in range(n):
            a = X[r, c]
            for i in range(p):
                to[i] += a * Z[c, i]
        if moves:
            for c in range(du.shape[0]):
                b = X[r, n + c]
                for i in range(p):
                    to[i] += b * du[c, i]
        total = 0.0
        for c in range(w.size):
            total += X[r, c] * w[c]
        x[r] = total
    Z[:] = Znext


@entry
def simulate_known(u: Floats, X: Floats, dX: Floats, C: Floats, dC: Floats, psi: Floats) -> None:
    """Gradient psi (N, q) of the simulated output from rest, all inputs u (N, m) known, one held interval X, dX."""
    n, q = dC.shape
    x, Z, Znext, F = np.zeros(n), np.zeros((n, q)), np.empty((n, q)), np.empty(n * q)
    w, none = np.zeros(X.shape[1]), np.zeros((0, q))
    for k in range(u.shape[0]):
        _output(C, dC, x, Z, psi[k])
        w[:n] = x
        w[n:] = u[k]
        _propagate(X, dX, False, none, w, x, Z, F, Znext)


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
    """Prediction errors eps (N,) and psi = d yhat / d theta (N, p) of a record; zero where nothing was measured.

    ``step`` (N,) says which of the held X (G, n, n + m') and dX (G, n + m', n q) leads to the next sample, ``level``
    (N,) which of the outputs C (L, n), dC (L, n, q) and input scales scale (L, m), dscale (L, m, q) applies.
    Where X has one input more than there are kinds, m' = m + 1, that is the torque of the sample before.

    Returns whether all is finite; if not, the rest of the record is left out.
    """
    n, p = Z0.shape
    q, m = dC.shape[2], kind.size
    x, Z, Znext, F = x0.copy(), Z0.copy(), np.empty((n, p)), np.empty(n * q)
    w, du, slope = np.zeros(X.shape[2]), np.zeros((m, p)), np.empty(p)
    moves = False
    for c in range(m):
        moves |= kind[c] != TORQUE and kind[c] != ONE
    for k in range(u.size):
        if k > 0:
            g = step[k - 1]
            w[:n] = x
            _propagate(X[g], dX[g], moves, du, w, x, Z, F, Znext)
        j = level[k]
        yhat = _output(C[j], dC[j], x, Z, psi[k])
        if not abs(yhat) < _DIVERGED:
            return False
        eps[k] = 0.0
        if measured[k]:
            eps[k] = y[k] - yhat
            _correct(K, dK, eps[k], psi[k], x, Z)
        _hold(
            kind, source, state, u[k], u[max(k - 1, 0)], measured[k] != 0, y[k],
            scale[j], dscale[j], C[j], dC[j], x, Z, slope, w, du,
        )  # fmt: skip
        if not measured[k]:
            psi[k] = 0.0
    return True
