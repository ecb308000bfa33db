"""The parameters of a drive that are masses, springs and dampers of the chain that the motor sees.

Names and order of states do not matter: the drive without dampers is decomposed by its own response, and a parameter
with which one mass or one spring of that chain grows in proportion is that mass or spring.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DAMPING, Drive, split_name
from monitor_core.identification.frequency import Complexes
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting.chains import Chain, chain_of_modes
from monitor_core.kernel.tables import TORQUE

_LITTLE = 0.1
"""Of the damping that the springs have on average: what each damper has at least."""
_SLOWEST = 1e-3
"""Decay, 1/s: what is slower looks like this."""
_GROWN = 1.25
_TOLERANCES = (1e-5, 1e-3)
"""The second where nominal values are so far apart that rounding hides what belongs together."""


class Slots:
    """The chain of a problem's drive.

    Raises:
        ValueError: the motor does not see a chain, or not every mass and spring of it is a free parameter.
    """

    def __init__(self, problem: Problem) -> None:
        self._drive, self._nominal = problem.drive, problem.nominal
        bases = [split_name(name)[0] for name in problem.free]
        units = {name: problem.drive.parameter(name).unit for name in bases}
        self.dampers = tuple(name for name in bases if units[name] == DAMPING)
        self.masses = self.chain(problem.nominal).J.size
        placed = [n for n in bases if n not in self.dampers and problem.nominal[n] > 0]
        for tolerance in _TOLERANCES:
            self._scale = {name: slot for name in placed if (slot := self._place(name, tolerance))}
            if sorted(slot for slot, _ in self._scale.values()) == list(range(2 * self.masses - 1)):
                return
        raise ValueError("not every mass and spring of the chain that the motor sees is a free parameter")

    def values(self, chain: Chain, decay: Floats) -> dict[str, float]:
        """All values of the drive.

        Args:
            chain: as the motor sees it.
            decay: (n,) -Re of the poles, 1/s: of the rigid motion, then of the resonances.
        """
        numbers = np.concatenate([chain.J, chain.k])
        found = {name: float(numbers[slot] / scale) for name, (slot, scale) in self._scale.items()}
        return self.damped({**self._nominal, **found}, decay)

    def damped(self, values: Mapping[str, float], decay: Floats) -> dict[str, float]:
        """The values with dampers whose modal damping comes next to ``decay`` (n,): to first order it is linear."""
        A, W, V = self._modes(values)
        rates = np.empty((self.masses, len(self.dampers)))
        for j, name in enumerate(self.dampers):
            rates[:, j] = _decays(_lossless(self._drive, values, {name: 1.0})[0] - A, W, V)
        # Scaled: dampers by their effect, modes by their decay.
        unit = 1 / np.maximum(rates.sum(axis=0), 1e-300)
        d = nnls(rates * unit / decay[:, None], np.ones(self.masses))[0]
        d = np.maximum(d, _LITTLE * decay.mean()) * unit
        return {**values, **dict(zip(self.dampers, d.tolist(), strict=True))}

    def decays(self, values: Mapping[str, float]) -> Floats:
        """(n,) of the rigid motion and of the resonances, 1/s, to first order in the dampers: what ``damped`` takes."""
        A, W, V = self._modes(values)
        dampers = {name: values[name] for name in self.dampers}
        return np.maximum(_decays(_lossless(self._drive, values, dampers)[0] - A, W, V), _SLOWEST)

    def _modes(self, values: Mapping[str, float]) -> tuple[Floats, Complexes, Complexes]:
        """A without dampers; left (n, s) and right (s, n) eigenvectors, those of the rigid motion first."""
        A = _lossless(self._drive, values)[0]
        poles, V = np.linalg.eig(A.astype(np.complex128))
        W = np.linalg.inv(V)
        lower = poles.imag < -1e-9 * np.abs(poles).max()
        chosen = np.argsort(np.where(lower, np.inf, np.abs(poles)))[: self.masses]
        return A, W[chosen], V[:, chosen]

    def chain(self, values: Mapping[str, float]) -> Chain:
        """What the motor sees of the drive without its dampers."""
        return _taken_apart(*_lossless(self._drive, values))

    def _place(self, name: str, tolerance: float) -> tuple[int, float] | None:
        """Which number of the chain is this parameter times a constant, and the constant; None: no single one."""
        before = np.concatenate(self.chain(self._nominal))
        grown = {**self._nominal, name: self._nominal[name] * _GROWN}
        change = np.concatenate(self.chain(grown)) / before
        moved = np.flatnonzero(np.abs(change - 1) > tolerance)
        if moved.size != 1 or abs(change[moved[0]] / _GROWN - 1) > tolerance:
            return None
        return int(moved[0]), float(before[moved[0]] / self._nominal[name])


def _decays(dA: Floats, W: Complexes, V: Complexes) -> Floats:
    """-Re of what dA adds to the eigenvalues of these eigenvectors, to first order (n,)."""
    return np.asarray(-np.einsum("ij,jk,ki->i", W, dA, V).real)


def _lossless(
    drive: Drive, values: Mapping[str, float], dampers: Mapping[str, float] | None = None
) -> tuple[Floats, Floats, Floats]:
    """A, b, c from the torque to the speed without dampers but those given; no state that only the angle needs."""
    without = {p.name: 0.0 for p in drive.parameters if p.unit == DAMPING}
    values = {**values, **without, **(dampers or {})}
    A, B, C = (drive.matrix(which, values) for which in ("A", "B", "C"))
    torque: NDArray[np.bool_] = np.array([kind == TORQUE for kind in drive.inputs])
    b, c = B[:, torque].sum(axis=1), C[0] @ A if drive.output == "angle" else C[0]
    felt = drive.matrix("A", {**values, **dict.fromkeys(without, 1.0)}).any(axis=0) | (c != 0)
    return A[np.ix_(felt, felt)], b[felt], c[felt]


def _taken_apart(A: Floats, b: Floats, c: Floats) -> Chain:
    """The chain of a lossless drive.

    Raises:
        ValueError: it is none.
    """
    poles, V = np.linalg.eig(A)
    a = (c @ V) * np.linalg.solve(V, b.astype(complex))
    largest = np.abs(poles).max()
    if np.abs(poles.real).max() > 1e-6 * largest:
        raise ValueError("without its dampers the drive still has losses")
    rigid = np.abs(poles) <= 1e-6 * largest
    upper = (poles.imag > 0) & ~rigid
    if np.count_nonzero(rigid) != 1:
        raise ValueError("the motor does not turn freely as one with all masses")
    order = np.argsort(poles.imag[upper])
    weights = np.concatenate([a.real[rigid], 2 * a.real[upper][order]])
    return chain_of_modes(np.concatenate([[0.0], poles.imag[upper][order]]), weights)
