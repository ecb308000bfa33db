"""Finds a torque without its sign, such as the rms of a current: it is never negative, whatever the axis does.

If the signs are chosen so that the torque of one mass with friction fits, it explains nearly all of such a torque.
"""

from collections.abc import Iterator

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.record_checks.findings import RecordFinding
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import POSE, USUAL

_NEVER, _LARGE = 0.02, 0.98
"""Such a torque is never below minus this part of its large values, their quantile"""
_LESS_LEFT = 5.0
"""With signs, one mass leaves less of the torque unexplained by this factor than one mass with a weight leaves of it as
it is."""
_LAGS = (2, 4, 8, 16)
"""Samples over which speed and acceleration are measured"""
_ROUNDS = 10
"""Most rounds, each of which takes the signs of the torque that the fit before expects"""


def unsigned(record: Record) -> Iterator[RecordFinding]:
    """A torque without its sign."""
    share = _share_with_signs(record)
    if share is not None:
        yield RecordFinding(
            "unsigned",
            "refuse",
            "the torque is never negative: it has lost its sign, as the rms of a current has, since one mass explains"
            f" {100 * share:.0f} % of it with signs that fit the motion; record torque or current with the sign",
            share,
        )


def _share_with_signs(record: Record) -> float | None:
    """Share of the torque that one mass explains if it gets signs; None: it has them."""
    if record.u.min() < -_NEVER * float(np.quantile(abs(record.u), _LARGE)):
        return None
    scale = speed_scales([record])[1]
    own = max((fit.explained for fit in rigid_fits([record], [POSE, USUAL], scale) if fit is not None), default=0.0)
    explained = 0.0
    for lag in _LAGS:
        signed = Record(record.t, record.u * _signs(record, lag), record.y, record.quantity, record.name)
        (fit,) = rigid_fits([signed], [USUAL], scale)
        explained = max(explained, 0.0 if fit is None else fit.explained)
    return explained if _LESS_LEFT * (1 - explained) < 1 - own else None


def _signs(record: Record, lag: int) -> Floats:
    """Signs (N,) of the torque with which one mass explains most of it."""
    y = np.interp(record.t, record.t[record.measured], record.y[record.measured])
    h = lag * record.interval_s
    around = np.pad(y, lag, mode="edge")
    before, after = around[: -2 * lag], around[2 * lag :]
    if record.quantity == "angle":
        v, a = (after - before) / (2 * h), (after - 2 * y + before) / h**2
    else:
        v, a = y, (after - before) / (2 * h)
    rows = np.column_stack([a, v, np.sign(v), np.ones_like(v)])
    signs = np.sign(v)
    for _ in range(_ROUNDS):
        last, signs = signs, np.sign(rows @ np.linalg.lstsq(rows, record.u * signs, rcond=None)[0])
        if (signs == last).all():
            break
    return np.asarray(np.where(signs == 0, 1.0, signs))
