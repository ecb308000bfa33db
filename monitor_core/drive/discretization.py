"""Balancing and exact zero-order hold as matrices, for simulation, Kalman gain and fits; not for the recursion.

Many intervals of one drive share one Taylor series, also for the derivatives:  [Ad Bd], the upper rows of exp(F h) with
F = [A B; 0 0], are sum_k T_k h^k with T_0 = [I 0], T_1 = [A B] and T_k = A T_(k-1) / k.  The derivatives have the same
form with dT_k = (dA T_(k-1) + A dT_(k-1)) / k (Frechet derivative of the exponential).  The T_k do not depend on h, so
each interval costs only a polynomial.  If the norm of A h is above 1, the polynomial is evaluated at h / 2^s and
squared s times:  [Ad Bd] -> [Ad Ad, Ad Bd + Bd].
"""

import numpy as np
import scipy.linalg as sla

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import array_function, entry

TERMS = 19
"""Number of terms: with a norm of 1, the first omitted term of the derivative is below 1e-16."""


def balance_of(A: Floats) -> Floats:
    """The diagonal d (n,) of powers of two that balances A: for the states x_i / d_i, A becomes D^-1 A D."""
    return np.asarray(sla.matrix_balance(A, permute=False, separate=True)[1][0], dtype=float)


def zero_order_hold(A: Floats, B: Floats, interval_s: float) -> tuple[Floats, Floats]:
    """Ad (n, n) and Bd (n, m) of  x(t + h) = Ad x(t) + Bd u  with u held over h = ``interval_s``."""
    n, m = B.shape
    F = np.zeros((n + m, n + m))
    F[:n, :n], F[:n, n:] = A, B
    exp = sla.expm(F * interval_s)
    return exp[:n, :n], exp[:n, n:]


def zero_order_hold_slopes(A: Floats, B: Floats, dA: Floats, dB: Floats, intervals_s: Floats) -> tuple[Floats, Floats]:
    """[Ad Bd] (G, n, n + m) for the intervals (G,), and its derivatives (G, p, n, n + m).

    ``dA`` (p, n, n) and ``dB`` (p, n, m): derivatives of A and B.  The caller balances the matrices.
    """
    n, m, p, G = *B.shape, len(dA), len(intervals_s)
    X, dX = np.empty((G, n, n + m)), np.empty((G, p, n, n + m))
    A, B, dA, dB, h = (np.ascontiguousarray(array, dtype=float) for array in (A, B, dA, dB, intervals_s))
    hold_intervals(A, B, dA, dB, h, X, dX)
    return X, dX


@array_function
def _times(left: Floats, right: Floats, out: Floats) -> None:
    """Out += left right, for left (n, n), right and out (n, q)."""
    for r in range(left.shape[0]):
        for c in range(left.shape[1]):
            if left[r, c] != 0.0:
                for j in range(right.shape[1]):
                    out[r, j] += left[r, c] * right[c, j]


@array_function
def _series(A: Floats, B: Floats, dA: Floats, dB: Floats, T: Floats, dT: Floats) -> None:
    """T (TERMS, n, n + m) and dT (TERMS, p, n, n + m); dA (p, n, n), dB (p, n, m)."""
    n = A.shape[0]
    for r in range(n):
        T[0, r, r] = 1.0
        for c in range(T.shape[2]):
            T[1, r, c] = A[r, c] if c < n else B[r, c - n]
            for i in range(dA.shape[0]):
                dT[1, i, r, c] = dA[i, r, c] if c < n else dB[i, r, c - n]
    for k in range(2, T.shape[0]):
        _times(A, T[k - 1], T[k])
        T[k] /= k
        for i in range(dA.shape[0]):
            _times(dA[i], T[k - 1], dT[k, i])
            _times(A, dT[k - 1, i], dT[k, i])
            dT[k, i] /= k


@array_function
def _square(X: Floats, dX: Floats, Y: Floats, dY: Floats) -> None:
    """X <- X X and dX_i <- dX_i X + X dX_i for the upper rows of matrices [X; 0 I]; Y, dY are scratch."""
    n = X.shape[0]
    for i in range(dX.shape[0]):
        dY[i] = 0.0
        _times(dX[i, :, :n], X, dY[i])
        _times(X[:, :n], dX[i], dY[i])
        dY[i, :, n:] += dX[i, :, n:]
    Y[:] = 0.0
    _times(X[:, :n], X, Y)
    Y[:, n:] += X[:, n:]
    X[:] = Y
    dX[:] = dY


@entry
def hold_intervals(A: Floats, B: Floats, dA: Floats, dB: Floats, h: Floats, X: Floats, dX: Floats) -> None:
    """X (G, n, n + m) = [Ad Bd] and dX (G, p, n, n + m) for the intervals h (G,), in s."""
    T = np.zeros((TERMS, X.shape[1], X.shape[2]))
    dT = np.zeros((TERMS, dX.shape[1], X.shape[1], X.shape[2]))
    Y, dY = np.zeros(X.shape[1:]), np.zeros(dX.shape[1:])
    _series(A, B, dA, dB, T, dT)
    norm = 0.0
    for r in range(A.shape[0]):
        norm = max(norm, np.abs(A[r]).sum())
    flat, dflat = T.reshape(TERMS, X[0].size), dT.reshape(TERMS, Y.size * dX.shape[1])
    for g in range(h.size):
        squarings = 0
        while norm * h[g] > 2.0**squarings and squarings < 60:
            squarings += 1
        part = h[g] / 2.0**squarings
        terms = _terms(norm * part)
        _polynomial(flat, part, terms, X[g].reshape(flat.shape[1]))
        _polynomial(dflat, part, terms, dX[g].reshape(dflat.shape[1]))
        for _ in range(squarings):
            _square(X[g], dX[g], Y, dY)


@array_function
def _terms(r: float) -> int:
    """Number of terms that the series needs for a norm r."""
    k, left = 2, r
    while k < TERMS and left > 1e-17:
        left *= r / k
        k += 1
    return k


@array_function
def _polynomial(coefficients: Floats, h: float, terms: int, out: Floats) -> None:
    """Evaluate a polynomial for each element by Horner's scheme."""
    for e in range(out.size):
        out[e] = coefficients[terms - 1, e]
    for k in range(terms - 2, -1, -1):
        for e in range(out.size):
            out[e] = out[e] * h + coefficients[k, e]
