"""sympy's matrices are the exact ones."""

from __future__ import annotations

import random
from fractions import Fraction

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.symbolic import as_latex, matrices, symbols_of
from tests.service.reports.made import merged, space


def test_sympy_gets_the_exact_entries(seed: int) -> None:
    drive, source = space("angle"), random.Random(seed)
    values = {p.name: Fraction(source.randint(1, 99), source.randint(1, 99)) for p in drive.parameters}
    numbers = {symbol: values[name] for name, symbol in symbols_of(drive).items()}
    all_entries = (drive.A, drive.B, drive.C)
    for matrix, entries, shape in zip(matrices(drive), all_entries, drive.shapes, strict=True):
        assert matrix.shape == shape
        for row in range(shape[0]):
            for column in range(shape[1]):
                expected = entries.get((row, column), Laurent()).value(values)
                assert matrix[row, column].subs(numbers) == expected


def test_latex_has_the_three_matrices_and_the_merged_parameters() -> None:
    text = as_latex(space())
    assert [line[:6] for line in text.splitlines()[3:]] == [r"\[ A =", r"\[ B =", r"\[ C ="]
    assert r"\frac{k_{g} r}{J_{m}}" in text.replace("kg", "k_{g}").replace("Jm", "J_{m}")
    definitions = as_latex(merged(space())).splitlines()[6:]
    assert len(definitions) == len(merged(space()).definitions) > 0
