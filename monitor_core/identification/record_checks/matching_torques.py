"""Finds which torque drives which motion, among the axes of a robot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import rigid_fit, speed_scales

_MIN_GAIN = 0.3
"""Share of the variance of the torque that two axes must explain better with exchanged torques."""
_MAX_SAMPLES = 50_000
"""Number of samples that are compared."""
_AS_LONG = 0.95
"""Share of the longest record: on a bus some axes lose a few samples."""


def matching_torques(records: Sequence[Record], begins_s: Sequence[float]) -> list[int]:
    """Of the motion of each record, the index of the record whose torque drives it.

    That is its own, unless all exchanged torques explain much more.  Shorter records keep their own: they have another
    interval, or their samples are from another time.

    Args:
        records: of the axes of a robot, at the same time.
        begins_s: time of the first sample of each by the same clock [s].
    """
    longest = max(map(len, records))
    used = [k for k, record in enumerate(records) if len(record) >= _AS_LONG * longest]
    part = slice(min(longest, _MAX_SAMPLES))
    moved = [(records[k].select(part), begins_s[k]) for k in used]
    explained = np.array(
        [
            [_explained(motion, _torque_at(motion.t + (begin - other), torque)) for torque, other in moved]
            for motion, begin in moved
        ]
    )
    # The right torque explains the motion best. Small differences are no reason to exchange any.
    _, best = linear_sum_assignment(-explained - _MIN_GAIN * np.eye(len(used)))
    gains = [explained[k, other] - explained[k, k] for k, other in enumerate(best.tolist()) if other != k]
    found = list(range(len(records)))
    if gains and min(gains) >= _MIN_GAIN:
        for k, other in enumerate(best.tolist()):
            found[used[k]] = used[other]
    return found


def _torque_at(t: Floats, torque: Record) -> Floats:
    """The torque of a record at its samples that are nearest to these times."""
    return torque.u[np.searchsorted((torque.t[1:] + torque.t[:-1]) / 2, t)]


def _explained(motion: Record, torque: Floats) -> float:
    """Share of the torque that is explained if it drives a mass with this motion."""
    if np.ptp(torque) == 0 or np.ptp(motion.y[motion.measured]) == 0:
        return 0.0
    record = replace(motion, u=torque)
    fit = rigid_fit(record, speed_scales([record])[1])
    return 0.0 if fit is None else max(0.0, fit.explained)  # of either sign, which is looked at afterwards
