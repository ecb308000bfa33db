"""Predicted accuracy of an experiment by the Cramer-Rao bound, and the optimal spectrum for chosen parameters.

The bound holds for the predictor of the axis: for its output error, or for the innovations with its gain K.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import balance_of, zero_order_hold, zero_order_hold_slopes
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import Drive, Matrix
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.excitation.motions import ExcitationError
from monitor_core.excitation.multisine_signals import Complex
from monitor_core.kernel.fixed_predictor import simulate_known
from monitor_core.wording import listed

_UNSEEN = 1e-9
"""A sensitivity below this share of the largest counts as zero."""


@dataclass(frozen=True)
class Estimation:
    """How the parameters will be estimated from a planned motion.

    Args:
        drive: the drive, with the measured quantity as output.
        values: of its parameters.
        interval_s: sample interval [s].
        lam0: variance of the innovations, or of the output noise for output error, in the unit of the output squared.
        K: filter gain (n,) in the drive's states, None for output error.
        scales: sizes of parameters that are zero.

    Raises:
        KeyError: a value is missing.
    """

    drive: Drive
    values: Mapping[str, float]
    interval_s: float
    lam0: float
    K: Floats | None = None
    scales: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", self.drive.complete(self.values))

    @property
    def all_names(self) -> tuple[str, ...]:
        """The parameters that have a size."""
        return tuple(p.name for p in self.drive.parameters if self.values[p.name] != 0 or p.name in self.scales)

    def accuracy(self, names: Sequence[str], inputs: Floats) -> Accuracy:
        """Accuracy of estimates of these parameters from a record with these inputs (N, m) from rest."""
        S = self._sensitivities(names).along(inputs)
        return Accuracy(tuple(names), self._innovations(S), float(np.sqrt(self.lam0)))

    def responses(self, names: Sequence[str], frequency_hz: Floats) -> Complex:
        """Frequency responses from the torque to sqrt(information) (L, p), relative, for one sample."""
        s = self._sensitivities(names).responses(frequency_hz) / np.sqrt(self.lam0)
        if self.K is None:
            return np.asarray(s)
        Ad, C = self._held
        z = np.exp(2j * np.pi * frequency_hz * self.interval_s)[:, None, None] * np.eye(len(Ad))
        K = np.asarray(self.K)[:, None]
        x = np.linalg.solve(z - Ad + Ad @ K @ C, np.broadcast_to(Ad @ K, (len(z), *K.shape)))
        return np.asarray(s * (1 - C @ x)[:, 0])

    def _sensitivities(self, names: Sequence[str]) -> Sensitivities:
        return Sensitivities(self.drive, self.values, names, self.interval_s, self.scales)

    @property
    def _held(self) -> tuple[Floats, Floats]:
        A, B, C = self.drive.matrices(self.values)
        return zero_order_hold(A, B, self.interval_s)[0], C

    def _innovations(self, S: Floats) -> Floats:
        """The innovations that a predictor with gain K makes of each column: eps = s - C x,  x+ = Ad (x + K eps)."""
        if self.K is None:
            return S
        (Ad, C), K = self._held, np.asarray(self.K)[:, None]
        x, out = np.zeros((len(Ad), S.shape[1])), np.empty_like(S)
        for k, s in enumerate(S):
            out[k] = s - (C @ x)[0]
            x = Ad @ (x + K * out[k])
        return out


def distinguishable(estimation: Estimation, inputs: Floats, wanted: Sequence[str] = ()) -> tuple[str, ...]:
    """All parameters that one record can determine, without those that must be held (first those without a unit).

    Raises:
        ExcitationError: a ``wanted`` parameter cannot be determined together with the others.
    """
    bases = {split_name(name)[0] for name in wanted}
    names = [*wanted, *(name for name in estimation.all_names if name not in bases)]
    while directions := [d for d in estimation.accuracy(names, inputs).directions() if d.size == 0]:
        parts = directions[0].names
        movable = [name for name in parts if name not in wanted]
        pure = [name for name in movable if estimation.drive.parameter(name).unit == "1"]
        if not pure and len(movable) < len(parts):
            kept = listed([name for name in parts if name in wanted])
            beside = listed(movable) if movable else "one another"
            raise ExcitationError(
                f"{kept} cannot be estimated beside {beside}: name the parameters to estimate; the others are held"
            )
        names.remove(pure[0] if pure else movable[-1])
    return tuple(names)


def linear_part(responses: Complex) -> list[int]:
    """Indices of the parameters that affect the linear response; Coulomb friction shows only in the simulation."""
    sizes = np.abs(responses).max(axis=0)
    return [int(i) for i in np.flatnonzero(sizes > _UNSEEN * sizes.max(initial=0.0))]


# --- A-optimal spectrum for chosen parameters: the powers of the lines ------------------------------------------------


_STEPS = 2000
_CLOSE = 1e-3
_FLOOR = 1e-9
_SINGULAR = 1e-13


class Optimum(NamedTuple):
    """Powers (L,), their criterion, and an upper bound of (criterion over the smallest possible) - 1."""

    powers: Floats
    criterion: float
    excess: float


def information(responses: Complex) -> Floats:
    """M_k (L, p, p) of a line of power 1, for each sample of white noise of variance 1, from responses (L, p)."""
    return np.asarray((responses.conj()[:, :, None] * responses[:, None, :]).real)


def optimal_powers(M: Floats, costs: Floats, wanted: Floats) -> Optimum:
    """The best powers of the lines.

    Args:
        M: information of each line (L, p, p); together they must determine all parameters.
        costs: share of each limit that a power of 1 in each line takes (J, L).
        wanted: weights W of the variances of the parameters (p,).

    Raises:
        numpy.linalg.LinAlgError: the lines together do not determine all parameters.
    """
    p = 1 / (len(M) * costs.max(axis=0))
    together = np.tensordot(p, M, axes=1)
    scale = np.sqrt(np.diag(together))
    if not (scale > 0).all() or np.linalg.eigvalsh(together / np.outer(scale, scale))[0] < _SINGULAR:
        raise np.linalg.LinAlgError("the lines do not determine all parameters")
    weights = np.ones(len(costs)) / len(costs)
    best, least, powers = np.inf, 0.0, p
    for _ in range(_STEPS):
        p = p / (costs @ p).max()
        gains, value = _gains(M, p, wanted)
        # The criterion is convex and falls with the inverse of all powers: no powers reach less than value / worst.
        ratio = gains / (value * (weights @ costs))
        least = max(least, value / float(ratio.max()))
        if value < best:
            best, powers = value, p
        if best < (1 + _CLOSE) * least:
            break
        p = p * np.sqrt(ratio)
        p = np.maximum(p, _FLOOR * p.max())  # a power of zero could not grow again
        used = costs @ p
        weights = np.maximum(weights * np.sqrt(used / used.max()), _FLOOR)
        weights /= weights.sum()
    return Optimum(powers, best, best / least - 1)


def _gains(M: Floats, p: Floats, wanted: Floats) -> tuple[Floats, float]:
    """Decrease of the criterion per power (L,), and the criterion."""
    C = np.linalg.inv(np.tensordot(p, M, axes=1))
    return np.einsum("ij,lij->l", (C * wanted) @ C, M), float(wanted @ np.diag(C))


# --- Sensitivities of the output --------------------------------------------------------------------------------------


# Coulomb friction and gravity are inputs that depend on the motion.  As in the monitor they are treated as known
# signals: those of the motion at the given values.

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
            np.array([np.imag(drive.matrix(which, by)) * unit / _STEP for by in stepped]).reshape(p, *unit.shape)
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


def _stepped(drive: Drive, values: Mapping[str, float], name: str, scales: Mapping[str, float]) -> dict[str, Any]:
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
