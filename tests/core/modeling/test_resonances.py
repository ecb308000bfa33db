"""Poles and zeros against closed forms, for values within many decades."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from monitor_core.modeling.resonances import resonances, resonances_of
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from tests.core.modeling.spaces import free_chain, library_three_mass, table

law = settings(deadline=None, max_examples=40)
seeds = st.integers(0, 2**32 - 1)
decades = st.floats(-4, 4).map(lambda e: 10.0**e)
damping_ratios = st.floats(0.001, 0.9)


def close(found: ArrayLike, expected: ArrayLike, rel: float = 1e-9) -> None:
    assert np.shape(found) == np.shape(expected)
    assert np.all(np.abs(np.subtract(found, expected)) <= rel * np.abs(expected))


def test_nothing_decays() -> None:
    ss = table({(0, 1): "1", (1, 0): "-k/J"}, {(1, 0): "1/J"}, {(0, 1): "1"})
    found = resonances_of(ss, {"k": 8.0, "J": 2.0})
    close([m.frequency_hz for m in found.resonances], [2 / (2 * math.pi)])
    assert found.resonances[0].damping == pytest.approx(0, abs=1e-12)
    close(found.zeros, [0])  # the speed is zero at rest, whatever the torque


@law
@given(J0=decades, J1=decades, k=decades, zeta=damping_ratios)
def test_two_masses(J0: float, J1: float, k: float, zeta: float) -> None:
    """Free-free: poles of  s (s^2 + (d s + k) / J),  1/J = 1/J0 + 1/J1;  zeros of  s^2 + (d s + k) / J1."""
    J = 1 / (1 / J0 + 1 / J1)
    d = 2 * zeta * math.sqrt(k * J)
    ss = free_chain(2, [0])
    found = resonances_of(ss, {"J0": J0, "J1": J1, "k0": k, "d0": d, "kT": 1.0})
    assert len(found.poles) == 3
    assert abs(found.poles[0]) <= 1e-10 * abs(found.poles[-1])
    (mode,) = found.resonances
    close(mode.frequency_hz, math.sqrt(k / J) / (2 * math.pi))
    close(mode.damping, zeta)
    anti = d / (2 * math.sqrt(k * J1))
    (held,) = found.antiresonances
    close(held.frequency_hz, math.sqrt(k / J1) / (2 * math.pi))
    assert held.damping == pytest.approx(anti, rel=1e-9, abs=1e-13)


@law
@given(J0=decades, J1=decades, k=decades, zeta=damping_ratios)
def test_the_far_sensor_has_one_zero_and_no_antiresonance(J0: float, J1: float, k: float, zeta: float) -> None:
    """d s + k is all that is left above the line; without damping nothing is."""
    J = 1 / (1 / J0 + 1 / J1)
    d = 2 * zeta * math.sqrt(k * J)
    ss = free_chain(2, [0], sensor=1)
    found = resonances_of(ss, {"J0": J0, "J1": J1, "k0": k, "d0": d, "kT": 1.0})
    close(found.zeros, [-k / d])
    assert found.antiresonances == ()
    without = free_chain(2, sensor=1)
    assert resonances_of(without, {"J0": J0, "J1": J1, "k0": k, "kT": 1.0}).zeros == ()


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_the_reference_drive(output: str) -> None:
    """Zeros: the poles of the drive with its motor held.  Poles: roots of det M(s) of the equations of motion."""
    v = REFERENCE_VALUES
    found = resonances_of(library_three_mass("speed" if output == "speed" else "angle"), v)
    A = three_mass("speed").matrix("A", v)
    held = np.delete(np.delete(A, 2, axis=0), 2, axis=1)
    close(found.zeros, by_size(np.linalg.eigvals(held)))
    assert len(found.antiresonances) == len(found.resonances) == 2
    poles = by_size(equations_of_motion(dict(v)))
    if output == "angle":
        assert found.poles[0] == 0
    close(found.poles[output == "angle" :], poles)


def equations_of_motion(v: dict[str, float]) -> NDArray[np.complex128]:
    """Roots of det(J s^2 + D s + K) in the motor's own units, but for the one of the free angle."""
    r2 = v["r"] ** 2
    J = [v["Jm"], v["Jg"] * r2, v["Ja"] * r2]
    s = np.polynomial.Polynomial([0, 1])
    g, a = (np.polynomial.Polynomial([v[k] * r2, v[d] * r2]) for k, d in (("kg", "dg"), ("ka", "da")))
    m11, m22, m33 = J[0] * s**2 + v["fm"] * s + g, J[1] * s**2 + g + a, J[2] * s**2 + a
    det = m11 * (m22 * m33 - a * a) - g * g * m33
    return np.polynomial.Polynomial(det.coef[1:]).roots().astype(complex)


def by_size(roots: NDArray[np.inexact]) -> list[complex]:
    return sorted(roots.tolist(), key=lambda s: (abs(s), s.real, s.imag))


@law
@given(seed=seeds, masses=st.integers(1, 5), data=st.data())
def test_zeros_are_where_the_response_vanishes(seed: int, masses: int, data: st.DataObject) -> None:
    """det [sI - A, -b; c, 0] over the product of the other factors is zero there, and the count is right."""
    some = st.frozensets(st.integers(0, masses - 1), min_size=masses)
    sensor = data.draw(st.integers(0, masses - 1))
    ss = free_chain(masses, data.draw(some), data.draw(some), sensor)
    rng = np.random.default_rng(seed)
    values = {p.name: float(10 ** rng.uniform(-1, 1)) for p in ss.drawn}
    found = resonances_of(ss, values)
    # With dampers every further mass between torque and sensor costs one zero.
    assert len(found.zeros) == 2 * masses - 2 - sensor
    n = len(ss.states)
    A = np.array([[float(ss.A[i, j].value(values)) if (i, j) in ss.A else 0 for j in range(n)] for i in range(n)])
    b = np.array([float(ss.B[i, 0].value(values)) if (i, 0) in ss.B else 0 for i in range(n)])
    c = np.array([float((0, j) in ss.C) for j in range(n)])
    for zero in found.zeros:
        pencil = np.block([[zero * np.eye(n) - A, -b[:, None]], [c[None], np.zeros((1, 1))]])
        sizes = np.linalg.svd(pencil, compute_uv=False)
        assert sizes[-1] <= 1e-9 * sizes[0]


@law
@given(seed=seeds)
def test_other_units_of_the_states_change_nothing(seed: int) -> None:
    """A torque that acts on the arm, too, and a sensor of several states, so that nothing is zero by itself."""
    drive, rng = three_mass("angle"), np.random.default_rng(seed)
    A = drive.matrix("A", REFERENCE_VALUES)
    b = drive.matrix("B", REFERENCE_VALUES)[:, 0] * [1, 1, 1, 1, 1, 1] + [0, 0, 0, 1e-4, 2e-4, 0]
    c = rng.uniform(0.5, 1.5, 6) * [118, 118, 0.01, 1.18, 1.18, 1]
    original = resonances(A, b, c)
    assert len(original.zeros) == 5
    d = 10.0 ** rng.uniform(-6, 6, len(A))
    converted = resonances(A / d[:, None] * d, b / d, c * d)
    close(converted.zeros, original.zeros, 1e-8)
    close(converted.poles[1:], original.poles[1:])
    assert converted.poles[0] == original.poles[0] == 0
    for zero in original.zeros:
        at = c @ np.linalg.solve(zero * np.eye(6) - A, b)
        near = c @ np.linalg.solve(zero * 1.1 * np.eye(6) - A, b)
        assert abs(at) < 1e-7 * abs(near)


def test_a_double_real_pole_does_not_oscillate(seed: int) -> None:
    """(s + 2)^2 (s + 5), in random states: rounding makes a pair of the two, often with an imaginary part."""
    rng = np.random.default_rng(seed)
    complex_pairs = 0
    for _ in range(50):
        T = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        A = T @ np.array([[-2.0, 1, 0], [0, -2, 1], [0, 0, -5]]) @ T.T
        found = resonances(A, T[:, 2], T[:, 0])
        assert found.resonances == ()
        complex_pairs += any(p.imag for p in found.poles)
        np.testing.assert_allclose(found.poles, [-2, -2, -5], rtol=1e-6)
    assert complex_pairs > 0


def test_an_output_that_the_torque_does_not_reach_has_no_zeros() -> None:
    A = np.diag([-1.0, -2.0, -3.0])
    assert resonances(A, np.array([1.0, 0, 0]), np.array([0, 1.0, 1.0])).zeros == ()
