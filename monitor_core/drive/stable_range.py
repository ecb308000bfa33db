"""The range of theta: within its bounds, and where the predictor is stable (D_M of Ljung and Soderstrom)."""

from functools import lru_cache
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive

_STABLE = 1e-6
_FAR = 1e3
"""Sizes: in place of a bound that is infinite."""
_BISECTIONS = 30


def stable_limits(model: AxisModel, K: Floats, interval_s: float) -> Floats:
    """Bounds of theta (2, p), reduced as far as the predictor with filter gain K (n,) needs it.

    Where it is unstable at the nominal values themselves the bounds are not changed.
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
    """By bisection between the nominal value and an unstable one."""
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
