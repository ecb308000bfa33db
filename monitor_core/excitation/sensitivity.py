"""Sensitivities of the output of a drive to its parameters, for given inputs.

Coulomb friction and gravity are inputs that depend on the motion.  As in the monitor they are treated as known signals:
those of the motion at the given values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import balance_of, zero_order_hold_slopes
from monitor_core.drive.structure import Drive, Matrix, split_name
from monitor_core.kernel.fixed_predictor import simulate_known

_STEP = 1e-30
"""Relative size of the complex step: so far below rounding that the derivative is exact."""


class Sensitivities:
    """size_i * dy/dtheta_i of a drive from rest, all its inputs held over each interval.

    By the exact zero-order hold of  (z_i, x)' = [A A_i; 0 A] (z_i, x) + (B_i, B) u,  z_i = dx/dtheta_i,  in states
    x_j / d_j: springs on the arm side and inertias on the motor side would cost digits.

    Args:
        drive: of any output.
        values: of its parameters.
        names: (p,) parameters of the drive, drawn ones, or reciprocals ("1/Ja").
        interval_s: between samples.
        scales: sizes, which a parameter needs that is zero; default |theta_i|.

    Raises:
        KeyError: a name that the drive does not have, or a value that is missing.
        ValueError: a value that makes no sense; a parameter that is zero and has no scale.
    """

    def __init__(
        self,
        drive: Drive,
        values: Mapping[str, float],
        names: Sequence[str],
        interval_s: float,
        scales: Mapping[str, float] | None = None,
    ) -> None:
        stepped = [_stepped(drive, values, name, scales or {}) for name in names]
        at = drive.complete(values)
        A = drive.matrix("A", at)
        d = balance_of(A)
        (n, m), p = (len(A), len(drive.inputs)), len(names)
        units: dict[Matrix, Floats] = {
            "A": d / d[:, np.newaxis],
            "B": np.tile(1 / d[:, np.newaxis], m),
            "C": d[np.newaxis],
        }
        A, B, C = (drive.matrix(which, at) * unit for which, unit in units.items())
        dA, dB, dC = (
            np.array([np.imag(drive.matrix(which, by)) * unit / _STEP for by in stepped]).reshape(
                p, *unit.shape
            )
            for which, unit in units.items()
        )
        X, dX = zero_order_hold_slopes(A, B, dA, dB, np.array([interval_s]))
        self._X, self._dX = X[0], dX[0]  # [Ad Bd] (n, n + m), and its derivatives (p, n, n + m)
        self._C, self._dC = np.ascontiguousarray(C[0]), np.ascontiguousarray(dC.reshape(p, n).T)
        self._interval_s, self._torque = interval_s, drive.of_torque.astype(float)

    def along(self, u: Floats) -> Floats:
        """Sensitivities (N, p) with inputs u (N, m)."""
        n, p = self._dC.shape
        by_input = np.ascontiguousarray(self._dX.transpose(2, 1, 0)).reshape(-1, n * p)
        S = np.empty((len(u), p))
        known = np.ascontiguousarray(u, dtype=float)
        simulate_known(known, self._X, by_input, self._C, self._dC, S)
        return S

    def responses(self, frequency_hz: Floats) -> NDArray[np.complex128]:
        """Frequency responses (L, p) from the torque, held over each interval, to the sensitivities."""
        n = len(self._C)
        Ad, Bd = self._X[:, :n], self._X[:, n:]
        z = np.exp(2j * np.pi * np.asarray(frequency_hz) * self._interval_s)
        resolvent = np.linalg.inv(z[:, np.newaxis, np.newaxis] * np.eye(n) - Ad)
        x = resolvent @ (Bd @ self._torque)
        forced = np.einsum("pij,lj->lpi", self._dX[:, :, :n], x) + self._dX[:, :, n:] @ self._torque
        return np.asarray(np.einsum("li,lpi->lp", self._C @ resolvent, forced) + x @ self._dC)


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
