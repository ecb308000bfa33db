"""Finds the friction parameters of a drive by their places in A and B, and the friction of a steady motion.

Viscous friction acts between a mass and the ground: it is a damper whose terms in A are all in the column of one speed.
A damper between two masses has terms in the columns of both.  Coulomb friction is a torque in B that multiplies the
direction of a motion.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DAMPING, INERTIA, TORQUE_UNIT, Drive, Matrix
from monitor_core.kernel.tables import COULOMB


class Friction(NamedTuple):
    """Names of the parameters of a drive that are friction."""

    viscous: tuple[str, ...]
    coulomb: tuple[str, ...]


def friction_of(drive: Drive) -> Friction:
    """The friction parameters of a drive, in its order."""
    return Friction(tuple(_viscous(drive)), tuple(_coulomb(drive)))


def braking(drive: Drive, values: Mapping[str, float]) -> tuple[float, float]:
    """Viscous friction [N m s/rad] and Coulomb friction [N m] of a steady motion, at the sensor; at least 0."""
    speeds, angles = rigid_speeds(drive, values), drive.matrix("ratio", values)[:, 0]
    viscous, coulomb = _viscous(drive), _coulomb(drive)
    d = sum(max(values[name], 0.0) * float(speeds[column]) ** 2 for name, column in viscous.items())
    c = sum(max(values[name], 0.0) * abs(float(angles[column])) for name, column in coulomb.items())
    return d, c


def _viscous(drive: Drive) -> dict[str, int]:
    """By name of a viscous friction: column in A of the speed that it brakes."""
    return _in_one_column(drive, "A", DAMPING)


def _coulomb(drive: Drive) -> dict[str, int]:
    """By name of a Coulomb friction: its column in B."""
    torques = _in_one_column(drive, "B", TORQUE_UNIT)
    return {name: column for name, column in torques.items() if drive.inputs[column] == COULOMB}


def _in_one_column(drive: Drive, matrix: Matrix, unit: str) -> dict[str, int]:
    """Parameters of this unit whose terms in a matrix are all in one column, and that column."""
    found = dict[str, int]()
    for p in drive.parameters:
        columns = {t.col for t in drive.terms if t.matrix == matrix and p.name in dict(t.powers)}
        if p.unit == unit and len(columns) == 1:
            found[p.name] = columns.pop()
    return found


def rigid_speeds(drive: Drive, values: Mapping[str, float]) -> Floats:
    """The state (n,) of the drive moving rigidly at a speed of 1 at the sensor; 0 where it is no speed."""
    rest = drive.matrix("rest", values)[:, 0]
    if drive.output != "angle":
        return rest
    # The angle at the sensor grows by 1 and no spring is loaded.  These are the rows of A without an inertia.
    inertias = {p.name for p in drive.parameters if p.unit == INERTIA}
    dynamic = {t.row for t in drive.terms if t.matrix in ("A", "B") and inertias & dict(t.powers).keys()}
    rows = [row for row in range(len(drive.states)) if row not in dynamic]
    A = drive.matrix("A", values)
    return np.asarray(np.linalg.lstsq(A[rows], rest[rows], rcond=None)[0], np.float64)
