"""Ranks modulo a prime, against ranks in exact rational arithmetic and against drives with a hidden part."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import QQ, ZZ
from sympy.polys.matrices import DomainMatrix

from monitor_core.arrays import Ints
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modular import (
    PRIMES,
    ModularPoint,
    echelon,
    null_space,
    points_of,
    product,
    rank,
    residue,
)
from tests.core.modeling.spaces import minimality, some_chain, table

law = settings(deadline=None, max_examples=30)
seeds = st.integers(0, 2**32 - 1)
primes = st.sampled_from(PRIMES)


def of_rank(rng: np.random.Generator, rows: int, columns: int, r: int) -> Ints:
    """Small integers; the rank is r for almost all of them."""
    return np.asarray(rng.integers(-9, 10, (rows, r)) @ rng.integers(-9, 10, (r, columns)), dtype=np.int64)


def test_the_primes_are_prime_and_leave_room_for_a_product() -> None:
    for prime in PRIMES:
        assert all(prime % d for d in range(2, int(prime**0.5) + 1))
        assert (prime - 1) ** 2 < 2**63


@law
@given(seed=seeds, shape=st.tuples(st.integers(1, 7), st.integers(1, 7)), r=st.integers(0, 7), prime=primes)
def test_rank_and_null_space_are_those_over_the_rationals(
    seed: int, shape: tuple[int, int], r: int, prime: int
) -> None:
    M = of_rank(np.random.default_rng(seed), *shape, min(r, *shape))
    rref, columns = DomainMatrix(M.tolist(), M.shape, ZZ).convert_to(QQ).rref()
    null = null_space(M, prime)
    assert len(null) == shape[1] - len(columns)
    assert not product(M % prime, null.T, prime).any()
    assert rank(null, prime) == len(null)
    reduced, pivots = echelon(M, prime)
    assert pivots == columns
    assert reduced.tolist() == [
        [int(v.numerator) * pow(int(v.denominator), -1, prime) % prime for v in row]
        for row in rref.to_list()[: len(columns)]
    ]
    assert rank(M, prime) == len(columns)


@law
@given(seed=seeds, prime=primes)
def test_residues_are_a_ring_homomorphism(seed: int, prime: int) -> None:
    rng = np.random.default_rng(seed)
    point = ModularPoint(prime, {name: int(rng.integers(1, prime)) for name in "abc"})

    def draw() -> Laurent:
        terms = []
        for _ in range(rng.integers(1, 4)):
            exponents = rng.integers(-2, 3, 3)
            monomial = tuple((n, int(e)) for n, e in zip("abc", exponents, strict=True) if e)
            terms.append((monomial, Fraction(int(rng.integers(-9, 10)), int(rng.integers(1, 9)))))
        return Laurent(terms)

    f, g = draw(), draw()
    assert residue(f * g + f, point) == (residue(f, point) * residue(g, point) + residue(f, point)) % prime
    exact = f.value({name: Fraction(v) for name, v in point.values.items()})
    if f:
        assert residue(f, point) == exact.numerator * pow(exact.denominator, -1, prime) % prime


def test_definitions_are_evaluated_in_order(seed: int) -> None:
    ss = table({(0, 0): "-f/L"}, {(0, 0): "kT/L"}, {(0, 0): "1"}, definitions={"K": "J1 + r^2*J2", "L": "K + J3"})
    for prime, v in points_of(ss, seed):
        assert v["L"] == (v["J1"] + v["r"] ** 2 * v["J2"] + v["J3"]) % prime


@law
@given(seed=seeds, masses=st.integers(1, 5), data=st.data())
def test_chains_are_minimal(seed: int, masses: int, data: st.DataObject) -> None:
    """Deflections and speeds: one state less than coordinates and speeds, whatever the damping and the sensor."""
    assert minimality(some_chain(masses, data), seed) == (2 * masses - 1, 2 * masses - 1)


@pytest.mark.parametrize(
    ("A", "B", "C", "expected"),
    [
        ({(0, 0): "a", (1, 1): "b"}, {(0, 0): "1"}, {(0, 0): "1", (0, 1): "1"}, (1, 2)),
        ({(0, 0): "a", (1, 1): "b"}, {(0, 0): "1", (1, 0): "1"}, {(0, 0): "1"}, (2, 1)),
        ({(0, 0): "a", (1, 1): "a"}, {(0, 0): "1", (1, 0): "b"}, {(0, 0): "1", (0, 1): "1"}, (1, 1)),
        ({(0, 1): "a"}, {(1, 0): "b"}, {(1, 0): "1", (0, 1): "1"}, (2, 2)),
        ({(0, 0): "a", (1, 0): "0*a"}, {(0, 0): "1"}, {(0, 1): "1"}, (1, 1)),
    ],
)
def test_hidden_parts(
    seed: int,
    A: dict[tuple[int, int], str],
    B: dict[tuple[int, int], str],
    C: dict[tuple[int, int], str],
    expected: tuple[int, int],
) -> None:
    """Not reached; not seen; two equal modes; a chain; nothing between input and output."""
    assert minimality(table(A, B, C), seed) == expected
