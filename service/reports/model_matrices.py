"""A, B and C in lines of text: as matrices where they fit, else as equations."""

from __future__ import annotations

from collections.abc import Iterator

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Entries, StateSpace
from monitor_core.modeling.symbolic import shapes

_GAP = 3


def matrix_lines(space: StateSpace, width: int, ascii_only: bool = False) -> list[str]:
    """The three matrices, or x' and y row by row, in lines of at most ``width`` characters where that can be."""
    blocks = [
        matrix(letter, entries, rows, columns, ascii_only)
        for letter, entries, (rows, columns) in zip(
            "ABC", (space.A, space.B, space.C), shapes(space), strict=True
        )
    ]
    if all(len(line) <= width for block in blocks for line in block):
        return [line for block in blocks for line in (*block, "")][:-1]
    return [line for equation in equations(space) for line in wrapped(equation, width)]


def matrix(letter: str, entries: Entries, rows: int, columns: int, ascii_only: bool = False) -> list[str]:
    """The rows, entries in aligned columns, "A =" beside the middle one."""
    zero = Laurent()
    cells = [[str(entries.get((row, column), zero)) for column in range(columns)] for row in range(rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(columns)]
    lines = []
    for number, row in enumerate(cells):
        head = f"{letter} = " if number == (rows - 1) // 2 else " " * (len(letter) + 3)
        body = (" " * _GAP).join(cell.center(size) for cell, size in zip(row, widths, strict=True))
        brackets = (
            "[]" if ascii_only or rows == 1 else "⎡⎤" if number == 0 else "⎣⎦" if number == rows - 1 else "⎢⎥"
        )
        lines.append(f"{head}{brackets[0]} {body} {brackets[1]}")
    return lines


def equations(space: StateSpace) -> Iterator[list[str]]:
    """``["x3' =", "-kg*r/Jm*x1", "+ kT/Jm*u1"]``: each row as its left side and its terms."""
    n, m, outputs = len(space.states), len(space.inputs), len(space.sensors)
    for row in range(n):
        terms = [(space.A.get((row, i)), f"x{i + 1}") for i in range(n)]
        terms += [(space.B.get((row, i)), f"u{i + 1}") for i in range(m)]
        yield [f"x{row + 1}' =", *_sum(terms)]
    for row in range(outputs):
        yield [f"y{row + 1} =", *_sum([(space.C.get((row, i)), f"x{i + 1}") for i in range(n)])]


def _sum(terms: list[tuple[Laurent | None, str]]) -> Iterator[str]:
    first = True
    for coefficient, symbol in terms:
        if not coefficient:
            continue
        text = product(coefficient, symbol)
        sign, rest = ("-", text[1:]) if text.startswith("-") else ("+", text)
        yield (text if first else f"{sign} {rest}")
        first = False
    if first:
        yield "0"


def product(coefficient: Laurent, symbol: str) -> str:
    """``-kg*r/Jm*x1``; sums in brackets."""
    if coefficient == Laurent.number(1):
        return symbol
    if coefficient == Laurent.number(-1):
        return f"-{symbol}"
    text = str(coefficient)
    bare = not coefficient.is_unit and coefficient.common_factor()[0] == Laurent.number(1)
    return f"({text})*{symbol}" if bare else f"{text}*{symbol}"


def wrapped(equation: list[str], width: int) -> Iterator[str]:
    """The terms of an equation over lines, the following ones below the first term."""
    line = equation[0]
    for number, term in enumerate(equation[1:]):
        if number and len(line) + 1 + len(term) > width:
            yield line
            line = " " * len(equation[0])
        line = f"{line} {term}"
    yield line
