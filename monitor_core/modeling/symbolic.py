"""A state space as sympy matrices, and as LaTeX as sympy prints it.

sympy is imported only where it is used: it takes half a second to load.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import StateSpace

if TYPE_CHECKING:
    import sympy


def expression(value: Laurent, symbols: Mapping[str, sympy.Symbol]) -> sympy.Expr:
    """A Laurent sum as a sympy expression; the common factor of all terms is outside the brackets."""
    from sympy import Add, Mul, Rational

    def total(part: Laurent) -> sympy.Expr:
        return Add(
            *(
                Mul(Rational(c.numerator, c.denominator), *(symbols[name] ** e for name, e in monomial))
                for monomial, c in part
            )
        )

    if not value:
        return total(value)
    common, rest = value.common_factor()
    return Mul(total(common), total(rest))


def symbols_of(space: StateSpace) -> dict[str, sympy.Symbol]:
    """A sympy symbol for each parameter, drawn or merged, positive where the parameter is."""
    from sympy import Symbol

    positive = {p.name: p.positive for p in (*space.drawn, *space.parameters)}
    names = dict.fromkeys([*positive, *(d.name for d in space.definitions)])
    return {n: Symbol(n, positive=True) if positive.get(n) else Symbol(n, real=True) for n in names}


def matrices(space: StateSpace) -> tuple[sympy.Matrix, sympy.Matrix, sympy.Matrix]:
    """A (n, n), B (n, m) and C (outputs, n) as sympy matrices."""
    from sympy import zeros

    symbols = symbols_of(space)
    filled = []
    for entries, (rows, columns) in zip((space.A, space.B, space.C), space.shapes, strict=True):
        matrix = zeros(rows, columns)
        for (row, column), value in entries.items():
            matrix[row, column] = expression(value, symbols)
        filled.append(matrix)
    return filled[0], filled[1], filled[2]


def as_latex(space: StateSpace) -> str:
    """A, B and C as LaTeX equations for the package amsmath, and merged parameters with their definitions.

    States, inputs and outputs are listed as comments, in the order of the rows and columns.
    """
    from sympy import latex

    symbols = symbols_of(space)
    lines = [
        f"% states: {', '.join(state.name for state in space.states)}",
        f"% inputs: {', '.join(given.name for given in space.inputs)}",
        f"% outputs: {', '.join(sensor.name for sensor in space.sensors)}",
    ]
    lines += [rf"\[ {letter} = {latex(m)} \]" for letter, m in zip("ABC", matrices(space), strict=True)]
    for d in space.definitions:
        lines.append(rf"\[ {latex(symbols[d.name])} = {latex(expression(d.value, symbols))} \]")
    return "\n".join(lines) + "\n"
