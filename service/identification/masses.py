"""How many masses the records ask for, beside those that the drive has: rows of one, two, .. masses, each fitted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from monitor_core.identification.problem import Problem
from monitor_core.identification.starting import Growth, grow
from monitor_core.identification.starting.slots import Slots
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE
from service.identification.errors import IdentificationError
from service.identification.task import Task

MOST = 9
"""Masses that can be asked for; a motor hardly feels more."""
USUAL = 5


def grown(task: Task, progress: Callable[[int, int], None] | None = None) -> Growth | None:
    """Rows of masses up to as many as the user wishes, fitted like the drive; None: not wished.

    Raises:
        IdentificationError: gravity acts on the drive; the records tell no frequency response.
    """
    if task.masses is None:
        return None
    acting = _acting(task)
    if acting & {COSINE, SINE}:
        raise IdentificationError(
            "--masses compares masses in a row without gravity, which acts on this drive"
        )
    friction = {"fm": True, "fc": COULOMB in acting, "tau0": ONE in acting}
    try:
        return grow(
            [one.record for one in task.estimation],
            task.masses,
            like=task.problem,
            friction=[name for name, acts in friction.items() if acts],
            validation=[one.record for one in task.validation],
            progress=progress,
        )
    except ValueError as error:
        raise IdentificationError(f"--masses: {error}") from None


def masses_of(problem: Problem) -> int | None:
    """How many the motor feels of the drive; None: they are not in a row, or not all are free."""
    try:
        return Slots(problem).masses
    except (ValueError, np.linalg.LinAlgError):
        return None


def _acting(task: Task) -> set[int]:
    """Kinds of the inputs that do anything."""
    drive = task.drive
    values = {name: value or float(name in task.choice.free) for name, value in task.problem.nominal.items()}
    acts = np.flatnonzero(drive.matrix("B", values).any(axis=0))
    return {drive.inputs[int(column)] for column in acts}
