"""Mathematical notation: sympy's matrices are the exact ones, names look as they do in print."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.symbolic import (
    latex,
    latex_name,
    latex_names,
    matrices,
    notation,
    shapes,
    symbols_of,
)
from tests.service.reports.drives import space


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("Jm", "J_{m}"),
        ("motor.J", r"J_{\mathrm{motor}}"),
        ("robot.motor.J", r"J_{\mathrm{robot.motor}}"),
        ("tau0", r"\tau_{0}"),
        ("phi_m", r"\varphi_{m}"),
        ("motor.w", r"\omega_{\mathrm{motor}}"),
        ("Jload2", r"J_{\mathrm{load2}}"),
        ("ka1", r"k_{\mathrm{a1}}"),
        ("kT", "k_{T}"),
        ("r", "r"),
        ("stiffness", r"\mathrm{stiffness}"),
        ("gear.ratio", r"\mathrm{ratio}_{\mathrm{gear}}"),
        ("spring.phi_rel", r"\varphi_{\mathrm{rel,spring}}"),
        ("a&b", r"\mathrm{a\&b}"),
        ("Trägheit", r"\text{Trägheit}"),
    ],
)
def test_names_in_print(name: str, printed: str) -> None:
    assert latex_name(name) == printed


def test_a_derivative_has_its_dots_on_the_letter() -> None:
    assert latex_name("phi_m", dots=1) == r"\dot{\varphi}_{m}"
    assert latex_name("x", dots=2) == r"\ddot{x}"


NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,5}(\.[A-Za-z_][A-Za-z0-9_]{0,5})?", fullmatch=True)


@given(st.lists(NAMES, unique=True, max_size=8))
def test_no_two_names_look_alike(names: list[str]) -> None:
    printed = latex_names([*names, "Jm", "J_m"] if not {"Jm", "J_m"} & set(names) else names)
    assert len(set(printed.values())) == len(printed)


@given(NAMES)
def test_notation_loses_nothing(name: str) -> None:
    letter, subscript = notation(name)
    kept = [c for c in name if c not in "._"]
    assert sorted(c for c in letter + subscript if c not in "._,") == sorted(kept)


def test_sympy_gets_the_exact_entries(seed: int) -> None:
    drive, source = space("angle"), random.Random(seed)
    values = {p.name: Fraction(source.randint(1, 99), source.randint(1, 99)) for p in drive.parameters}
    numbers = {symbol: values[name] for name, symbol in symbols_of(drive).items()}
    all_entries = (drive.A, drive.B, drive.C)
    for matrix, entries, shape in zip(matrices(drive), all_entries, shapes(drive), strict=True):
        assert matrix.shape == shape
        for row in range(shape[0]):
            for column in range(shape[1]):
                expected = entries.get((row, column), Laurent()).value(values)
                assert matrix[row, column].subs(numbers) == expected


def test_a_common_sign_stands_in_front() -> None:
    drive = space()
    symbols = symbols_of(drive)
    printed = latex(drive.A[2, 2], symbols, latex_names(symbols))
    assert printed == r"- \frac{d_{g} r^{2} + f_{m}}{J_{m}}"
    assert latex(Laurent(), symbols, {n: n for n in symbols}) == "0"
