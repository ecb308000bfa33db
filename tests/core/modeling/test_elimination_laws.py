"""Random drives: the reduced form is the unreduced one, in rational arithmetic, and it is minimal."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import QQ
from sympy.polys.matrices import DomainMatrix

from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.flat import FlatModel
from monitor_core.modeling.statespace import Entries, StateSpace
from tests.core.modeling.random_drives import RandomDrive, drives
from tests.core.modeling.spaces import drawn, minimality

LAWS = settings(deadline=None, max_examples=25)

Matrix = list[list[Fraction]]


def flat(drive: RandomDrive) -> FlatModel:
    return drawn(drive.parts).flat()


def reduced(drive: RandomDrive) -> StateSpace:
    return eliminate(flat(drive))


def exact_values(ss: StateSpace, drive: RandomDrive) -> dict[str, Fraction]:
    """The drawn parameters, and what the merged ones are by their definitions."""
    values = dict(drive.exact)
    for definition in ss.definitions:
        values[definition.name] = definition.value.value(values)
    return values


def dense(entries: Entries, shape: tuple[int, int], values: dict[str, Fraction]) -> Matrix:
    out = [[Fraction(0)] * shape[1] for _ in range(shape[0])]
    for (i, j), entry in entries.items():
        out[i][j] = entry.value(values)
    return out


def domain(matrix: Matrix, columns: int) -> DomainMatrix:
    rows = [[QQ(c.numerator, c.denominator) for c in row] for row in matrix]
    return DomainMatrix(rows, (len(matrix), columns), QQ)


def fraction(c: object) -> Fraction:
    return Fraction(int(c.numerator), int(c.denominator))  # type: ignore[attr-defined]


def unreduced(drive: RandomDrive, s: Fraction) -> DomainMatrix:
    """M s^2 + D s + K."""
    M, D, K = (drive.form(which) for which in "MDK")
    n = range(drive.free)
    return domain([[M[i][j] * s * s + D[i][j] * s + K[i][j] for j in n] for i in n], drive.free)


def response_of_reduced(ss: StateSpace, values: dict[str, Fraction], s: Fraction) -> Fraction:
    n = len(ss.states)
    A, B, C = dense(ss.A, (n, n), values), dense(ss.B, (n, 1), values), dense(ss.C, (1, n), values)
    shifted = [[(s if i == j else 0) - A[i][j] for j in range(n)] for i in range(n)]
    x = domain(shifted, n).lu_solve(domain(B, 1)).to_list()
    return sum((C[0][i] * fraction(x[i][0]) for i in range(n)), Fraction(0))


def response_of_unreduced(drive: RandomDrive, s: Fraction) -> Fraction:
    torque = domain([[c] for c in drive.vector(drive.torque)], 1)
    phi = unreduced(drive, s).lu_solve(torque).to_list()
    angle = sum((c * fraction(phi[i][0]) for i, c in drive.sensor.items()), Fraction(0))
    return angle * (s if drive.parts[-1]["type"] == "speed-sensor" else 1)


POINTS = st.lists(st.builds(Fraction, st.integers(1, 500), st.just(10)), min_size=3, max_size=3, unique=True)


@LAWS
@given(drive=drives(), points=POINTS)
def test_a_reduced_drive_is_the_unreduced_one_exactly_and_minimal(drive: RandomDrive, points: list[Fraction]) -> None:
    """Of a minimal form the characteristic polynomial is right, too."""
    ss = reduced(drive)
    check_transfer_function(ss, drive, points)
    check_minimal(ss, drive)


@pytest.mark.parametrize("grounded", [False, True])
@pytest.mark.parametrize("kinds", [("spring",), ("damper",), ("spring", "damper"), ("spring-damper", "spring")])
@pytest.mark.parametrize("arms", [2, 3, 4])
def test_a_flange_without_inertia_between_several_masses(arms: int, kinds: tuple[str, ...], grounded: bool) -> None:
    """To solve for its motion divides by the sum of its springs, or of its dampers."""
    drive = star(arms, kinds, grounded)
    ss = reduced(drive)
    check_transfer_function(ss, drive, [Fraction(1, 3), Fraction(2), Fraction(7, 5)])
    check_minimal(ss, drive)


def star(arms: int, kinds: tuple[str, ...], grounded: bool) -> RandomDrive:
    drive = RandomDrive()
    middle, ends = drive.node(), [drive.node() for _ in range(arms)]
    for k, end in enumerate(ends):
        J, kind = Fraction(k + 2), kinds[k % len(kinds)]
        drive.add("inertia", [end], J=J)
        drive.inertias.append((J, drive.nodes[end]))
        start = drive.behind_a_gear(end, Fraction(3)) if k == 0 else end
        drive.join(kind, [start, middle], c=Fraction(5 + k), d=Fraction(7 + k))
    if grounded:
        drive.join("spring", [middle, "ground"], c=Fraction(11))
    drive.add("torque", [ends[0]], kT=Fraction(13))
    drive.torque = {i: 13 * c for i, c in drive.nodes[ends[0]].items()}
    drive.add("speed-sensor", [ends[-1]])
    drive.sensor = drive.nodes[ends[-1]]
    return drive


def check_transfer_function(ss: StateSpace, drive: RandomDrive, points: list[Fraction]) -> None:
    """It is that of the unreduced equations."""
    values = exact_values(ss, drive)
    for s in points:  # positive: no pole of a passive drive is there
        assert response_of_reduced(ss, values, s) == response_of_unreduced(drive, s)


def check_minimal(ss: StateSpace, drive: RandomDrive) -> None:
    n = len(ss.states)
    moved, seen = minimality(ss, 1)
    assert (moved < n) == any("no input changes" in note for note in ss.notes)
    assert seen == n
    if moved < n:  # the one such case: an absolute angle whose momentum a damper hands to a grounded part
        assert moved == n - 1
        assert ss.sensors[0].quantity == "angle"
        assert minimality(eliminate(flat(drive), "speed"), 1) == (n - 1, n - 1)
