"""Known properties of an axis for the checks: inertia as one rigid mass, slowest time constant, antiresonance."""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive
from monitor_core.modeling.resonances import resonances

_PLACEHOLDERS, _SAME = (0.1, 1.0), 0.01
"""Trial values of unknown parameters: a property that is equal for both does not depend on them."""
_NOUGHT = 1e-9
"""Poles below this share of the fastest belong to the free rigid motion, which has no time constant."""


@dataclass(frozen=True, slots=True)
class KnownAxis:
    """Known properties of the axis; unknown ones are not checked.

    Args:
        parameters: number of parameters to estimate.
        slowest_s: slowest time constant of the drive, s.
        inertia: nominal inertia of the whole drive as the motor feels it, kg m^2: ``rigid_inertia``.
        antiresonance_s: period of its lowest antiresonance, s; faster motions do not show that inertia.
        speed_scale: Coulomb friction is fc tanh(speed / speed_scale), rad/s.
    """

    parameters: int = 0
    slowest_s: float | None = None
    inertia: float | None = None
    antiresonance_s: float | None = None
    speed_scale: float = 1.0


def rigid_inertia(drive: Drive, values: Mapping[str, float]) -> float:
    """The inertia of the whole drive, kg m^2, as a measured torque feels it: with a torque constant of 2 half of it.

    Near standstill the torque for a speed w is  1/G(s) = f + J s + O(s^2)  with the transfer function G.
    """
    A, torque, C = _from_torque(drive, values)
    poles = abs(np.linalg.eigvals(A))
    # One mass without friction has its poles at zero only: its response is that of the inertia at any frequency.
    s = 1e-4j * poles[poles > 1e-6 * poles.max()].min(initial=poles.max() or 1.0)
    G = complex(C @ np.linalg.solve(s * np.eye(len(A)) - A, torque))
    return float((1 / G / (s if drive.output == "angle" else 1)).imag / s.imag)


def antiresonance_s(drive: Drive, values: Mapping[str, float]) -> float | None:
    """Period, s, of the lowest antiresonance: motions much slower than that are rigid.  None: the drive has none."""
    found = resonances(*_from_torque(drive, values)).antiresonances
    return 1 / min(mode.frequency_hz for mode in found) if found else None


def _from_torque(drive: Drive, values: Mapping[str, float]) -> tuple[Floats, Floats, Floats]:
    """A (n, n), the column of B (n,) of the torque, C (n,)."""
    values = drive.complete(values)
    A, B, C = drive.matrices(values)
    return A, B[:, drive.of_torque].sum(axis=1), C[0]


def known_axis(
    drive: Drive,
    values: Mapping[str, float],
    parameters: int,
    speed_scale: float = 1.0,
    unknown: Collection[str] = (),
) -> KnownAxis:
    """Known properties of an axis with these nominal values; arguments as in ``KnownAxis``.

    ``unknown``: parameters whose values are placeholders.  A property that depends on them is not known; the inertia
    does not depend on frictions and springs.

    Raises:
        KeyError, ValueError: a value is missing or makes no sense.
    """
    slowest_s, inertia, antiresonance = (
        _if_equal(*(found(drive, trial) for trial in _trials(values, unknown)))
        for found in (_slowest_s, rigid_inertia, antiresonance_s)
    )
    return KnownAxis(parameters, slowest_s, inertia, antiresonance, speed_scale)


def drive_time_constant(drive: Drive, values: Mapping[str, float], unknown: Collection[str]) -> float | None:
    """Slowest time constant of a drive with these values [s]; arguments as in ``known_axis``; None: not known."""
    return _if_equal(*(_slowest_s(drive, trial) for trial in _trials(values, unknown)))


def _trials(values: Mapping[str, float], unknown: Collection[str]) -> Iterator[dict[str, float]]:
    """The values, with each of two trial values for the unknown ones."""
    for value in _PLACEHOLDERS:
        yield {**values, **dict.fromkeys(unknown, value)}


def _if_equal(first: float | None, second: float | None) -> float | None:
    """A property that does not depend on the trial values; None: it does."""
    return first if first and second and math.isclose(first, second, rel_tol=_SAME) else None


def _slowest_s(drive: Drive, values: Mapping[str, float]) -> float | None:
    poles = np.linalg.eigvals(drive.matrix("A", drive.complete(values)))
    decay = -poles.real
    slow = decay[decay > _NOUGHT * abs(poles).max()]
    return float(1 / slow.min()) if slow.size else None
