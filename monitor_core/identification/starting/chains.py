"""Chains of any number of masses, all at the motor's speed: what a motor sees of any drive without branches.

J1 is the mass of the motor, k1 and d1 connect it to J2, and so on; friction is at the motor.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import hessenberg

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive, Output, Parameter, Quantity, Term
from monitor_core.kernel.tables import COULOMB, ONE, TORQUE

FRICTION = ("fm", "fc", "tau0")
"""Of the motor: viscous, Coulomb's, and a torque offset."""


@cache
def chain(masses: int, output: Output) -> Drive:
    """The drive; its states are the springs' angles, the speeds, and with the angle as output that of the motor.

    Raises:
        ValueError: no mass.
    """
    if masses < 1:
        raise ValueError(f"{masses} masses: need at least one")
    n = masses
    states = [Quantity(f"shaft{i}.phi - shaft{i + 1}.phi", "rad") for i in range(1, n)]
    states += [Quantity(f"shaft{i}.w", "rad/s") for i in range(1, n + 1)]
    terms = [*_springs(n), *_motor(n - 1)]
    if output == "angle":
        states.append(Quantity("shaft1.phi", "rad"))
        terms += [Term("A", 2 * n - 1, n - 1, 1.0, ()), Term("C", 0, 2 * n - 1, 1.0, ())]
        terms.append(Term("rest", 2 * n - 1, 0, 1.0, ()))
    else:
        terms.append(Term("C", 0, n - 1, 1.0, ()))
        terms += [Term("rest", n - 1 + i, 0, 1.0, ()) for i in range(n)]
    inputs = (TORQUE, COULOMB, ONE)
    return Drive(f"{n} masses", output, tuple(states), inputs, _parameters(n), tuple(terms), n - 1)


def names(masses: int) -> tuple[str, ...]:
    """Of inertias, springs and dampers, outwards."""
    J = [f"J{i}" for i in range(1, masses + 1)]
    return (*J, *(f"{letter}{i}" for letter in "kd" for i in range(1, masses)))


def _parameters(n: int) -> tuple[Parameter, ...]:
    J = [Parameter(f"J{i}", "kg m^2", f"inertia {i} of {n}, as the motor sees it") for i in range(1, n + 1)]
    between = [(i, f"between the inertias {i} and {i + 1}, as the motor sees it") for i in range(1, n)]
    k = [Parameter(f"k{i}", "N m/rad", f"stiffness {where}") for i, where in between]
    d = [Parameter(f"d{i}", "N m s/rad", f"damping {where}", positive=False) for i, where in between]
    fm = Parameter("fm", "N m s/rad", "viscous friction of the motor", positive=False)
    fc = Parameter("fc", "N m", "Coulomb friction of the motor", positive=False)
    return (*J, *k, *d, fm, fc, Parameter("tau0", "N m", "torque offset", positive=False))


def _springs(n: int) -> list[Term]:
    """Each stretches with the speeds of the two masses that it joins, brakes one and drives the other."""
    out = list[Term]()
    for i in range(n - 1):
        left, right = n - 1 + i, n + i
        out += [Term("A", i, left, 1.0, ()), Term("A", i, right, -1.0, ())]
        for row, mass, sign in ((left, i + 1, -1.0), (right, i + 2, 1.0)):
            J = (f"J{mass}", -1)
            out.append(Term("A", row, i, sign, (J, (f"k{i + 1}", 1))))
            out.append(Term("A", row, left, sign, (J, (f"d{i + 1}", 1))))
            out.append(Term("A", row, right, -sign, (J, (f"d{i + 1}", 1))))
    return out


def _motor(row: int) -> list[Term]:
    J = ("J1", -1)
    return [
        Term("A", row, row, -1.0, (J, ("fm", 1))),
        Term("B", row, 0, 1.0, (J,)),
        Term("B", row, 1, -1.0, (J, ("fc", 1))),
        Term("B", row, 2, 1.0, (J, ("tau0", 1))),
        Term("ratio", 1, 0, 1.0, ()),
    ]


# --- Masses and springs of a chain from what is seen at its end: an inverse eigenvalue problem with a closed solution--


# Speed over torque at the first of n masses that springs join in a row, without losses, is Y(s) = sum_i a_i s / (s^2
# + p_i^2),      p_0 = 0,  a_i > 0. The springs' matrix scaled by the masses, M^-1/2 K M^-1/2, is a Jacobi matrix
# (symmetric, tridiagonal) with the eigenvalues p_i^2, whose normalised eigenvectors begin with sqrt(a_i / sum a).
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
