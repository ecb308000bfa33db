"""The recursive prediction error method, one sample (paper eq. 11-20, innovations form of the predictor).

Each function does its step for all lanes.  ``on`` (W,) is 1 for lanes that take part, and 0 for lanes that must not
change.  This uses selection and not multiplication, so that such a lane keeps its exact bits.
"""

import math
from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import SEED
from monitor_core.kernel.compile import kernel
from monitor_core.kernel.state import OBSERVED, UNSEEN
from monitor_core.kernel.tables import OutputTerms


@kernel
def predict(lanes: Any, outputs: OutputTerms, V: Floats, X: Floats, yhat: Floats, psi: Floats) -> None:
    """Prediction yhat = C x (W,) and its gradient psi_i = C z_i + C_i x (p, W)   (eq. 16-17)."""
    for a in range(len(lanes)):
        yhat[a] = 0.0
    for i in range(psi.shape[0]):
        for a in range(len(lanes)):
            psi[i, a] = 0.0
    add_products(lanes, outputs, V, X, yhat, psi)


@kernel
def add_products(lanes: Any, terms: OutputTerms, V: Floats, X: Floats, yhat: Floats, psi: Floats) -> None:
    """Add products of a row of A, B or C, and of its derivatives, to a number (W,) and its gradient (p, W)."""
    slot, src, par = terms.slot, terms.src, terms.par
    for q in range(slot.size):
        s, c, i = slot[q], src[q], par[q]
        if i < 0:
            for a in range(len(lanes)):
                yhat[a] += V[s, a] * X[c, a]
        else:
            for a in range(len(lanes)):
                psi[i, a] += V[s, a] * X[c, a]


@kernel
def gain(lanes: Any, lam: Floats, P: Floats, psi: Floats, Ppsi: Floats, S: Floats) -> None:
    """P psi (p, W) and S = lambda + psi' P psi (W,)   (eq. 12-13)."""
    for a in range(len(lanes)):
        S[a] = lam[a]
    for i in range(psi.shape[0]):
        for a in range(len(lanes)):
            Ppsi[i, a] = 0.0
        for j in range(psi.shape[0]):
            for a in range(len(lanes)):
                Ppsi[i, a] += P[i, j, a] * psi[j, a]
        for a in range(len(lanes)):
            S[a] += psi[i, a] * Ppsi[i, a]


@kernel
def update_theta(
    lanes: Any,
    lower: Floats,
    upper: Floats,
    theta: Floats,
    observed: Ints,
    eps: Floats,
    Ppsi: Floats,
    S: Floats,
    on: Ints,
    hit: Ints,
    moved: Floats,
) -> None:
    """theta = theta + L eps, L = P psi / S (eq. 11), projected into its bounds; hit (W,) is 1 if a bound was active.

    A parameter that is not observed stays (supervision.py).  ``moved`` (p, W): change of theta.
    """
    for a in range(len(lanes)):
        hit[a] = 0
    for i in range(theta.shape[0]):
        for a in range(len(lanes)):
            free = theta[i, a] + Ppsi[i, a] * eps[a] / S[a]
            bound = min(max(free, lower[i, a]), upper[i, a])
            moved[i, a] = 0.0
            if on[a] and observed[i, a] != UNSEEN and math.isfinite(free):
                moved[i, a] = bound - theta[i, a]
                theta[i, a] = bound
                if bound != free:
                    hit[a] = 1


@kernel
def update_P(lanes: Any, lam: Floats, P: Floats, Ppsi: Floats, S: Floats, on: Ints, fit: Ints) -> None:
    """P = (P - P psi psi' P / S) / lambda (eq. 13), unless rounding takes its diagonal out of the positive numbers.

    One triangle is computed and mirrored: an antisymmetric part would grow like lambda^-t until P is indefinite.
    """
    for a in range(len(lanes)):
        fit[a] = on[a]
    for i in range(P.shape[0]):
        for a in range(len(lanes)):
            new = (P[i, i, a] - Ppsi[i, a] * Ppsi[i, a] / S[a]) / lam[a]
            fit[a] = fit[a] if 0.0 < new < math.inf else 0
    for i in range(P.shape[0]):
        for j in range(i, P.shape[0]):
            for a in range(len(lanes)):
                new = (P[i, j, a] - Ppsi[i, a] * Ppsi[j, a] / S[a]) / lam[a]
                P[i, j, a] = new if fit[a] else P[i, j, a]
                P[j, i, a] = P[i, j, a]


@kernel
def correct(lanes: Any, K: Floats, X: Floats, eps: Floats, psi: Floats, on: Ints) -> None:
    """x = x + K eps and z_i = z_i - K psi_i: the innovations form; K = 0 is the paper."""
    n, p = K.shape[0], psi.shape[0]
    for r in range(n):
        for i in range(p):
            for a in range(len(lanes)):
                step = K[r, a] * psi[i, a]
                X[i * n + r, a] -= step if on[a] else 0.0
        for a in range(len(lanes)):
            step = K[r, a] * eps[a]
            X[p * n + r, a] += step if on[a] else 0.0


@kernel
def propagate_joint(lanes: Any, joint: Floats, X: Floats, moved: Floats) -> None:
    """x = x + sum z_i (change of theta_i), where ``joint`` (W,) is 1: the x that the new theta would have given.

    Apart from forgetting, this is the only difference between this recursion and the extended Kalman filter for state
    and parameters (Friedland's separation: the cross covariance of x and theta is z P).
    """
    p = moved.shape[0]
    n = X.shape[0] // (p + 1)
    for i in range(p):
        for r in range(n):
            for a in range(len(lanes)):
                X[p * n + r, a] += X[i * n + r, a] * moved[i, a] if joint[a] > 0.0 else 0.0


@kernel
def find_P0(
    lanes: Any,
    min_excitation: Floats,
    P_uninformed: Floats,
    seed: Floats,
    seed_left: Ints,
    P_nom: Floats,
    P: Floats,
    mode: Ints,
    observed: Ints,
) -> None:
    """P(0) by the paper's recipe: run the P recursion along the nominal theta, average its steady diagonal.

    The second half of the run counts as steady.  At its end P becomes the averaged diagonal P_nom (until then P_nom is
    the sum).  If a parameter is then no better known than its size, because the axis stood still, the run starts again;
    until its end that parameter counts as unobserved, and the others as observed.
    """
    for a in range(len(lanes)):
        if mode[a] != SEED:
            continue
        half = seed[a] // 2
        if seed_left[a] <= half:
            for i in range(P.shape[0]):
                P_nom[i, a] += P[i, i, a]
        seed_left[a] -= 1
        if seed_left[a] == 0:
            again = False
            for i in range(P.shape[0]):
                P_nom[i, a] /= half
                again |= min_excitation[a] > 0.0 and not P_nom[i, a] <= P_uninformed[i, a]
            for i in range(P.shape[0] if again else 0):
                observed[i, a] = OBSERVED if P_nom[i, a] <= P_uninformed[i, a] else UNSEEN
            for i in range(P.shape[0]):
                for j in range(P.shape[0]):
                    P[i, j, a] = 0.0
                P[i, i, a] = P_uninformed[i, a] if again else P_nom[i, a]
                P_nom[i, a] = 0.0 if again else P_nom[i, a]
            seed_left[a] = int(seed[a]) if again else 0
