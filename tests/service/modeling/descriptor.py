"""E z' + F z = G c, of whatever index, as an ordinary differential equation: exactly, and for any drive the same way.

With the knowns c held, Z = (z, c) obeys E Z' + F Z = 0.  Its solutions stay in the last of the subspaces
V_{i+1} = {v: F v in E V_i}; a jump of c moves Z along the last of W_{i+1} = {w: E w in F W_i} (K.-T. Wong, 1974).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import QQ
from sympy.polys.matrices import DomainMatrix

from tests.service.modeling.flattened import FlatText, Function, Numbers, numbers

Array = NDArray[np.float64]
FUNCTIONS: Mapping[str, Callable[[float], float]] = {"tanh": np.tanh, "sin": np.sin, "cos": np.cos}


@dataclass
class Ordinary:
    """x' = A x + B c,  z = Zx x + Zc c."""

    variables: list[str]
    knowns: list[str]
    functions: list[Function]
    A: Array
    B: Array
    Zx: Array
    Zc: Array

    def response(self, output: str, torques: Array, t: Array) -> Array:
        """A variable at the ends of intervals (N,) of constant torque (N,), from rest, by scipy's solver."""
        x, out = np.zeros(len(self.A)), []
        row = self.variables.index(output)
        assert not self.Zc[row].any()  # it does not jump with the torque
        for torque, begin, end in zip(torques, np.concatenate([[0.0], t[:-1]]), t, strict=True):
            found = solve_ivp(
                self._derivative, (begin, end), x, "DOP853", rtol=1e-11, atol=1e-14, args=(float(torque),)
            )
            assert found.success, found.message
            x = found.y[:, -1]
            out.append(self.Zx[row] @ x)
        return np.array(out)

    def _derivative(self, _: float, x: Array, torque: float) -> Array:
        knowns = np.array([torque, 1.0, *(self._value(f, x) for f in self.functions)])
        return np.asarray(self.A @ x + self.B @ knowns)

    def _value(self, function: Function, x: Array) -> float:
        rows = [self.variables.index(name) for name in function.argument]
        assert not self.Zc[rows].any()  # no algebraic loop through the function
        argument = np.array([float(c) for c in function.argument.values()]) @ self.Zx[rows] @ x
        return FUNCTIONS[function.function](float(argument))


def ordinary(flat: FlatText, torque: str) -> Ordinary:
    given = numbers(flat, torque)
    size, held = len(given.variables), len(given.knowns)
    E, F = _extended(given)
    V, W = _wong(E, F, start_full=True), _wong(F, E, start_full=False)
    assert V.shape[1] + W.shape[1] == size + held, "the equations do not say all, or too much"
    last = V.extract(range(size, size + held), range(V.shape[1]))
    free = V * _columns(last.nullspace())
    unit = DomainMatrix.eye(size + held, QQ).to_sparse()
    knowns = unit.extract(range(size + held), range(size, size + held))
    jumps = V * _solved(V.hstack(W), knowns).extract(range(V.shape[1]), range(held))
    basis = free.hstack(jumps)
    # What is differentiated does not jump with the knowns, so that they may vary.
    assert (E * (jumps - knowns)).is_zero_matrix
    rates = _solved(E * basis, -F * basis)
    n = free.shape[1]
    return Ordinary(
        given.variables,
        given.knowns,
        flat.functions,
        _floats(rates.extract(range(n), range(n))),
        _floats(rates.extract(range(n), range(n, n + held))),
        _floats(free.extract(range(size), range(n))),
        _floats(jumps.extract(range(size), range(held))),
    )


def transfer(given: Numbers, known: str, output: str, s: complex) -> complex:
    """From a known to a variable, by solving (s E + F) z = G c there."""
    E, F, G = (_floats(M) for M in (given.E, given.F, given.G))
    pencil = s * E + F
    rows, columns = (1 / np.sqrt(np.max(np.abs(pencil), axis=axis)) for axis in (1, 0))
    scaled = rows[:, None] * pencil * columns
    z = columns * np.linalg.solve(scaled, rows * G[:, given.knowns.index(known)])
    return complex(z[given.variables.index(output)])


def _extended(given: Numbers) -> tuple[DomainMatrix, DomainMatrix]:
    size, held = len(given.variables), len(given.knowns)
    below = DomainMatrix.zeros((held, size), QQ).to_sparse()
    square = DomainMatrix.zeros((held, held), QQ).to_sparse()
    beside = DomainMatrix.zeros((size, held), QQ).to_sparse()
    E = given.E.hstack(beside).vstack(below.hstack(DomainMatrix.eye(held, QQ).to_sparse()))
    F = given.F.hstack(-given.G).vstack(below.hstack(square))
    return E, F


def _wong(E: DomainMatrix, F: DomainMatrix, start_full: bool) -> DomainMatrix:
    """The last of X_{i+1} = {x: F x in E X_i} as columns, from everything or from nothing."""
    size = E.shape[1]
    X = (
        DomainMatrix.eye(size, QQ).to_sparse()
        if start_full
        else DomainMatrix.zeros((size, 0), QQ).to_sparse()
    )
    while True:
        kernel = _columns(F.hstack(-(E * X)).nullspace())
        found = _columns(_independent(kernel.extract(range(size), range(kernel.shape[1])).transpose()))
        if found.shape[1] == X.shape[1]:
            return X
        X = found


def _columns(rows: DomainMatrix) -> DomainMatrix:
    return rows.transpose().to_sparse()


def _independent(rows: DomainMatrix) -> DomainMatrix:
    reduced, pivots = rows.rref()
    return reduced.extract(range(len(pivots)), range(rows.shape[1]))


def _solved(left: DomainMatrix, right: DomainMatrix) -> DomainMatrix:
    """X of left X = right; left has independent columns."""
    reduced, pivots = left.hstack(right).rref()
    n = left.shape[1]
    assert pivots == tuple(range(n)), "no or more than one solution"
    return reduced.extract(range(n), range(n, n + right.shape[1]))


def _floats(M: DomainMatrix) -> Array:
    out = np.zeros(M.shape)
    for (i, j), c in M.to_sparse().to_dok().items():
        out[i, j] = float(c.numerator) / float(c.denominator)
    return out
