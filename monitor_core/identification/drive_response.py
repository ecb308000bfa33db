"""Frequency response of a drive at estimated parameters, with the band that their covariance leaves.

    G(z) = C (zI - Ad)^-1 (Bd + Bd' / z),      z = e^{jwh}

Ad, Bd belong to the torque held over the interval, Bd' to the part of it that acts late, as the samples of a record
see it: this is what spectra and discrete models estimate, not C (jw - A)^-1 B.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY, Drive
from monitor_core.identification.frequency import (
    Complexes,
    FrequencyResponse,
    by_gradient,
    on_circle,
    root_of,
)
from monitor_core.identification.held_drive import Linear, Structure, hold_late
from monitor_core.identification.record import Bools
from monitor_core.kernel.tables import TORQUE


def held_response(
    system: Linear, torque: Bools, interval_s: float, frequency_hz: ArrayLike, delay_s: float = 0.0
) -> tuple[Complexes, Complexes]:
    """G (F,) and its derivatives (F, p + 1) with respect to the parameters and, last, the delay of the torque.

    Args:
        system: A, B, C and their derivatives.
        torque: (m,) which inputs are the motor torque.
        interval_s: s.
        frequency_hz: (F,) Hz.
        delay_s: by which the torque acts late, s, at most one interval.

    Raises:
        ValueError: a frequency beyond half the sampling frequency, or a delay that is no part of an interval.
    """
    if not 0 <= delay_s <= interval_s:
        raise ValueError(f"delay {delay_s} s: need 0 to the interval, {interval_s} s")
    _, z = on_circle(frequency_hz, interval_s)
    n, m = system.B.shape
    late = hold_late(system, torque, np.array([interval_s]), delay_s)
    now = np.concatenate([np.zeros(n, np.bool_), torque, [False]])
    X, dX = late.X[0], late.dX[0]
    b = X[:, now].sum(axis=-1) + X[:, n + m] / z[:, None]
    db = dX[:, :, now].sum(axis=-1) + dX[:, :, n + m] / z[:, None, None]
    resolvent = z[:, None, None] * np.eye(n) - X[:, :n]
    r = np.linalg.solve(resolvent, b[..., None])[..., 0]
    l = np.linalg.solve(resolvent.swapaxes(1, 2), system.C[:, None].astype(np.complex128))[..., 0]
    dG: Complexes = np.einsum("fi,pij,fj->fp", l, dX[..., :n], r) + np.einsum("fi,fpi->fp", l, db)
    dG[:, :-1] += r @ system.dC
    return np.asarray(r @ system.C, dtype=np.complex128), dG


def drive_response(
    drive: Drive,
    values: Mapping[str, float],
    interval_s: float,
    frequency_hz: ArrayLike,
    *,
    names: Sequence[str] = (),
    covariance: Floats | None = None,
    delay_s: float = 0.0,
    n_effective: float = np.inf,
    name: str = "grey box",
) -> FrequencyResponse:
    """The response of a drive to its torque; friction and gravity, being known inputs, are not in it.

    Args:
        drive: its structure.
        values: of all parameters, as AxisModel takes them.
        interval_s: s.
        frequency_hz: (F,) Hz.
        names: (p,) estimated parameters, as in Estimate.names: "1/Ja", "delay"; what varies with a signal
            ("fm per temperature") is left out, the response being that at signals of zero.
        covariance: (p, p) of their estimates; None: they are known exactly.
        delay_s: by which the torque acts late, s.
        n_effective: samples behind the estimates.
        name: as in a legend.

    A parameter of infinite variance that the response depends on makes its deviations infinite.

    Raises:
        KeyError: a name that the drive does not have, or a value that is missing.
        ValueError: a value that makes no sense; a frequency beyond half the sampling frequency; a covariance of
            another size.
    """
    covariance = np.zeros((len(names), len(names))) if covariance is None else covariance
    if covariance.shape != (len(names), len(names)):
        raise ValueError(f"covariance {covariance.shape} for {len(names)} names")
    model = AxisModel(drive, values, ())
    free = [p for p in names if p != DELAY and " per " not in p]
    system = Structure(drive, free, model.balance()).at(model.nominal)
    f, _ = on_circle(frequency_hz, interval_s)
    G, slopes = held_response(
        system, np.array([kind == TORQUE for kind in drive.inputs]), interval_s, f, delay_s
    )
    dG = np.zeros((f.size, len(names)), dtype=np.complex128)
    for i, parameter in enumerate(names):
        if parameter in free or parameter == DELAY:
            dG[:, i] = slopes[:, free.index(parameter) if parameter in free else -1]
    known = np.isfinite(np.diag(covariance))
    root = root_of(covariance[np.ix_(known, known)])
    found = by_gradient(f, G, dG[:, known], root, n_effective, name)
    lost = np.any(dG[:, ~known] != 0, axis=1)
    return replace(
        found, sd_db=np.where(lost, np.inf, found.sd_db), sd_phase=np.where(lost, np.inf, found.sd_phase)
    )
