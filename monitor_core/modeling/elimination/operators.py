"""Equations as rows of operators: variable -> polynomial in s = d/dt, the coefficients exact.

A coefficient is a Laurent sum, or an element of the field of rational functions (rational.py) where sums do not
suffice; both add, multiply and divide with the usual signs.
"""

from __future__ import annotations

from typing import Any

from monitor_core.modeling.laurent import Laurent

Coefficient = Any
Operator = dict[int, Coefficient]
"""Power of s -> coefficient, none of them zero."""

Row = dict[str, Operator]
"""Variable or input -> operator, none of them empty: their sum is zero."""


def is_unit(c: Coefficient) -> bool:
    """Whether division by it stays within its ring."""
    return c.is_unit if isinstance(c, Laurent) else bool(c)


def is_number(c: Coefficient) -> bool:
    """Whether it contains no parameter."""
    return c.is_number if isinstance(c, Laurent) else bool(c.numer.is_ground and c.denom.is_ground)


def degree(operator: Operator) -> int:
    """The highest power of s."""
    return max(operator)


def add_multiple(row: Row, factor: Operator, other: Row) -> None:
    """Row += factor * other, in place; zero coefficients are removed."""
    for name, operator in other.items():
        target = row.setdefault(name, {})
        for i, a in factor.items():
            for j, b in operator.items():
                _add(target, i + j, a * b)
        if not target:
            del row[name]


def substitute(row: Row, name: str, solution: Row) -> None:
    """Replace the variable ``name`` in row by its solution, a row that has it with the constant operator c."""
    c = solution[name][0]
    add_multiple(row, {power: -(a / c) for power, a in row[name].items()}, solution)


def _add(operator: Operator, power: int, c: Coefficient) -> None:
    total = operator[power] + c if power in operator else c
    if total:
        operator[power] = total
    else:
        operator.pop(power, None)
