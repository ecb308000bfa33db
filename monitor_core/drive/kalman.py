"""The predictor of an axis: its gain K from the noise of torque and output, its time constant, its stability."""

import math
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import Drive
from monitor_core.kernel.tables import GAINS

_MARGIN = 1e-6
"""For a double eigenvalue 1, for which no filter exists, the Riccati solver gives 1 - 1e-8."""
_DOUBLINGS = 40
_SETTLED = 1e-15


def filter_gain(model: AxisModel, interval_s: float, torque_noise: float, output_noise: float) -> tuple[Floats, float]:
    """Filter gain K (n,) and innovation variance lambda_0 of the steady-state Kalman filter at nominal.

        K = P C' / lambda_0,      lambda_0 = C P C' + R

    P is the variance of the one-step prediction.  ``torque_noise`` [N m]: standard deviation of a white sequence that
    acts like the torque and is held over each interval.  ``output_noise`` [rad or rad/s]: standard deviation of the
    measurement, with R its square.  Coulomb friction does not matter, as it is an input here.

    Raises:
        ValueError: a noise is negative or not finite, the output noise is zero, or there is no stable filter.
    """
    _, P, _, C, d = _steady(model, interval_s, torque_noise, output_noise)
    lam0 = float(C @ P @ C) + 1
    return _kept(model, d * (P @ C) / lam0), lam0 * output_noise**2


def _steady(
    model: AxisModel, interval_s: float, torque_noise: float, output_noise: float
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Ad, P of the one-step prediction, Q and C (n,) for the states x / d, and d; in units of the output noise."""
    if not (0 <= torque_noise < math.inf and 0 < output_noise < math.inf):
        raise ValueError(
            f"torque_noise = {torque_noise}, output_noise = {output_noise}: need finite values, "
            "the first at least zero, the second greater than zero"
        )
    Ad, G, C, d = _balanced(model, interval_s)
    # The Riccati equation is scaled best in units of the output noise: R = 1.
    g = G / output_noise * torque_noise
    try:
        return Ad, prediction_variance(Ad, C[0], g @ g.T), g @ g.T, C[0], d
    except ValueError:
        raise ValueError(
            f"no stable Kalman filter for torque_noise = {torque_noise} and output_noise = {output_noise}: "
            "with the angle as output, or without friction, the torque noise must be greater than zero"
        ) from None


def gains_after(
    model: AxisModel, interval_s: float, torque_noise: float, output_noise: float
) -> tuple[tuple[float, ...], ...]:
    """Filter gains after 0, 2, 3 .. intervals without a measurement, from the steady state (GAINS - 1 of n numbers).

    Without a measurement the prediction becomes more uncertain: P <- Ad P Ad' + Q in each interval, from the P of the
    filter.

    Raises:
        ValueError: as in ``filter_gain``.
    """
    Ad, P, Q, C, d = _steady(model, interval_s, torque_noise, output_noise)
    variances = [P - np.outer(P @ C, P @ C) / (C @ P @ C + 1), P]
    for _ in range(GAINS - 2):
        variances.append(Ad @ variances[-1] @ Ad.T + Q)
    del variances[1]
    return tuple(tuple(_kept(model, d * (P @ C) / (C @ P @ C + 1)).tolist()) for P in variances)


def prediction_variance(Ad: Floats, C: Floats, Q: Floats) -> Floats:
    """P (n, n) of the one-step prediction in steady state, for x+ = Ad x + w, y = C x + v, var w = Q, var v = I.

        P = Ad (P - P C' (C P C' + I)^-1 C P) Ad' + Q

    C is (n,).

    Raises:
        ValueError: there is no stable filter.
    """
    # The doubling algorithm (Chu, Fan, Lin, Wang 2004): step k replaces 2^k steps of the recursion; G accumulates C'C.
    A, G, P, unit = Ad.T, np.outer(C, C), Q, np.eye(len(Ad))
    for _ in range(_DOUBLINGS):
        AW = np.linalg.solve((unit + G @ P).T, A.T).T
        before, A, G, P = P, AW @ A, G + AW @ G @ A.T, P + A.T @ P @ np.linalg.solve(unit + G @ P, A)
        P = (P + P.T) / 2
        if not np.isfinite(P).all():
            break
        if abs(P - before).max() <= _SETTLED * abs(P).max():
            break
    if np.isfinite(P).all():
        closed = Ad - np.outer(P @ C / (C @ P @ C + 1), C @ Ad)
        if np.abs(np.linalg.eigvals(closed)).max() < 1 - _MARGIN:
            return P
    raise ValueError("no stable filter")


def held_disturbance(interval_s: float, time_constant_s: float) -> float:
    """Standard deviation of w, held over each interval, for which d has standard deviation 1:  d' = -d / Td + w."""
    a = math.exp(-interval_s / time_constant_s)
    return math.sqrt((1 + a) / (1 - a)) / time_constant_s


def slowest_time_constant(model: AxisModel, K: Floats, interval_s: float) -> float:
    """Slowest time constant [s] of the predictor (I - K C) Ad with filter gain K (n,); inf if it is unstable."""
    Ad, _, C, d = _balanced(model, interval_s)
    closed = Ad - np.outer(K / d, C[0] @ Ad)
    radius = float(np.abs(np.linalg.eigvals(closed)).max())
    if radius >= 1:
        return math.inf
    return -interval_s / math.log(radius) if radius > 0 else 0.0


def _balanced(model: AxisModel, interval_s: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Ad (n, n), the columns of Bd for the torque (n, q) and C (1, n), for the states x / d; and d (n,)."""
    A, B, C = model.matrices()
    d = model.balance()
    enters = B[:, model.drive.of_torque]
    Ad, G = zero_order_hold(A / d[:, np.newaxis] * d, enters / d[:, np.newaxis], interval_s)
    if (s := model.drive.mean_state) >= 0:  # y = s / h, and with each sample s is zero again
        Ad[:, s], C = 0.0, C / interval_s
    return Ad, G, C * d, d


def _kept(model: AxisModel, K: Floats) -> Floats:
    """The gain K, with 0 for the state that is reset after the correction, if there is one."""
    if (s := model.drive.mean_state) >= 0:
        K[s] = 0.0
    return K


# --- Range of theta: within its bounds, and where the predictor is stable (D_M of Ljung and Soderstrom) ---------------

_STABLE = 1e-6
_FAR = 1e3
"""Distance in sizes that replaces an infinite bound."""
_BISECTIONS = 30


def stable_limits(model: AxisModel, K: Floats, interval_s: float) -> Floats:
    """Bounds of theta (2, p), narrowed to where the predictor with filter gain K (n,) is stable.

    If it is unstable at the nominal values themselves, the bounds are not changed.
    """
    values = tuple(tuple(sorted(part.items())) for part in (model.nominal, model.scales, model.bounds))
    gain = tuple(np.ravel(K).tolist())
    return _known(model.drive, values, model.monitored, gain, interval_s).copy()


@lru_cache(maxsize=4096)
def _known(
    drive: Drive,
    values: tuple[Any, ...],
    monitored: tuple[str, ...],
    gain: tuple[float, ...],
    interval_s: float,
) -> Floats:
    nominal, scales, bounds = (dict(part) for part in values)
    return _drawn_in(AxisModel(drive, nominal, monitored, scales, bounds), np.array(gain), interval_s)


def _drawn_in(model: AxisModel, K: Floats, interval_s: float) -> Floats:
    theta0, limits, p = model.theta0, model.limits, len(model.theta0)
    if not _stable(model, theta0[np.newaxis], K, interval_s)[0]:
        return limits
    far = np.clip(limits, theta0 - _FAR * model.scale, theta0 + _FAR * model.scale)
    ends = np.tile(theta0, (2, p, 1))
    ends[:, range(p), range(p)] = far
    good = _stable(model, ends.reshape(-1, p), K, interval_s).reshape(2, p)
    out = limits.copy()
    for side, i in np.argwhere(~good).tolist():
        out[side, i] = _last_stable(model, i, far[side, i], K, interval_s)
    return out


def _last_stable(model: AxisModel, i: int, unstable: float, K: Floats, interval_s: float) -> float:
    """Last stable value of theta_i, by bisection between its nominal value and an unstable value."""
    stable, theta = float(model.theta0[i]), model.theta0[np.newaxis].copy()
    for _ in range(_BISECTIONS):
        theta[0, i] = (stable + unstable) / 2
        if _stable(model, theta, K, interval_s)[0]:
            stable = float(theta[0, i])
        else:
            unstable = float(theta[0, i])
    return stable


def _stable(model: AxisModel, thetas: Floats, K: Floats, interval_s: float) -> NDArray[np.bool_]:
    """Whether (I - K C) Ad is stable at each theta (points, p); K (n,)."""
    d = model.balance()
    A, _, C = (np.array(parts) for parts in zip(*map(model.matrices, thetas), strict=True))
    C = C * d
    Ad = sla.expm(A / d[:, np.newaxis] * d * interval_s)
    if (s := model.drive.mean_state) >= 0:  # y = s / h, and with each sample s is zero again
        Ad[:, :, s], C = 0.0, C / interval_s
    closed = Ad - (K / d)[:, np.newaxis] * (C @ Ad)
    closed = np.where(np.isfinite(closed), closed, 1e300)
    return np.asarray(np.abs(np.linalg.eigvals(closed)).max(axis=1) < 1 - _STABLE)
