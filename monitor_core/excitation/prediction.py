"""Predicted accuracy of an experiment by the Cramer-Rao bound, and the spectrum that is best for chosen parameters.

The bound holds for the predictor of the axis: for its output error, or for the innovations with its gain K.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import Drive, split_name
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.excitation.motions import ExcitationError
from monitor_core.excitation.multisine_signals import Complex
from monitor_core.excitation.sensitivity import Sensitivities
from monitor_core.wording import listed

_UNSEEN = 1e-9
"""A sensitivity so much smaller than the largest is none."""


@dataclass(frozen=True)
class Estimation:
    """How the parameters will be estimated.

    Args:
        drive: with the quantity as output that is measured.
        values: of its parameters.
        interval_s: between samples.
        lam0: variance of the innovations, of the output noise where there is no gain.
        K: filter gain (n,) in the drive's states, None for output error.
        scales: sizes of parameters that are zero.

    Raises:
        ValueError: the variance is not positive, or the gain has another length.
    """

    drive: Drive
    values: Mapping[str, float]
    interval_s: float
    lam0: float
    K: Floats | None = None
    scales: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", self.drive.complete(self.values))
        if not 0 < self.lam0 < np.inf:
            raise ValueError(f"innovation variance {self.lam0}: must be finite and greater than zero")
        if self.K is not None and len(self.K) != len(self.drive.states):
            raise ValueError(f"K has {len(self.K)} entries, the drive {len(self.drive.states)} states")

    @property
    def all_names(self) -> tuple[str, ...]:
        """The parameters that have a size."""
        return tuple(
            p.name for p in self.drive.parameters if self.values[p.name] != 0 or p.name in self.scales
        )

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
    """All parameters that one record can determine, without those that must be held for it: pure numbers first.

    Raises:
        ExcitationError: a ``wanted`` parameter cannot be determined beside the others.
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
                f"{kept} cannot be estimated beside {beside}: say which are estimated (free), the others are held"
            )
        names.remove(pure[0] if pure else movable[-1])
    return tuple(names)


def linear_part(responses: Complex) -> list[int]:
    """Which parameters (p,) affect the linear response: not those of friction, which only the simulation shows."""
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
        M: information of each line (L, p, p); together they must tell all parameters.
        costs: share of each limit that a power of 1 in each line takes (J, L).
        wanted: weights W of the variances of the parameters (p,).

    Raises:
        numpy.linalg.LinAlgError: the lines together do not tell all parameters.
    """
    p = 1 / (len(M) * costs.max(axis=0))
    together = np.tensordot(p, M, axes=1)
    scale = np.sqrt(np.diag(together))
    if not (scale > 0).all() or np.linalg.eigvalsh(together / np.outer(scale, scale))[0] < _SINGULAR:
        raise np.linalg.LinAlgError("the lines do not tell all parameters")
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
        p = np.maximum(p, _FLOOR * p.max())  # what has become zero never grows again
        used = costs @ p
        weights = np.maximum(weights * np.sqrt(used / used.max()), _FLOOR)
        weights /= weights.sum()
    return Optimum(powers, best, best / least - 1)


def _gains(M: Floats, p: Floats, wanted: Floats) -> tuple[Floats, float]:
    """How much the criterion falls for each power (L,), and the criterion."""
    C = np.linalg.inv(np.tensordot(p, M, axes=1))
    return np.einsum("ij,lij->l", (C * wanted) @ C, M), float(wanted @ np.diag(C))
