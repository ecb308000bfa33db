"""K of the innovations form from the noise levels, and its derivatives: the Riccati equation differentiated.

    P  = Ad P+ Ad' + Q,       P+ = (I - K C) P (I - K C)' + K K',       K = P C' / S,  S = C P C' + 1

in units of the output noise.  P+ does not change with K to first order, so with Phi = Ad (I - K C)

    dP = Phi dP Phi' + dAd P+ Ad' + Ad P+ dAd' + dQ - Ad (K dC P (I - K C)' + transposed) Ad'

a Lyapunov equation for each parameter, all with the same matrix.  K is the filter gain: x+ = x + K eps.  The gain of
the one-step predictor, x(t+1) = Ad x + Bd u + K_p eps, is Ad K.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.kalman import held_disturbance, prediction_variance
from monitor_core.identification.predictor.held_drive import LinearDrive, hold, with_mean_state


class Levels(NamedTuple):
    """Standard deviations of noise over that of the output."""

    torque: float  # white, held over each interval
    slow: float  # of d
    time_constant_s: float  # of d; infinite: the drive has no such state
    interval_s: float
    unit: float  # of the state d in the drive's coordinates, N m


class Gain(NamedTuple):
    """K and its derivatives."""

    K: Floats  # (n,)
    dK: Floats  # (n, p + levels)
    S: float  # variance of eps over that of the output's noise


def gain(
    system: LinearDrive,
    torque: NDArray[np.bool_],
    at: Levels,
    free: Sequence[str],
    time_constant: int | None,
    mean: int = -1,
) -> Gain:
    """K of the drive in its coordinates, and derivatives: by its p parameters, then by the ``free`` levels.

    ``torque`` (m,) says which inputs are the motor torque, ``time_constant`` which parameter is that of d, ``mean``
    which state a mean speed is taken from, -1: none is measured.

    Raises:
        ValueError: there is no stable filter.
    """
    enters = _noise_inputs(system, torque, at)
    held = hold(enters, np.array([at.interval_s]))
    if mean >= 0:
        held = with_mean_state(held, mean, np.array([at.interval_s]))
    n = len(system.A)
    Ad, G, dX = held.X[0, :, :n], held.X[0, :, n:], held.dX[0]
    s2, ds2 = _variances(at, torque, G.shape[1])
    P = prediction_variance(Ad, system.C, G * s2 @ G.T)
    dQ = _plus_transposed(dX[:, :, n:] * s2 @ G.T)
    if time_constant is not None:
        dQ[time_constant] += G * ds2["time_constant"] @ G.T
    dQ = np.concatenate([dQ, *((G * ds2[name] @ G.T)[None] for name in free)])
    zeros = np.zeros((len(free), n, n))
    dC = np.hstack([system.dC, np.zeros((n, len(free)))])
    return _differentiated(Ad, system.C, P, np.concatenate([dX[:, :, :n], zeros]), dC, dQ)


def _noise_inputs(system: LinearDrive, torque: NDArray[np.bool_], at: Levels) -> LinearDrive:
    """The drive with the inputs by which noise enters: those of the torque, and the last state d, if there is one."""
    n, p = len(system.A), system.dA.shape[2]
    ends = np.eye(n)[:, n - 1 :] / at.unit if math.isfinite(at.time_constant_s) else np.zeros((n, 0))
    slopes = np.zeros((n, ends.shape[1], p))
    return system._replace(
        B=np.hstack([system.B[:, torque], ends]), dB=np.concatenate([system.dB[:, torque], slopes], axis=1)
    )


def _variances(at: Levels, torque: NDArray[np.bool_], q: int) -> tuple[Floats, dict[str, Floats]]:
    """Variance of each held noise (q,), and its derivatives by the levels and by the time constant."""
    white, slow = np.zeros(q), np.zeros(q)
    white[: torque.sum()] = 1.0
    rate = 0.0
    if math.isfinite(at.time_constant_s):
        T, h = at.time_constant_s, at.interval_s
        slow[-1] = held_disturbance(h, T) ** 2
        a = math.exp(-h / T)
        rate = 2 * at.slow**2 * (slow[-1] * a * h / (T**2 * (1 - a**2)) - slow[-1] / T)
    return at.torque**2 * white + at.slow**2 * slow, {
        "torque": 2 * at.torque * white,
        "slow": 2 * at.slow * slow,
        "time_constant": np.where(slow > 0, rate, 0.0),
    }


def _differentiated(Ad: Floats, C: Floats, P: Floats, dAd: Floats, dC: Floats, dQ: Floats) -> Gain:
    """All k derivatives at once: dAd, dQ (k, n, n), dC (n, k)."""
    n = len(Ad)
    S = float(C @ P @ C) + 1
    K = P @ C / S
    J = np.eye(n) - np.outer(K, C)
    Pplus = J @ P @ J.T + np.outer(K, K)
    Phi = Ad @ J
    moved = (Ad @ K)[:, None] * (dC.T @ (P @ Phi.T))[:, None, :]
    W = _plus_transposed(dAd @ (Pplus @ Ad.T) - moved) + dQ
    lyapunov = sla.lu_factor(np.eye(n * n) - np.kron(Phi, Phi))
    dP = sla.lu_solve(lyapunov, W.reshape(-1, n * n).T).T.reshape(-1, n, n)
    dS = dP @ C @ C + 2 * (C @ P @ dC)
    return Gain(K, ((dP @ C).T + P @ dC - np.outer(K, dS)) / S, S)


def _plus_transposed(M: Floats) -> Floats:
    """M + M' for each matrix."""
    return np.asarray(M + np.swapaxes(M, -1, -2))
