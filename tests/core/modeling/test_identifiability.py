"""Structural identifiability: small drives by hand, and the count of what is seen by another route."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor_core.kernel.tables import COULOMB, ONE, TORQUE
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.identifiability import structural
from monitor_core.modeling.identifiability.lattice import fraction, integers, short_basis
from monitor_core.modeling.modular import PRIMES, echelon
from monitor_core.modeling.standard_drives import DRAWINGS
from monitor_core.modeling.statespace import Entries, StateSpace
from tests.core.modeling.spaces import Table, free_chain, library_three_mass, some_chain, table

law = settings(deadline=None, max_examples=25)
seeds = st.integers(0, 2**32 - 1)
Complex = NDArray[np.complex128]

ARM = ("Ja", "Jg", "Jm", "da", "dg", "fm", "ka", "kg")


# --- by hand ---------------------------------------------------------------------------------------------


def test_one_mass(seed: int) -> None:
    """Jm w' = kT tau: the ratio; with friction two of them."""
    free = structural(table({}, {(0, 0): "kT/Jm"}, {(0, 0): "1"}), seed=seed)
    assert free.combinations == ("kT/Jm",)
    assert free.groups == (("Jm", "kT"),)
    assert free.suggestion == ("kT",)
    assert free.words() == (
        "Only kT/Jm can be seen: Jm and kT cannot be distinguished.",
        "Hold kT known and Jm can be found.",
    )
    friction = structural(table({(0, 0): "-fm/Jm"}, {(0, 0): "kT/Jm"}, {(0, 0): "1"}), seed=seed)
    assert set(friction.combinations) == {"kT/Jm", "fm/Jm"}
    assert friction.count == 2


def test_three_masses(seed: int) -> None:
    """The scale of all torques, and the scale of the arm's side, are hidden; no more."""
    everything = structural(library_three_mass(), seed=seed)
    assert everything.count == 8
    assert everything.groups == (tuple(sorted((*ARM, "kT", "r"))),)
    assert everything.unnamed == (0,)
    assert set(everything.suggestion) == {"kT", "r"}
    assert {"kT/Jm", "fm/Jm", "kg/Ja", "dg/Ja"} <= set(everything.combinations)
    known = structural(library_three_mass(), ARM, seed)
    assert known.identifiable == ARM
    assert (*known.groups, *known.invisible, *known.suggestion) == ()
    assert known.words() == ("Ja, Jg, Jm, da, dg, fm, ka and kg can be found.",)


@pytest.mark.parametrize("name", ["two-mass", "three-mass", "five-mass"])
def test_drawn_chains(name: str, seed: int) -> None:
    """Through the elimination: all is seen but two scales, that of all torques and that of the arm's side."""
    found = structural(eliminate(DRAWINGS[name].flat()), seed=seed)
    parameters = DRAWINGS[name].meanings
    assert sum(map(len, found.groups)) == len(parameters)
    assert found.count == len(parameters) - 2
    assert sum(found.unnamed) == 0
    assert found.suggestion == ("kT", "r")


def test_angle_sensor_sees_as_much(seed: int) -> None:
    kinds = (TORQUE, COULOMB, ONE)
    for output in ("speed", "angle"):
        found = structural(library_three_mass(output, kinds), seed=seed)
        assert found.count == 10
        assert {"fc/Jm", "tau0/Jm"} <= set(found.combinations)


def test_an_input_that_is_not_known_tells_nothing(seed: int) -> None:
    ss = library_three_mass("speed", (TORQUE, COULOMB, ONE))
    assert structural(ss, seed=seed, inputs=(0, 1)).invisible == ("tau0",)
    assert structural(ss, seed=seed, inputs=(0,)).invisible == ("fc", "tau0")
    only_friction = structural(ss, seed=seed, inputs=(1,))
    assert only_friction.invisible == ("kT", "tau0")
    assert "kT cannot be seen at all: whatever its value, the sensors show the same." in only_friction.words()


CASES: list[tuple[Table, Table, dict[str, str], tuple[str, ...], set[str]]] = [
    # two dampers of one mass are seen as a sum
    ({(0, 0): "-f1/J - f2/J"}, {(0, 0): "kT/J"}, {}, (), {"(f1 + f2)/J", "kT/J"}),
    ({(0, 0): "-f1 - 2*f2"}, {(0, 0): "kT"}, {}, ("kT",), {"f1 + 2*f2"}),
    ({(0, 0): "-2*f1/J - 3*f2/J"}, {(0, 0): "kT/J"}, {}, (), {"(2*f1 + 3*f2)/J", "kT/J"}),
    # merged inertias, written as drawn
    ({(0, 0): "-f/M"}, {(0, 0): "kT/M"}, {"M": "J1 + J2*r^2"}, (), {"f/(J1 + J2*r^2)", "kT/(J1 + J2*r^2)"}),
    ({(0, 0): "-f/M"}, {(0, 0): "1/M"}, {"M": "J1 + J2*r^2"}, ("f",), {"J1 + J2*r^2"}),
    # merged twice
    ({(0, 0): "-f/M"}, {(0, 0): "1/M"}, {"L": "J1 + J2", "M": "L + J3"}, ("f",), {"J1 + J2 + J3"}),
    # friction on both sides of a gear: read from the entries
    ({(0, 0): "-f1/M - f2*r^2/M"}, {(0, 0): "1/M"}, {"M": "J1 + J2*r^2"}, (), {"J1 + J2*r^2", "f1 + f2*r^2"}),
    (
        {(0, 0): "-f1/M - f2*r^2/M"},
        {(0, 0): "kT/M"},
        {"M": "J1 + J2*r^2"},
        (),
        {"kT/(J1 + J2*r^2)", "(f1 + f2*r^2)/(J1 + J2*r^2)"},
    ),
    # merged parameters that are not independent of the others: as drawn
    ({(0, 0): "-M/J1"}, {(0, 0): "J2/J1"}, {"M": "J1 + J2"}, (), {"J2/J1"}),
    ({(0, 0): "-k*f/s"}, {(0, 0): "k"}, {"s": "k + f"}, ("f", "k"), set()),
    # the spring is seen through the ratio only, squared
    ({(0, 1): "1", (1, 0): "-k*r^2"}, {(1, 0): "kT"}, {}, ("kT",), {"k*r^2"}),
    # three factors
    ({(0, 0): "-a*b*c"}, {(0, 0): "a*b*c"}, {}, (), {"a*b*c"}),
]


@pytest.mark.parametrize(("A", "B", "definitions", "alone", "seen"), CASES)
def test_combinations(
    seed: int, A: Table, B: Table, definitions: Mapping[str, str], alone: tuple[str, ...], seen: set[str]
) -> None:
    n = 1 + max(row for row, _ in A)
    found = structural(table(A, B, {(0, n - 1): "1"}, definitions=definitions), seed=seed)
    assert found.identifiable == alone
    assert set(found.combinations) == seen
    assert sum(found.unnamed) == 0


def test_what_has_no_simple_form_is_counted(seed: int) -> None:
    """Only the product of two sums is seen."""
    ss = table({(0, 1): "a + b*r", (1, 0): "-c - d*r"}, {(0, 0): "1"}, {(0, 0): "1"})
    found = structural(ss, seed=seed)
    assert found.combinations == ()
    assert found.unnamed == (1,)
    assert found.words()[0] == ("Only one combination can be seen: a, b, c, d and r cannot be distinguished.")
    without_ratio = structural(ss, "abcd", seed)
    assert without_ratio.unnamed == (1,)
    plain = table({(0, 1): "a + b", (1, 0): "-c - d"}, {(0, 0): "1"}, {(0, 0): "1"})
    assert structural(plain, seed=seed).combinations == ("(a + b)*(c + d)",)


def test_the_suggestion_is_enough_and_no_part_of_it_is(seed: int) -> None:
    """The suggestion is as small as can be and enough; without any one of it, it is not."""
    for N in (1, 2, 3):
        ss = free_chain(N, range(N), [0])
        names = [p.name for p in ss.drawn]
        suggestion = structural(ss, seed=seed).suggestion
        rest = [name for name in names if name not in suggestion]
        assert structural(ss, rest, seed).identifiable == tuple(rest)
        for name in suggestion:
            assert structural(ss, [*rest, name], seed).suggestion


def test_two_groups_need_one_known_parameter_each(seed: int) -> None:
    """Of a*b only one is held, however well both are known."""
    ss = table({(0, 0): "-a*b"}, {(0, 0): "kT/J"}, {(0, 0): "1"})
    assert structural(ss, seed=seed).suggestion == ("a", "kT")


# --- the count, by another route: the coefficients of the transfer function, floating point, SVD -----------


def numeric(entries: Entries, shape: tuple[int, int], values: Mapping[str, complex]) -> Complex:
    out = np.zeros(shape, dtype=complex)
    for place, entry in entries.items():
        out[place] = entry.value(values)
    return out


def characteristic(A: Complex) -> Complex:
    """Coefficients of det(s I - A) by Faddeev and Leverrier, which is analytic in A."""
    n = len(A)
    M, out = np.zeros_like(A), [1.0 + 0j]
    for k in range(1, n + 1):
        M = A @ M + out[-1] * np.eye(n)
        out.append(-np.trace(A @ M) / k)
    return np.array(out)


def coefficients(ss: StateSpace, values: Mapping[str, complex]) -> Complex:
    n = len(ss.states)
    A, B, C = (numeric(M, s, values) for M, s in ((ss.A, (n, n)), (ss.B, (n, 1)), (ss.C, (1, n))))
    below = characteristic(A)
    return np.concatenate([below[1:], (characteristic(A - B @ C) - below)[1:]])


def jacobian_of(ss: StateSpace, names: Sequence[str], seed: int) -> tuple[dict[str, float], NDArray[np.float64]]:
    """Values, and the derivatives of the coefficients by these names there."""
    rng = np.random.default_rng(seed)
    values = {p.name: rng.uniform(0.7, 1.4) for p in ss.drawn}
    columns = [np.imag(coefficients(ss, {**values, name: values[name] + 1e-30j})) / 1e-30 for name in names]
    return values, np.array(columns).T


def rank_by_svd(ss: StateSpace, names: Sequence[str], seed: int) -> int:
    _, jacobian = jacobian_of(ss, names, seed)
    lengths = np.linalg.norm(jacobian, axis=1, keepdims=True)
    jacobian = np.where(lengths > 1e-11, jacobian, 0) / np.maximum(lengths, 1e-11)  # zero up to rounding
    sizes = np.linalg.svd(jacobian, compute_uv=False)
    assume(not np.any((sizes > 1e-12) & (sizes < 1e-7)))  # else floating point cannot tell
    return int(np.sum(sizes > 1e-9))


@law
@given(seed=seeds, masses=st.integers(1, 3), data=st.data())
def test_as_many_are_seen_as_the_transfer_function_has_free_coefficients(
    seed: int, masses: int, data: st.DataObject
) -> None:
    ss = some_chain(masses, data)
    names = data.draw(st.lists(st.sampled_from([p.name for p in ss.drawn]), min_size=1, unique=True))
    found = structural(ss, names, seed)
    assert found.count == rank_by_svd(ss, names, seed)
    assert sorted([*found.identifiable, *found.invisible, *(n for g in found.groups for n in g)]) == sorted(names)


@law
@given(seed=seeds, masses=st.integers(1, 3), data=st.data())
def test_what_can_be_found_is_what_no_hidden_direction_moves(seed: int, masses: int, data: st.DataObject) -> None:
    """A parameter if holding it known leaves one less to find; a combination if its value stands still along them."""
    ss = some_chain(masses, data)
    names = [p.name for p in ss.drawn]
    found = structural(ss, names, seed)
    values, jacobian = jacobian_of(ss, names, seed)
    for name, column in zip(names, jacobian.T, strict=True):
        without = rank_by_svd(ss, [other for other in names if other != name], seed)
        assert (name in found.identifiable) == (without == found.count - 1)
        assert (name in found.invisible) == (np.abs(column).max() < 1e-12)
    for direction in np.linalg.svd(jacobian)[2][found.count :]:
        for text in found.combinations:
            assert abs(change(text, names, values, direction)) < 1e-9


def change(text: str, names: Sequence[str], values: Mapping[str, float], direction: NDArray[np.float64]) -> float:
    """Derivative of the combination's value, its text read as Python."""
    moved = {n: values[n] + 1e-30j * d for n, d in zip(names, direction, strict=True)}
    assert re.fullmatch(r"[\w*/^()+ ]+", text)
    return float(np.imag(eval(text.replace("^", "**"), {}, moved)) / 1e-30)


# --- small integers from residues ------------------------------------------------------------------------


@law
@given(a=st.integers(-30_000, 30_000), b=st.integers(1, 30_000), prime=st.sampled_from(PRIMES))
def test_small_fractions_are_read_from_their_residues(a: int, b: int, prime: int) -> None:
    found = fraction(a * pow(b, -1, prime) % prime, prime)
    assert found is not None
    assert found * b == a


def test_few_residues_are_small_fractions(seed: int) -> None:
    """Of random ones about 0.6: what is found in two primes at once is there."""
    draws = np.random.default_rng(seed).integers(1, PRIMES[0], 2000)
    by_both = sum(fraction(int(v), PRIMES[0]) == fraction(int(v), PRIMES[1]) is not None for v in draws if v > 40_000)
    assert by_both == 0


@law
@given(seed=seeds, columns=st.integers(1, 6), rows=st.integers(1, 5))
def test_short_vectors_span_the_same_space(seed: int, columns: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    space = rng.integers(-2, 3, (min(rows, columns), columns)) * (rng.random((min(rows, columns), columns)) < 0.6)
    basis = [v for row in echelon(space, PRIMES[0])[0] if (v := integers(row, PRIMES[0]))]
    assume(basis)
    order = rng.permutation(columns).tolist()
    short = short_basis(basis, order, PRIMES[0])
    assert np.array_equal(echelon(np.array(short), PRIMES[0])[0], echelon(np.array(basis), PRIMES[0])[0])
    assert len(short) == len(basis)
    for vector in short:
        entries = [vector[j] for j in order if vector[j]]
        assert entries[0] < 0 or min(entries) > 0
        assert len(entries) <= columns - len(basis) + 1
