"""The recursive prediction error method, one sample (paper eq. 11-20, innovations form of the predictor).

Each function does its lines for all lanes; ``on`` (W,) is 1 where a lane takes part and 0 where it must stay as
it is, which is done by selection and not by multiplication, so that a lane at rest keeps its very bits.
"""

from typing import Any

from numba import njit

from monitor_core.kernel.state import State
from monitor_core.kernel.tables import Constants, Floats, Ints, Tables


@njit(cache=True, nogil=True)
def predict(lanes: Any, tables: Tables, V: Floats, X: Floats, yhat: Floats, psi: Floats) -> None:
    """Prediction yhat = C x (W,) and its gradient psi_i = C z_i + C_i x (p, W)   (eq. 16-17)."""
    p = tables.p
    for a in range(len(lanes)):
        yhat[a] = 0.0
    for i in range(p):
        for a in range(len(lanes)):
            psi[i, a] = 0.0
    for s in range(tables.ends[1], tables.ends[2]):
        c = tables.col[s]
        for a in range(len(lanes)):
            yhat[a] += V[s, a] * X[p, c, a]
        for i in range(p):
            for a in range(len(lanes)):
                psi[i, a] += V[s, a] * X[i, c, a]
    for s in range(tables.ends[4], tables.ends[5]):
        i, c = tables.par[s], tables.col[s]
        for a in range(len(lanes)):
            psi[i, a] += V[s, a] * X[p, c, a]


@njit(cache=True, nogil=True)
def gain(lanes: Any, p: int, con: Constants, P: Floats, psi: Floats, Ppsi: Floats, S: Floats) -> None:
    """P psi (p, W) and S = lambda + psi' P psi (W,)   (eq. 12-13)."""
    for a in range(len(lanes)):
        S[a] = con.lam[a]
    for i in range(p):
        for a in range(len(lanes)):
            Ppsi[i, a] = 0.0
        for j in range(p):
            for a in range(len(lanes)):
                Ppsi[i, a] += P[i, j, a] * psi[j, a]
        for a in range(len(lanes)):
            S[a] += psi[i, a] * Ppsi[i, a]


@njit(cache=True, nogil=True)
def update_theta(
    lanes: Any, p: int, con: Constants, st: State, eps: Floats, Ppsi: Floats, S: Floats, on: Ints, hit: Ints
) -> None:
    """theta = theta + L eps, L = P psi / S (eq. 11), projected into its bounds; hit (W,) is 1 where they held it."""
    for a in range(len(lanes)):
        hit[a] = 0
    for i in range(p):
        for a in range(len(lanes)):
            free = st.theta[i, a] + Ppsi[i, a] * eps[a] / S[a]
            bound = min(max(free, con.lower[i, a]), con.upper[i, a])
            if on[a]:
                st.theta[i, a] = bound
                if bound != free:
                    hit[a] = 1


@njit(cache=True, nogil=True)
def update_P(lanes: Any, p: int, con: Constants, P: Floats, Ppsi: Floats, S: Floats, on: Ints) -> None:
    """P = (P - P psi psi' P / S) / lambda (eq. 13).

    One triangle is computed and mirrored: an antisymmetric part would grow like lambda^-t until P is indefinite.
    """
    for i in range(p):
        for j in range(i, p):
            for a in range(len(lanes)):
                new = (P[i, j, a] - Ppsi[i, a] * Ppsi[j, a] / S[a]) / con.lam[a]
                P[i, j, a] = new if on[a] else P[i, j, a]
                P[j, i, a] = P[i, j, a]


@njit(cache=True, nogil=True)
def correct(lanes: Any, tables: Tables, con: Constants, X: Floats, eps: Floats, psi: Floats, on: Ints) -> None:
    """x = x + K eps and z_i = z_i - K psi_i: the innovations form; K = 0 is the paper."""
    n, p = tables.n, tables.p
    for r in range(n):
        for a in range(len(lanes)):
            step = con.K[r, a] * eps[a]
            X[p, r, a] += step if on[a] else 0.0
        for i in range(p):
            for a in range(len(lanes)):
                step = con.K[r, a] * psi[i, a]
                X[i, r, a] -= step if on[a] else 0.0


@njit(cache=True, nogil=True)
def running_variance(lanes: Any, con: Constants, st: State, eps: Floats, S: Floats, on: Ints) -> None:
    """Running innovation variance: eps^2 has the mean lam0 (1 + psi' P psi / (1 + lambda)) in steady state."""
    for a in range(len(lanes)):
        excess = (S[a] - con.lam[a]) / (1.0 + con.lam[a])
        step = (1.0 - con.lam_slow[a]) * (eps[a] * eps[a] / (1.0 + excess) - st.lam0_running[a])
        st.lam0_running[a] += step if on[a] else 0.0


@njit(cache=True, nogil=True)
def find_P0(lanes: Any, p: int, con: Constants, st: State, on: Ints) -> None:
    """P(0) by the paper's recipe: run the P recursion along the nominal theta, average its steady diagonal.

    The second half of the run counts as steady.  At its end P becomes the averaged diagonal.
    """
    for a in range(len(lanes)):
        if not on[a]:
            continue
        half = con.seed[a] // 2
        if st.seed_left[a] <= half:
            for i in range(p):
                st.P_sum[i, a] += st.P[i, i, a]
        st.seed_left[a] -= 1
        if st.seed_left[a] == 0:
            for i in range(p):
                for j in range(p):
                    st.P[i, j, a] = 0.0
                st.P[i, i, a] = st.P_sum[i, a] / half
