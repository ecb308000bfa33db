"""A drive that moves as one rigid body: the acceleration that each of its inputs causes at the sensor.

Without friction against the ground, the torques of springs and dampers cancel in the momentum: l A = 0 for one row
vector l.  With r, the state that moves rigidly at a speed of 1 at the sensor, an input accelerates by l b / (l r).
"""

from collections.abc import Mapping

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import balance_of
from monitor_core.drive.friction_roles import friction_of, rigid_speeds
from monitor_core.drive.structure import Drive


def rigid_accelerations(drive: Drive, values: Mapping[str, float]) -> Floats:
    """Acceleration at the sensor (m,) by one unit of each input [rad/s^2], at these parameter values."""
    free = {**values, **dict.fromkeys(friction_of(drive).viscous, 0.0)}
    A, B = drive.matrix("A", free), drive.matrix("B", values)
    d = balance_of(A)
    momentum = np.linalg.svd(A / d[:, np.newaxis] * d)[0][:, -1] / d
    return np.asarray(momentum @ B / (momentum @ rigid_speeds(drive, values)), np.float64)
