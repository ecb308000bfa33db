"""Derivatives of A, B, C as the kernel gets them: against sympy's, and against the complex step."""

from __future__ import annotations

import random
from collections.abc import Mapping
from fractions import Fraction
from typing import Any, cast

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import split_name
from monitor_core.kernel.propagate import evaluate_coefficients
from monitor_core.kernel.tables import Tables
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Entries, StateSpace, drive_of
from tests.core.modeling.drawings import drawn
from tests.core.modeling.random_drives import RandomDrive, drives
from tests.core.oracle.system import Matrices, derivatives

Array = NDArray[np.float64]
MATRICES = ("A", "B", "C")
TOLERANCE = 1e-12
LAWS = settings(deadline=None, max_examples=4)
LAURENT = settings(deadline=None, max_examples=30)


def chosen(ss: StateSpace, values: Mapping[str, float], source: random.Random) -> AxisModel:
    """Any of the parameters, in any order, some by their reciprocals."""
    drive = drive_of(ss)
    names = [p.name for p in drive.parameters]
    some = source.sample(names, source.randint(1, len(names)))
    return AxisModel(drive, values, tuple(f"1/({n})" if source.random() < 0.5 else n for n in some))


def near(model: AxisModel, source: random.Random) -> Array:
    return np.array([value * source.uniform(0.5, 2.0) for value in model.theta0])


def of_kernel(model: AxisModel, theta: Array) -> dict[str, list[Array]]:
    """dA, dB and dC for each parameter, as the kernel's tables say where each number goes."""
    T = Assembly(model.drive, model.monitored).tables
    V = evaluated(model, theta)
    n, p, m = T.n, T.p, T.m
    dA, dB, dC = ([np.zeros(shape) for _ in range(p)] for shape in ((n, n), (n, m), (1, n)))
    for part, place in enumerate(T.product.part_place):
        row, par = divmod(int(place), T.product.blocks)
        for k in range(int(T.product.part_start[part]), int(T.product.part_start[part + 1])):
            dA[par][row, int(T.product.part_at[k]) // T.product.blocks] += V[int(T.product.part_slot[k])]
    assert places_of_all(T, V, n, p) == pytest.approx(np.array(dA))
    for row, slot, col, par in zip(*T.inputs, strict=True):
        if row < p * n and par < 0:
            dB[row // n][row % n, col] += V[slot]
    for slot, source, par in zip(*T.outputs, strict=True):
        if source >= p * n and par >= 0:
            dC[par][0, source - p * n] += V[slot]
    return {"A": dA, "B": dB, "C": dC}


def places_of_all(T: Tables, V: Array, n: int, p: int) -> Array:
    """The same dA (p, n, n) as one axis takes them: by places where any parameter has an entry."""
    dA = np.zeros((T.product.blocks, n, n))
    slots = T.product.more_slot.reshape(-1, T.product.blocks).astype(int)
    for row in range(n):
        for q in range(int(T.product.more_start[row]), int(T.product.more_start[row + 1])):
            dA[:, row, int(T.product.more_at[q]) // T.product.blocks] += V[slots[q]]
    assert not dA[p:].any()
    return dA[:p]


def evaluated(model: AxisModel, theta: Array) -> Array:
    """All slots, and the zero behind them, at theta."""
    assembly = Assembly(model.drive, model.monitored)
    T, constants = assembly.tables, assembly.model_constants(model, 1.0)
    V0, coef = constants["V0"][:, np.newaxis], constants["coef"][:, np.newaxis]
    V = np.append(constants["V0"], 0.0)[:, np.newaxis]
    interpreted = cast("Any", evaluate_coefficients).py_func  # compiled, it may be called by the kernel only
    interpreted((0,), T.terms, V0, coef, theta[:, np.newaxis], V)
    return np.asarray(V[:, 0])


def expression(value: Laurent, symbols: Mapping[str, sympy.Symbol]) -> sympy.Expr:
    terms = (
        (sympy.Rational(c.numerator, c.denominator), *(symbols[name] ** e for name, e in monomial))
        for monomial, c in value
    )
    return sympy.Add(*(sympy.Mul(*factors) for factors in terms))


def matrix(entries: Entries, shape: tuple[int, int], symbols: Mapping[str, sympy.Symbol]) -> sympy.Matrix:
    return sympy.Matrix(*shape, lambda i, j: expression(entries.get((i, j), Laurent()), symbols))


def of_sympy(ss: StateSpace, model: AxisModel, theta: Array) -> dict[str, list[tuple[Array, Array]]]:
    """Each derivative, and the sum of the sizes of its terms, in rational arithmetic until the end."""
    exact = {name: sympy.Rational(*v.as_integer_ratio()) for name, v in model.nominal.items()}
    point = {
        name: sympy.Rational(*float(v).as_integer_ratio())
        for name, v in zip(model.monitored, theta, strict=True)
    }
    symbols = {p.name: sympy.Symbol(p.name, real=True) for p in ss.parameters}
    q = {name: sympy.Symbol(f"q{i}", positive=True) for i, name in enumerate(model.monitored)}
    inside = {symbols[split_name(n)[0]]: 1 / s if split_name(n)[1] else s for n, s in q.items()}
    numbers = {s: exact[n] for n, s in symbols.items() if n in exact and s not in inside}
    numbers |= {q[name]: value for name, value in point.items()}
    out = {}
    for which, entries, shape in zip(MATRICES, (ss.A, ss.B, ss.C), ss.shapes, strict=True):
        M = matrix(entries, shape, symbols)
        out[which] = [numeric(M.subs(inside).diff(q[name]), numbers) for name in model.monitored]
    return out


def numeric(M: sympy.Matrix, numbers: Mapping[sympy.Symbol, sympy.Rational]) -> tuple[Array, Array]:
    value, size = np.zeros(M.shape), np.zeros(M.shape)
    for i in range(M.rows):
        for j in range(M.cols):
            terms = [term.subs(numbers) for term in sympy.Add.make_args(M[i, j].expand())]
            value[i, j], size[i, j] = float(sum(terms)), float(sum(abs(t) for t in terms))
    return value, size


def check(ss: StateSpace, values: Mapping[str, float], source: random.Random) -> None:
    model = chosen(ss, values, source)
    theta = near(model, source)
    kernel, exact = of_kernel(model, theta), of_sympy(ss, model, theta)
    for which, stepped in zip(MATRICES, derivatives(Matrices(model), theta), strict=True):
        for got, (want, size), step in zip(kernel[which], exact[which], stepped, strict=True):
            assert (abs(got - want) <= TOLERANCE * size).all()
            assert (abs(step - want) <= TOLERANCE * size).all()


@LAWS
@given(drive=drives(most=4), seed=st.integers(0, 2**32 - 1))
def test_derivatives_of_random_drives(drive: RandomDrive, seed: int) -> None:
    ss = eliminate(drawn(drive.parts).flat())
    check(ss, {name: float(value) for name, value in drive.exact.items()}, random.Random(seed))


# --- Laurent sums --------------------------------------------------------------------------------------

SYMBOLS = {name: sympy.Symbol(name, positive=True) for name in ("a", "b", "c")}
monomials = st.dictionaries(st.sampled_from(sorted(SYMBOLS)), st.integers(-4, 4).filter(bool)).map(
    lambda powers: tuple(sorted(powers.items()))
)
fractions = st.fractions(-99, 99, max_denominator=99)
laurents = st.dictionaries(monomials, fractions, max_size=5).map(lambda terms: Laurent(terms.items()))


@LAURENT
@given(value=laurents, name=st.sampled_from(sorted(SYMBOLS)))
def test_the_derivative_of_a_laurent_sum_is_sympys(value: Laurent, name: str) -> None:
    difference = expression(value.derivative(name), SYMBOLS) - expression(value, SYMBOLS).diff(SYMBOLS[name])
    assert sympy.expand(difference) == 0


@LAURENT
@given(value=laurents, name=st.sampled_from(sorted(SYMBOLS)), t=st.fractions(1, 9, max_denominator=9))
def test_the_derivative_through_a_reciprocal(value: Laurent, name: str, t: Fraction) -> None:
    """d f(1/q) / dq = -f'(1/q) / q^2, in fractions."""
    inverted = value.substitute({name: Laurent.symbol(name, -1)})
    at = {other: Fraction(3, 2) for other in SYMBOLS} | {name: t}
    there = at | {name: 1 / t}
    assert inverted.derivative(name).value(at) == -value.derivative(name).value(there) / t**2
