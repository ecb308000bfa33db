"""Chains of any number of masses, all at the motor's speed: what a motor sees of any drive without branches.

J1 is the mass of the motor, k1 and d1 connect it to J2, and so on; friction is at the motor.  A chain follows from its
resonances in closed form, and ``ChainParameters`` says which parameters of a drive are its masses, springs and dampers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import hessenberg
from scipy.optimize import nnls

from monitor_core.arrays import Complexes, Floats
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import DAMPING, Drive, MatrixTerm, Output, Parameter, Quantity
from monitor_core.identification.problem import Problem
from monitor_core.kernel.tables import COULOMB, ONE, TORQUE

FRICTION = ("fm", "fc", "tau0")
"""Friction parameters of the motor: viscous, Coulomb friction, torque offset"""


@cache
def chain(masses: int, output: Output) -> Drive:
    """The drive; its states are the springs' angles, the speeds, and with the angle as output that of the motor."""
    n = masses
    states = [Quantity(f"shaft{i}.phi - shaft{i + 1}.phi", "rad") for i in range(1, n)]
    states += [Quantity(f"shaft{i}.w", "rad/s") for i in range(1, n + 1)]
    terms = [*_springs(n), *_motor(n - 1)]
    if output == "angle":
        states.append(Quantity("shaft1.phi", "rad"))
        terms += [MatrixTerm("A", 2 * n - 1, n - 1, 1.0, ()), MatrixTerm("C", 0, 2 * n - 1, 1.0, ())]
        terms.append(MatrixTerm("rest", 2 * n - 1, 0, 1.0, ()))
    else:
        terms.append(MatrixTerm("C", 0, n - 1, 1.0, ()))
        terms += [MatrixTerm("rest", n - 1 + i, 0, 1.0, ()) for i in range(n)]
    inputs = (TORQUE, COULOMB, ONE)
    return Drive(f"{n} masses", output, tuple(states), inputs, _parameters(n), tuple(terms), n - 1)


def names(masses: int) -> tuple[str, ...]:
    """Names of the inertias, springs and dampers of a chain, from the motor outwards."""
    J = [f"J{i}" for i in range(1, masses + 1)]
    return (*J, *(f"{letter}{i}" for letter in "kd" for i in range(1, masses)))


def problem_of(masses: int, output: Output, like: Problem | None = None, friction: Sequence[str] = FRICTION) -> Problem:
    """The chain with this number of masses, all free, with the settings of ``like``; its values have no meaning."""
    nominal = {
        **dict.fromkeys(names(masses), 1.0),
        **dict.fromkeys(FRICTION, 0.0),
        "fm": float("fm" in friction),
    }
    drive, free = chain(masses, output), (*names(masses), *friction)
    if like is None:
        return Problem(drive, nominal, free, predictor="output-error", motion="simulated")
    return replace(like, drive=drive, nominal=nominal, free=free, K=None, bounds={}, varying={}, slopes={})


def _parameters(n: int) -> tuple[Parameter, ...]:
    J = [Parameter(f"J{i}", "kg m^2", f"inertia {i} of {n}, as the motor sees it") for i in range(1, n + 1)]
    between = [(i, f"between the inertias {i} and {i + 1}, as the motor sees it") for i in range(1, n)]
    k = [Parameter(f"k{i}", "N m/rad", f"stiffness {where}") for i, where in between]
    d = [Parameter(f"d{i}", "N m s/rad", f"damping {where}", False, True) for i, where in between]
    fm = Parameter("fm", "N m s/rad", "viscous friction of the motor", positive=False, nonnegative=True)
    fc = Parameter("fc", "N m", "Coulomb friction of the motor", positive=False, nonnegative=True)
    return (*J, *k, *d, fm, fc, Parameter("tau0", "N m", "torque offset", positive=False))


def _springs(n: int) -> list[MatrixTerm]:
    """Each stretches with the speeds of the two masses that it joins, brakes one and drives the other."""
    out = list[MatrixTerm]()
    for i in range(n - 1):
        left, right = n - 1 + i, n + i
        out += [MatrixTerm("A", i, left, 1.0, ()), MatrixTerm("A", i, right, -1.0, ())]
        for row, mass, sign in ((left, i + 1, -1.0), (right, i + 2, 1.0)):
            J = (f"J{mass}", -1)
            out.append(MatrixTerm("A", row, i, sign, (J, (f"k{i + 1}", 1))))
            out.append(MatrixTerm("A", row, left, sign, (J, (f"d{i + 1}", 1))))
            out.append(MatrixTerm("A", row, right, -sign, (J, (f"d{i + 1}", 1))))
    return out


def _motor(row: int) -> list[MatrixTerm]:
    J = ("J1", -1)
    return [
        MatrixTerm("A", row, row, -1.0, (J, ("fm", 1))),
        MatrixTerm("B", row, 0, 1.0, (J,)),
        MatrixTerm("B", row, 1, -1.0, (J, ("fc", 1))),
        MatrixTerm("B", row, 2, 1.0, (J, ("tau0", 1))),
        MatrixTerm("ratio", 1, 0, 1.0, ()),
    ]


# --- Masses and springs of a chain from the response at its end: an inverse eigenvalue problem in closed form ---------


# Speed over torque at the first of n masses that springs join in a row, without losses, is
#     Y(s) = sum_i a_i s / (s^2 + p_i^2),      p_0 = 0,  a_i > 0.
# The springs' matrix scaled by the masses, M^-1/2 K M^-1/2, is a Jacobi matrix (symmetric, tridiagonal) with the
# eigenvalues p_i^2, whose normalised eigenvectors begin with sqrt(a_i / sum a).
# These determine it (Stieltjes' continued fraction; Hochstadt; Golub and Welsch); Householder's reflections find it
# without cancellation.  Its null vector is sqrt(J_i), and 1 / J_1 = sum a.


class Chain(NamedTuple):
    """Seen from the first mass, all at its speed: J (n,) kg m^2, k (n - 1,) N m/rad."""

    J: Floats
    k: Floats


def chain_of_modes(p: Floats, a: Floats) -> Chain:
    """From resonances p (n,), rad/s, with p_0 = 0, and their weights a (n,), 1/(kg m^2).

    Raises:
        ValueError: weights that are not positive, or resonances that are not distinct and increasing from zero.
    """
    if p[0] != 0 or not (np.diff(p) > 0).all() or not (a > 0).all():
        raise ValueError("resonances must increase from zero, and their weights must be positive")
    n, top = p.size, max(float(p[-1]), 1.0)
    bordered = np.zeros((n + 1, n + 1))
    bordered[0, 1:] = bordered[1:, 0] = np.sqrt(a / a.sum())
    bordered[1:, 1:] = np.diag((p / top) ** 2)
    T = hessenberg(bordered)[1:, 1:]
    diagonal, beside = np.diag(T), np.abs(np.diag(T, 1))
    # The null vector: the springs on both sides of a mass cancel.
    v = np.ones(n)
    for i in range(n - 1):
        before = beside[i - 1] * v[i - 1] if i else 0.0
        v[i + 1] = (diagonal[i] * v[i] - before) / beside[i]
    J = v**2 / a.sum()
    return Chain(J, beside * top**2 * np.sqrt(J[:-1] * J[1:]))


def modes_of_chain(chain: Chain) -> tuple[Floats, Floats]:
    """Resonances p (n,) and weights a (n,): what chain_of_modes inverts."""
    n = chain.J.size
    stretch = np.eye(n, k=0)[: n - 1] - np.eye(n, k=1)[: n - 1]
    root = np.sqrt(chain.J)
    # Squares of singular values: a small eigenvalue keeps its digits.
    _, s, Vt = np.linalg.svd(np.sqrt(chain.k)[:, None] * stretch / root)
    order = np.argsort(np.append(s, 0.0))
    return np.append(s, 0.0)[order], (Vt[order, 0] / root[0]) ** 2


# --- The parameters of a drive that are masses, springs and dampers of the chain that the motor sees ------------------


# Names and order of states do not matter: the drive without dampers is decomposed by its own response, and a parameter
# with which one mass or one spring of that chain grows in proportion is that mass or spring.

_LITTLE = 0.1
"""Least damping of each damper, as a share of the average damping of the springs."""
_SLOWEST = 1e-3
"""Least decay [1/s] that is distinguished."""
_GROWN = 1.25
_TOLERANCES = (1e-5, 1e-3)
"""Relative tolerances; the second is used if very different nominal values cause large rounding errors."""


class ChainParameters:
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
        """All values of the drive whose chain is this, with the decays (n,) 1/s: of rigid motion, of the resonances."""
        numbers = np.concatenate([chain.J, chain.k])
        found = {name: float(numbers[slot] / scale) for name, (slot, scale) in self._scale.items()}
        return self.damped({**self._nominal, **found}, decay)

    def damped(self, values: Mapping[str, float], decay: Floats) -> dict[str, float]:
        """The values with dampers whose modal damping comes next to ``decay`` (n,): to first order it is linear."""
        if not self.dampers:
            return dict(values)
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
        """The chain that the motor sees of the drive without its dampers."""
        return _taken_apart(*_lossless(self._drive, values))

    def _place(self, name: str, tolerance: float) -> tuple[int, float] | None:
        """Index of the number of the chain that is proportional to this parameter, and the factor; None: not one."""
        before = np.concatenate(self.chain(self._nominal))
        grown = {**self._nominal, name: self._nominal[name] * _GROWN}
        change = np.concatenate(self.chain(grown)) / before
        moved = np.flatnonzero(np.abs(change - 1) > tolerance)
        if moved.size != 1 or abs(change[moved[0]] / _GROWN - 1) > tolerance:
            return None
        return int(moved[0]), float(before[moved[0]] / self._nominal[name])


def masses_of(problem: Problem) -> int | None:
    """Number of masses in a row that the motor sees; None: they are not in a row, or not all of them are free."""
    try:
        return ChainParameters(problem).masses
    except (ValueError, np.linalg.LinAlgError):
        return None


def _decays(dA: Floats, W: Complexes, V: Complexes) -> Floats:
    """-Re of what dA adds to the eigenvalues of these eigenvectors, to first order (n,)."""
    return np.asarray(-np.einsum("ij,jk,ki->i", W, dA, V).real)


def _lossless(
    drive: Drive, values: Mapping[str, float], dampers: Mapping[str, float] | None = None
) -> tuple[Floats, Floats, Floats]:
    """A, b, c from the torque to the speed without dampers but those given; no state that only the angle needs."""
    without = {p.name: 0.0 for p in drive.parameters if p.unit == DAMPING}
    values = {**values, **without, **(dampers or {})}
    A, B, C = drive.matrices(values)
    torque = drive.of_torque
    b, c = B[:, torque].sum(axis=1), C[0] @ A if drive.output == "angle" else C[0]
    felt = drive.matrix("A", {**values, **dict.fromkeys(without, 1.0)}).any(axis=0) | (c != 0)
    return A[np.ix_(felt, felt)], b[felt], c[felt]


def _taken_apart(A: Floats, b: Floats, c: Floats) -> Chain:
    """The chain of a lossless drive; ValueError: it is none."""
    poles, V = np.linalg.eig(A)
    a = (c @ V) * np.linalg.solve(V, b.astype(complex))
    largest = np.abs(poles).max()
    if np.abs(poles.real).max() > 1e-6 * largest:
        raise ValueError("without its dampers the drive still has losses")
    rigid = np.abs(poles) <= 1e-6 * largest
    upper = (poles.imag > 0) & ~rigid
    if np.count_nonzero(rigid) != 1:
        raise ValueError("the drive has no free motion as one rigid body")
    order = np.argsort(poles.imag[upper])
    weights = np.concatenate([a.real[rigid], 2 * a.real[upper][order]])
    return chain_of_modes(np.concatenate([[0.0], poles.imag[upper][order]]), weights)
