"""Frequency response of a drive with estimated parameters, as sampled records show it, and its uncertainty band."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from monitor_core.arrays import Bools, Complexes
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY, Drive
from monitor_core.identification.black_boxes.frequency_response import (
    FrequencyResponse,
    by_gradient,
    on_circle,
    root_of,
)
from monitor_core.identification.predictor.held_drive import LinearDrive, Structure, hold_late


def held_response(
    system: LinearDrive, torque: Bools, interval_s: float, frequency_hz: ArrayLike, delay_s: float
) -> tuple[Complexes, Complexes]:
    """G (F,) and its derivatives (F, p + 1) with respect to the parameters and, last, the delay of the torque.

        G(z) = C (zI - Ad)^-1 (Bd + Bd' / z),      z = e^{jwh}

    Ad and Bd belong to the torque held over the interval, Bd' to the part of it that acts late.  This is the response
    that spectra and discrete models of sampled records estimate, and not C (jw - A)^-1 B.

    ``torque`` (m,) says which inputs are the motor torque, which acts late by ``delay_s``, at most one interval.
    """
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
    covariance: Mapping[str, ArrayLike] = MappingProxyType({}),
    delay_s: float = 0.0,
) -> FrequencyResponse:
    """The response of a drive to its torque; friction and gravity are known inputs and do not contribute.

    Args:
        drive: its structure.
        values: of all parameters, as AxisModel takes them.
        interval_s: s.
        frequency_hz: (F,) Hz.
        covariance: rows (p,) of the covariance of the estimates, by the p names in Estimate.names: "1/Ja", "delay";
            what varies with a signal ("fm per temperature") is left out, the response being that at signals of zero.
        delay_s: by which the torque acts late, s.

    A parameter of infinite variance that the response depends on makes its deviations infinite.

    Raises:
        KeyError: a name that the drive does not have, or a value that is missing.
        ValueError: a value that makes no sense; a frequency beyond half the sampling frequency.
    """
    names = tuple(covariance)
    P = np.array([*covariance.values()], dtype=np.float64).reshape(len(names), len(names))
    model = AxisModel(drive, values, ())
    free = [p for p in names if p != DELAY and " per " not in p]
    system = Structure(drive, free, model.balance()).at(model.nominal)
    f, _ = on_circle(frequency_hz, interval_s)
    torque, (intervals, late) = drive.of_torque, divmod(delay_s, interval_s)
    G, slopes = held_response(system, torque, interval_s, f, late)
    dG = np.zeros((f.size, len(names)), dtype=np.complex128)
    for i, parameter in enumerate(names):
        if parameter in free or parameter == DELAY:
            dG[:, i] = slopes[:, free.index(parameter) if parameter in free else -1]
    known = np.isfinite(np.diag(P))
    found = by_gradient(f, G, dG[:, known], root_of(P[np.ix_(known, known)]), "drive")
    lost = np.any(dG[:, ~known] != 0, axis=1)
    turns = np.exp(-2j * np.pi * f * interval_s)
    # A mean speed is the change of an angle over each interval.
    mean = (1 - turns) / interval_s if drive.mean_state >= 0 else 1.0
    return replace(
        found,
        G=found.G * mean * turns**intervals,
        sd_db=np.where(lost, np.inf, found.sd_db),
        sd_phase=np.where(lost, np.inf, found.sd_phase),
    )
