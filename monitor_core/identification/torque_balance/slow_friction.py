"""Slow motion in which friction falls with the speed (Stribeck 1902), other than fm and fc describe.

    fc sign(w) (1 + s exp(-(w / w_s)^2)) + fm w

Fitted without s, as the drives have friction, fc becomes too large and fm too small, and the terms of links that follow
the pose take part of what is left.  So slow motion is left out of the fit, and by the monitor, if s explains clearly
more of the torque balance, and enough motion remains.  w_s is the one of some speeds that explains most.
"""

from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import SHORTEST, speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    SIGNAL,
    USUAL,
    GridPart,
    TorqueTerm,
    integrals,
    moving_windows,
    residual_torque,
    rms_speed,
    speed_of,
    standing_speed,
    window_of,
    windowed_equations,
    windowed_parts,
)

_SHARES = (0.05, 0.08, 0.12, 0.2)
"""Speeds w_s that come into question, as shares of the root mean square of the speed."""
_BEYOND = 1.5
"""Multiple of w_s above which a tenth of s is left."""
_CLEARLY_LESS = 0.95
"""Share of the squared errors, with values from the other half, that the balance with s leaves at most."""
_REMAINS = 0.5
"""Share of the motion that must remain at least."""
_FEWEST = 400
"""Equations for which the two halves tell such a difference."""


def slow_friction_speed(records: Sequence[Record]) -> float:
    """Speed below which friction is not that of fm and fc, rad/s at the sensor; 0: as far as the records show, nowhere.

    ``records``: of links that load the axis they have the torque as the signal SIGNAL.
    """
    parts = [part for part in windowed_parts(records) if len(part.u) > SHORTEST]
    stands, rms = standing_speed(parts), rms_speed(records)
    if not stands:
        return 0.0
    terms: tuple[TorqueTerm, ...] = (*USUAL, "signal") if all(SIGNAL in part.signals for part in parts) else USUAL
    scale = speed_scales(records)[0]
    columns = [windowed_equations(part, SHORTEST, scale, terms) for part in parts]
    moving = np.concatenate([moving_windows(part, SHORTEST, stands) for part in parts])
    rows = np.concatenate([left for left, _ in columns])[moving]
    torque = np.concatenate([right for _, right in columns])[moving]
    if len(torque) < _FEWEST:
        return 0.0

    def error(share: float) -> float:
        falling = np.concatenate([_falling(part, scale, share * rms) for part in parts])[moving]
        more = np.column_stack([rows, falling])
        rises = np.linalg.lstsq(more, torque, rcond=None)[0][-1] <= 0
        return np.inf if rises else _error(more, torque)

    best = min(_SHARES, key=error)
    speed = _BEYOND * best * rms
    remains = np.concatenate([moving_windows(part, SHORTEST, speed) for part in parts])
    if error(best) > _CLEARLY_LESS * _error(rows, torque) or np.mean(remains[moving]) < _REMAINS:
        return 0.0
    return float(speed)


def _falling(part: GridPart, scale: float, speed: float) -> Floats:
    """Integrals (M,) over windows of the friction that falls with the speed, per unit of fc s."""
    w = speed_of(part, SHORTEST // 8)
    return integrals(part, window_of(SHORTEST, part.h)[0], np.tanh(w / scale) * np.exp(-((w / speed) ** 2)))


def _error(rows: Floats, torque: Floats) -> float:
    """Squared errors of each half with values from the other."""
    halves = slice(None, len(torque) // 2), slice(len(torque) // 2, None)
    return float(sum(np.sum(residual_torque(rows, torque, *pair) ** 2) for pair in (halves, halves[::-1])))
