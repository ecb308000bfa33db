"""By how many samples the torque of a record comes later than the motion that it has caused.

A drive that measures its current filters it, and passes it on later than the angle of the encoder.  The balance of a
rigid mass then lacks the inertia times the change of the acceleration in that time, which no friction explains.
"""

from collections.abc import Sequence

import numpy as np

from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    USUAL,
    GridPart,
    least_speed,
    moving_windows,
    residual_torque,
    windowed_equations,
    windowed_parts,
)

_MOST = 10
"""Samples that a torque may be late, as many as the configuration takes: a PLC filters over some of its slow ones."""
_AS_GOOD = 2.0
"""Times what the best shift leaves: the same motion a period later explains as much, and the earliest one counts."""
_WINDOW = 24
"""Samples of a window: short, since what is late shows in fast changes."""
_FEWEST = 200
"""Equations that tell it."""
_LESS = 0.3
"""Of what is unexplained: a shift that does not leave less is none.  So a torque that is late by less than 0.65 samples
stays where it is."""


def samples_late(records: Sequence[Record]) -> int:
    """By how many samples the torque comes late: as explains most of it by the motion; zero, where nothing tells it."""
    parts, scale = windowed_parts(records), speed_scales(records)[0]
    if not scale > 0:
        return 0
    least = least_speed(parts) or 0.0
    left = [_unexplained([_earlier(part, k) for part in parts], scale, least) for k in range(_MOST + 1)]
    best = next((k for k, rest in enumerate(left) if rest <= _AS_GOOD * min(left)), 0)
    while best < _MOST and left[best + 1] < left[best]:
        best += 1
    return best if left[best] < _LESS * left[0] < np.inf else 0


def _earlier(part: GridPart, samples: int) -> GridPart:
    """The part with the torque so many samples earlier."""
    end = len(part.u) - samples
    return part._replace(u=part.u[samples:], y=part.y[:end], signals={})


def _unexplained(parts: Sequence[GridPart], scale: float, least: float) -> float:
    """Mean square of the change of the torque from window to window that a rigid mass does not explain.

    Of the changes: what depends on the pose changes slowly.
    """
    rows, torque = [np.zeros((0, 1 + len(USUAL)))], [np.zeros(0)]
    for part in parts:
        if len(part.u) > _WINDOW:
            columns, right = windowed_equations(part, _WINDOW, scale, USUAL)
            moves = moving_windows(part, _WINDOW, least)
            both = moves[1:] & moves[:-1]
            rows.append(np.diff(columns, axis=0)[both])
            torque.append(np.diff(right)[both])
    if sum(map(len, torque)) < _FEWEST:
        return np.inf
    return float(np.mean(residual_torque(np.concatenate(rows), np.concatenate(torque)) ** 2))
