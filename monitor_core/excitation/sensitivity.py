"""Sensitivities of the output of a drive to its parameters, for a given torque.

Coulomb friction and gravity are inputs that depend on the motion.  As in the monitor they are treated as known signals:
those of the motion at the given values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import zero_order_hold_slopes
from monitor_core.drive.structure import Drive, split_name
from monitor_core.kernel.fixed_predictor import simulate_known

_STEP = 1e-30
"""Of the complex step: so far below rounding that the derivative is exact."""


class Linear(NamedTuple):
    """A (n, n), B (n, m), C (n,), or their derivatives."""

    A: Floats
    B: Floats
    C: Floats


def sensitivities_to(
    u: Floats,
    drive: Drive,
    values: Mapping[str, float],
    names: Sequence[str],
    interval_s: float,
    scales: Mapping[str, float] | None = None,
) -> Floats:
    """S (N, p): size_i * dy/dtheta_i, from rest, all inputs u (N, m) of the drive held over each interval.

    ``names`` are parameters of the drive, drawn ones, or reciprocals ("1/Ja").  size_i is |theta_i|, or the scale
    given, which a parameter needs that is zero.

    Raises:
        KeyError: a name that the drive does not have, or a value that is missing.
        ValueError: a value that makes no sense; a parameter that is zero and has no scale.
    """
    return _propagated(*_linearised(drive, values, names, scales or {}), u, interval_s)


def sensitivity_responses(
    drive: Drive,
    values: Mapping[str, float],
    names: Sequence[str],
    frequency_hz: Floats,
    interval_s: float,
    scales: Mapping[str, float] | None = None,
) -> NDArray[np.complex128]:
    """Frequency responses (L, p) from the torque, held over each interval, to the sensitivities of the output.

    Raises:
        KeyError, ValueError: as ``sensitivities_to``.
    """
    system, slopes = _linearised(drive, values, names, scales or {})
    torque = drive.of_torque[:, np.newaxis].astype(float)
    n = len(system.A)
    X, dX = _held(system, slopes, interval_s)
    Ad, Bd = X[:, :n], X[:, n:]
    z = np.exp(2j * np.pi * np.asarray(frequency_hz) * interval_s)[:, np.newaxis, np.newaxis]
    resolvent = np.linalg.inv(z * np.eye(len(Ad)) - Ad)
    x = resolvent @ (Bd @ torque)
    columns = [
        system.C @ (resolvent @ (of_slope[:, :n] @ x + of_slope[:, n:] @ torque)) + slope.C @ x
        for of_slope, slope in zip(dX, slopes, strict=True)
    ]
    return np.asarray(np.hstack(columns) if columns else np.empty((len(z), 0), dtype=complex))


def _linearised(
    drive: Drive, values: Mapping[str, float], names: Sequence[str], scales: Mapping[str, float]
) -> tuple[Linear, list[Linear]]:
    """The drive and its derivatives by name, in balanced units of the states."""
    slopes = [_slopes(drive, _stepped(drive, values, name, scales)) for name in names]
    at = drive.complete(values)
    nominal = Linear(drive.matrix("A", at), drive.matrix("B", at), drive.matrix("C", at)[0])
    d = np.asarray(sla.matrix_balance(nominal.A, permute=False, separate=True)[1][0], dtype=float)
    return _in_units(nominal, d), [_in_units(s, d) for s in slopes]


def _stepped(
    drive: Drive, values: Mapping[str, float], name: str, scales: Mapping[str, float]
) -> dict[str, Any]:
    """All parameters, with this one changed by a complex step; parameters merged from it change with it."""
    base, inverse = split_name(name)
    drive.given_as(base)
    known = {**drive.complete(values), **values}
    if base not in known:
        raise KeyError(f"no nominal value for {base}")
    if known[base] == 0 and (inverse or name not in scales):
        raise ValueError(f"{name} has the nominal value 0: give its scale")
    theta = 1 / known[base] if inverse else known[base]
    moved = theta + 1j * _STEP * scales.get(name, abs(theta))
    merged = drive.merged_from(base)
    given = {other: v for other, v in known.items() if other not in merged}
    return drive.complete({**given, base: 1 / moved if inverse else moved})  # type: ignore[dict-item]


def _slopes(drive: Drive, stepped: Mapping[str, Any]) -> Linear:
    A, B, C = (np.imag(drive.matrix(which, stepped)) / _STEP for which in ("A", "B", "C"))
    return Linear(A, B, C[0])


def _in_units(system: Linear, d: Floats) -> Linear:
    """In states x_i / d_i: springs on the arm side and inertias on the motor side would cost digits."""
    return Linear(system.A / d[:, None] * d, system.B / d[:, None], system.C * d)


def _propagated(system: Linear, slopes: Sequence[Linear], u: Floats, interval_s: float) -> Floats:
    """S (N, p) by the exact zero-order hold of  (z_i, x)' = [A A_i; 0 A] (z_i, x) + (B_i, B) u,  z_i = dx/dtheta_i."""
    n, p = len(system.A), len(slopes)
    X, dX = _held(system, slopes, interval_s)
    by_input = np.ascontiguousarray(dX.transpose(2, 1, 0)).reshape(X.shape[1], n * p)
    C_slope = np.array([slope.C for slope in slopes]).reshape(p, n)
    S = np.empty((len(u), p))
    C, known = np.ascontiguousarray(system.C), np.ascontiguousarray(u, dtype=float)
    simulate_known(known, X, by_input, C, np.ascontiguousarray(C_slope.T), S)
    return S


def _held(system: Linear, slopes: Sequence[Linear], interval_s: float) -> tuple[Floats, Floats]:
    """[Ad Bd] (n, n + m) and its derivatives (p, n, n + m)."""
    dA, dB = (np.array([slope[k] for slope in slopes]).reshape(len(slopes), *system[k].shape) for k in (0, 1))
    X, dX = zero_order_hold_slopes(system.A, system.B, dA, dB, np.array([interval_s]))
    return X[0], dX[0]
