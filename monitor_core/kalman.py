"""Gain K of the innovations form, from the noise of torque and output."""

import math

import numpy as np
import scipy.linalg as sla

from monitor_core.discretize import zero_order_hold
from monitor_core.kernel.tables import TORQUE, Floats
from monitor_core.model import AxisModel

_MARGIN = 1e-6
"""A double eigenvalue 1, which has no filter, comes out of the Riccati solver as 1 - 1e-8."""


def filter_gain(
    model: AxisModel, interval_s: float, torque_noise: float, output_noise: float
) -> tuple[Floats, float]:
    """Filter gain K (n,) and innovation variance lambda_0 of the steady-state Kalman filter at nominal.

        K = P C' / lambda_0,      lambda_0 = C P C' + R

    P is the variance of the one-step prediction.  ``torque_noise`` [N m] is the standard deviation of a white
    sequence that enters like the torque, held over each interval; ``output_noise`` [rad or rad/s] that of the
    measurement, R its square.  Coulomb friction is left out: it is an input here.

    Raises:
        ValueError: a noise that is negative or not finite, no output noise, or no stable filter.
    """
    if not (0 <= torque_noise < math.inf and 0 < output_noise < math.inf):
        raise ValueError(
            f"torque_noise = {torque_noise}, output_noise = {output_noise}: need finite values, "
            "the first at least zero, the second greater than zero"
        )
    Ad, Bd, C, d = _balanced(model, interval_s)
    # In units of the output noise, R = 1: the Riccati equation then is as well scaled as it can be.
    b = Bd * (torque_noise / output_noise)
    try:
        P = sla.solve_discrete_are(Ad.T, C.T, b @ b.T, np.eye(1))
    except (np.linalg.LinAlgError, ValueError):
        raise ValueError(_no_filter(torque_noise, output_noise)) from None
    lam0 = float((C @ P @ C.T)[0, 0]) + 1
    K = (P @ C.T)[:, 0] / lam0
    if not _radius(Ad, C, K) < 1 - _MARGIN:
        raise ValueError(_no_filter(torque_noise, output_noise))
    return d * K, lam0 * output_noise**2


def slowest_time_constant(model: AxisModel, K: Floats, interval_s: float) -> float:
    """Slowest time constant [s] of the predictor with filter gain K (n,): of (I - K C) Ad; inf: unstable."""
    Ad, _, C, d = _balanced(model, interval_s)
    radius = _radius(Ad, C, np.asarray(K) / d)
    if radius >= 1:
        return math.inf
    return -interval_s / math.log(radius) if radius > 0 else 0.0


def _balanced(model: AxisModel, interval_s: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Ad, the torque's column of Bd, C in the coordinates x / d, and d (n,)."""
    A, B, C = model.matrices()
    d = model.balance()
    torque = [kind == TORQUE for kind in model.drive.inputs]
    Ad, Bd = zero_order_hold(A / d[:, np.newaxis] * d, B[:, torque] / d[:, np.newaxis], interval_s)
    return Ad, Bd, C * d, d


def _radius(Ad: Floats, C: Floats, K: Floats) -> float:
    return float(np.abs(np.linalg.eigvals(Ad - np.outer(K, C @ Ad))).max())


def _no_filter(torque_noise: float, output_noise: float) -> str:
    return (
        f"no stable Kalman filter for torque_noise = {torque_noise} and output_noise = {output_noise}: "
        "with the angle as output, or without friction, the torque noise must be greater than zero"
    )
