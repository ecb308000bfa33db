"""The frequency response of a drive and its derivatives, by the eigenvalues of the held drive.

G(z) = C (zI - Ad)^-1 Bd;   with l = C (zI - Ad)^-1 and r = (zI - Ad)^-1 Bd:   dG = l dAd r + l dBd + dC r
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DAMPING, STIFFNESS, split_name
from monitor_core.identification.frequency import Complexes
from monitor_core.identification.held_drive import Linear, Structure, hold
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting.response import Target
from monitor_core.kernel.tables import TORQUE


class Response:
    """Of a problem's drive as a function of x = log theta, for those free parameters that the response depends on.

    Friction that depends on the direction and offsets have no frequency response; they stay at their start, and so do
    parameters that start at zero or below.
    """

    def __init__(self, problem: Problem, values: Mapping[str, float] | None = None) -> None:
        self.values = {**problem.nominal, **(values or {})}
        self._torque = np.array([kind == TORQUE for kind in problem.drive.inputs])
        self._delay_s = problem.delay_s
        d = AxisModel(problem.drive, self.values, ()).balance()
        self.bases = _felt(problem, self.values, d, self._torque)
        self.dampers = _dampers(problem, self.bases)
        self._structure = Structure(problem.drive, self.bases, d)

    @property
    def start(self) -> Floats:
        """x (p,) of the values that it was made with."""
        return np.log([self.values[name] for name in self.bases])

    def named(self, x: Floats) -> dict[str, float]:
        """All values at x (p,)."""
        return self.values | dict(zip(self.bases, np.exp(x).tolist(), strict=True))

    def at(self, x: Floats, target: Target) -> tuple[Complexes, Complexes]:
        """G (F,) and dG / dx (F, p).

        Raises:
            LinAlgError, ValueError: x makes no sense.
        """
        system = self._linear(x)
        n = len(system.A)
        X, dX = (part[0] for part in hold(system, np.array([target.interval_s])))
        poles, V = np.linalg.eig(X[:, :n])
        W = np.linalg.inv(V)
        through = 1 / (target.z[:, None] - poles)
        r, l = through * (W @ X[:, n]), through * (system.C @ V)
        dA, dB, dC = W @ dX[:, :, :n] @ V, dX[:, :, n] @ W.T, V.T @ system.dC
        p = len(self.bases)
        inner = (l @ dA.transpose(1, 0, 2).reshape(n, p * n)).reshape(-1, p, n)
        dG = (inner @ r[:, :, None])[..., 0] + l @ dB.T + r @ dC
        late = target.z ** (-self._delay_s / target.interval_s)
        return r @ (system.C @ V) * late, dG * np.exp(x) * late[:, None]

    def _linear(self, x: Floats) -> Linear:
        system = self._structure.at(self.named(x))
        B = system.B[:, self._torque].sum(axis=1, keepdims=True)
        return system._replace(B=B, dB=system.dB[:, self._torque].sum(axis=1, keepdims=True))


def _felt(problem: Problem, values: Mapping[str, float], d: Floats, torque: np.ndarray) -> tuple[str, ...]:
    """Free parameters that A, C or the torque's column of B depend on, and that have a logarithm."""
    bases = tuple(split_name(name)[0] for name in problem.free)
    system = Structure(problem.drive, bases, d).at(values)
    moves = [
        bool(system.dA[..., i].any() or system.dB[:, torque, i].any() or system.dC[:, i].any())
        for i in range(len(bases))
    ]
    return tuple(name for name, felt in zip(bases, moves, strict=True) if felt and values[name] > 0)


def _dampers(problem: Problem, bases: tuple[str, ...]) -> Ints:
    """(pairs, 2): a damper, and the spring that joins the same inertias."""
    joined = {name: _divisors(problem, name) for name in bases}
    units = {name: problem.drive.parameter(name).unit for name in bases}
    pairs = [
        (i, bases.index(spring))
        for i, damper in enumerate(bases)
        for spring in bases
        if units[damper] == DAMPING and units[spring] == STIFFNESS and joined[damper] == joined[spring]
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _divisors(problem: Problem, name: str) -> frozenset[str]:
    """What the terms of A with this parameter are divided by: the inertias on which its torque acts."""
    powers = [dict(term.powers) for term in problem.drive.terms if term.matrix == "A"]
    return frozenset(other for held in powers if name in held for other, e in held.items() if e < 0)
