"""Finds by how many samples the torque of a record is later than the motion that it has caused.

A drive that measures its current filters it, and passes it on later than the angle of the encoder.  The balance of a
rigid mass then lacks the inertia times the change of the acceleration in that time, which no friction explains.
"""

from collections.abc import Sequence

import numpy as np

from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_time import unexplained_changes
from monitor_core.identification.torque_balance.torque_windows import GridPart, least_speed, windowed_parts

_MOST = 10
"""Largest delay in samples, as in the configuration: a PLC may filter over several of its slow samples."""
_AS_GOOD = 2.0
"""A shift is as good as the best if it leaves at most this multiple unexplained; the smallest such shift is used, as a
periodic motion explains as much a period later."""
_WINDOW = 24
"""Number of samples in a window, which is short, as a delay shows in fast changes."""
_FEWEST = 200
"""Least number of equations."""
_LESS = 0.3
"""A shift must reduce the unexplained torque to this share, of that without it and of that with a shift twice as large,
which is as wrong the other way.  So a delay below 0.65 samples is not corrected.  A force that no motion explains, such
as that of a gun or a gripper that closes, is explained less badly the farther it is shifted, and is no delay."""


def samples_late(records: Sequence[Record]) -> int:
    """Delay of the torque in samples with which the motion explains most of it; zero if it cannot be determined."""
    parts, scale = windowed_parts(records), speed_scales(records)[0]
    if not scale > 0:
        return 0
    least = least_speed(parts) or 0.0

    def unexplained(samples: int) -> float:
        return _unexplained([_earlier(part, samples) for part in parts], scale, least)

    left = [unexplained(k) for k in range(2 * _MOST + 1)]
    best = next((k for k, rest in enumerate(left) if rest <= _AS_GOOD * min(left)), 0)
    while best < 2 * _MOST and left[best + 1] < left[best]:
        best += 1
    if not left[best] < _LESS * left[0] < np.inf:
        return 0
    return min(best, _MOST) if left[best] < _LESS * unexplained(2 * best) else 0


def _earlier(part: GridPart, samples: int) -> GridPart:
    """The part with the torque so many samples earlier."""
    end = len(part.u) - samples
    return part._replace(u=part.u[samples:], y=part.y[:end], signals={})


def _unexplained(parts: Sequence[GridPart], scale: float, least: float) -> float:
    """Mean square of the change of the torque from window to window that a rigid mass does not explain."""
    left = unexplained_changes(parts, _WINDOW, scale, least)
    return float(np.mean(left**2)) if left.size >= _FEWEST else np.inf
