"""A state space in mathematical notation: sympy's matrices, LaTeX, and what a name looks like in print.

sympy is imported only where it is used: it takes half a second, and names need none of it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Entries, StateSpace

if TYPE_CHECKING:
    import sympy

GREEK = {
    **{name: name for name in ("alpha", "beta", "gamma", "delta", "zeta", "eta", "theta", "kappa", "lambda")},
    **{name: name for name in ("mu", "nu", "xi", "rho", "sigma", "tau", "chi", "psi", "omega")},
    "epsilon": "varepsilon",
    "phi": "varphi",
    "w": "omega",  # as Modelica's standard library writes an angular velocity
}
"""Spelled letters and their LaTeX commands."""

_GREEK_FIRST = re.compile(
    rf"({'|'.join(sorted((g for g in GREEK if len(g) > 1), key=len, reverse=True))})(\d*)"
)
_FORMULA = frozenset(" +*/^()")
_LETTERS = {"kg m^2": "J", "N m/rad": "k", "N m s/rad": "d"}
"""Of merged parameters, by their unit."""
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{letter: f"\\{letter}" for letter in "_&%#${}"},
}


def notation(name: str) -> tuple[str, str]:
    """The letter of a parameter and its subscript: Jm -> J, m;  motor.J -> J, motor;  tau0 -> tau, 0."""
    path, _, last = name.rpartition(".")
    letter, subscript = _split(last)
    return letter, ",".join(filter(None, (subscript, path)))


def _split(word: str) -> tuple[str, str]:
    head, _, tail = word.partition("_")
    if head and tail:
        letter, subscript = _split(head)
        return letter, ",".join(filter(None, (subscript, tail)))
    if greek := _GREEK_FIRST.fullmatch(word):
        return greek[1], greek[2]
    if re.fullmatch(r"[A-Z][A-Za-z0-9]+|[a-z]([A-Z][A-Za-z0-9]*|[a-z]?\d+|[a-z])", word):
        return word[0], word[1:]
    return word, ""


def latex_text(text: str) -> str:
    """Text outside of formulas."""
    return "".join(_SPECIAL.get(letter, letter) for letter in text)


def latex_name(name: str, dots: int = 0) -> str:
    r"""``Jm`` -> ``J_{m}``, ``motor.J`` -> ``J_{\mathrm{motor}}``; ``dots``: of a time derivative."""
    letter, subscript = notation(name)
    base = rf"\{GREEK[letter]}" if letter in GREEK else _upright(letter)
    if dots:
        base = rf"\{'d' * dots}ot{{{base}}}"
    return rf"{base}_{{{_upright(subscript)}}}" if subscript else base


def _upright(word: str) -> str:
    """Words stand upright; single letters and numbers as formulas have them."""
    if re.fullmatch(r"[A-Za-z]|\d+", word):
        return word
    return rf"\{'mathrm' if word.isascii() and ' ' not in word else 'text'}{{{latex_text(word)}}}"


def latex_names(names: Iterable[str]) -> dict[str, str]:
    """The LaTeX of each name; names that would look the same (J_m, Jm) are written out."""
    found = {name: latex_name(name) for name in names}
    looks = list(found.values())
    return {
        name: text if looks.count(text) == 1 else rf"\mathrm{{{latex_text(name)}}}"
        for name, text in found.items()
    }


def latex_names_of(space: StateSpace) -> dict[str, str]:
    r"""The LaTeX of each parameter; merged ones, whose name is a formula, are ``\bar{J}_{1}`` and so on."""
    formulas = [d.name for d in space.definitions if _FORMULA & set(d.name)]
    names = latex_names(name for name in symbols_of(space) if name not in formulas)
    units = {p.name: p.unit for p in space.parameters}
    letters = [_LETTERS.get(units.get(name, ""), "p") for name in formulas]
    merged = (rf"\bar{{{letter}}}_{{{number}}}" for number, letter in enumerate(letters, 1))
    return names | dict(zip(formulas, merged, strict=True))


def expression(value: Laurent, symbols: Mapping[str, sympy.Symbol]) -> sympy.Expr:
    """A Laurent sum as a sympy expression, what is common to all of its terms outside."""
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
    """A (n, n), B (n, m) and C (outputs, n) for sympy."""
    from sympy import zeros

    symbols = symbols_of(space)
    found = []
    for entries, (rows, columns) in zip((space.A, space.B, space.C), shapes(space), strict=True):
        matrix = zeros(rows, columns)
        for (row, column), value in entries.items():
            matrix[row, column] = expression(value, symbols)
        found.append(matrix)
    return found[0], found[1], found[2]


def shapes(space: StateSpace) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    """Rows and columns of A, B, C."""
    n, m, outputs = len(space.states), len(space.inputs), len(space.sensors)
    return (n, n), (n, m), (outputs, n)


def latex(value: Laurent, symbols: Mapping[str, sympy.Symbol], names: Mapping[str, str]) -> str:
    """The formula of an entry, a common sign in front."""
    import sympy

    if value and value.common_factor()[0].value(dict.fromkeys(value.names, 1)) < 0:
        return f"- {latex(-value, symbols, names)}"
    return str(sympy.latex(expression(value, symbols), symbol_names={symbols[n]: names[n] for n in symbols}))


def latex_matrix(space: StateSpace, entries: Entries, rows: int, columns: int) -> str:
    """A matrix of formulas as an amsmath bmatrix, a row in a line."""
    symbols = symbols_of(space)
    names = latex_names_of(space)
    body = " \\\\[0.6ex]\n".join(
        " & ".join(latex(entries.get((row, column), Laurent()), symbols, names) for column in range(columns))
        for row in range(rows)
    )
    return f"\\begin{{bmatrix}}\n{body}\n\\end{{bmatrix}}"
