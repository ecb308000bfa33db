"""All that is suspicious about a record."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from monitor_core.drive.structure import Drive
from monitor_core.identification.record import Record
from monitor_core.identification.record_checks.finding import Finding, Known
from monitor_core.identification.record_checks.motion_checks import motion
from monitor_core.identification.record_checks.outlier_checks import strange
from monitor_core.identification.record_checks.signal_checks import signals
from monitor_core.identification.record_checks.time_checks import times
from monitor_core.identification.rigid_body import antiresonance_s, rigid_inertia

_NOTHING_KNOWN = Known()


def suspicions(record: Record, known: Known = _NOTHING_KNOWN) -> tuple[Finding, ...]:
    """What is wrong with a record, those findings first that refuse it.

    Torque and motion are compared only where each of them is sound by itself.
    """
    found = [*strange(record), *times(record, known), *signals(record)]
    if not any(finding.severity == "refuse" for finding in found):
        found += motion(record, known)
    return tuple(sorted(found, key=lambda finding: finding.severity != "refuse"))


# --- What the nominal values of a drive let one expect of its records -------------------------------------------------


_NOUGHT = 1e-9
"""Of the fastest pole: poles so slow are those of the free rigid motion, which has no time constant."""


def known_of(
    drive: Drive,
    values: Mapping[str, float],
    parameters: int,
    speed_scale: float = 1.0,
    speed: str | None = None,
) -> Known:
    """What is known of an axis with these nominal values; arguments as of ``Known``.

    Raises:
        KeyError, ValueError: a value is missing or makes no sense.
    """
    poles = np.linalg.eigvals(drive.matrix("A", drive.complete(values)))
    decay = -poles.real
    slow = decay[decay > _NOUGHT * abs(poles).max()]
    slowest = float(1 / slow.min()) if slow.size else None
    inertia, antiresonance = rigid_inertia(drive, values), antiresonance_s(drive, values)
    return Known(parameters, slowest, inertia, antiresonance, speed_scale, speed)
