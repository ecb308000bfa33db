"""A drive as the body of a LaTeX article: states, x' = A x + B u, y = C x, parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from monitor_core.kernel.tables import COSINE, COULOMB, ONE, TORQUE
from monitor_core.modeling.flat import FlatInput, FlatParameter, FlatSensor
from monitor_core.modeling.statespace import StateSpace
from monitor_core.modeling.symbolic import (
    latex,
    latex_matrix,
    latex_name,
    latex_names_of,
    latex_text,
    shapes,
    symbols_of,
)

_WIDE = 6
"""A matrix with more columns is scaled down to the width of the text."""
_MOST = 10
"""Columns that amsmath admits without being told."""

_TOKEN = re.compile(r"'[^']+'(?:\.\w+)*|[^\W\d][\w.\[\]]*|[\d.]+|\S")


def as_latex(space: StateSpace, nominal: Mapping[str, float]) -> str:
    """The whole text; it needs the packages amsmath and graphicx.  ``nominal``: the values that are known."""
    widest = max(len(space.states), len(space.inputs))
    lines = (
        r"% \usepackage{amsmath,graphicx}",
        *([rf"\setcounter{{MaxMatrixCols}}{{{widest}}}"] if widest > _MOST else []),
        rf"\section*{{{latex_text(space.name)}}}",
        "States, inputs and outputs:",
        r"\begin{align*}",
        rf"x &= {_vector(formula(state.name) for state in space.states)}, \\",
        rf"u &= {_vector(map(_input, space.inputs))}, \qquad y = {_vector(map(_output, space.sensors))}.",
        r"\end{align*}",
        r"The drive is $\dot{x} = A x + B u$, $y = C x$ with",
        *_matrices(space),
        *_definitions(space),
        *_table(space, nominal),
    )
    return "\n".join(lines) + "\n"


def formula(text: str) -> str:
    r"""What a state is, ``r*motor.phi - gear.phi'``, as a formula: dots in place of strokes."""
    parts: list[str] = []
    tokens = _TOKEN.findall(text)
    for position, token in enumerate(tokens):
        strokes = sum(1 for _ in _strokes(tokens[position + 1 :]))
        if token == "'" or token == "*":
            continue
        is_name = token[0].isalpha() or token[0] in "_'"
        parts.append(latex_name(token, dots=strokes) if is_name else {"^": "^"}.get(token, latex_text(token)))
    return " ".join(parts)


def _strokes(tokens: Iterable[str]) -> Iterator[str]:
    for token in tokens:
        if token != "'":
            return
        yield token


def _vector(elements: Iterable[str]) -> str:
    body = r" \\ ".join(elements)
    return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"


def _input(given: FlatInput) -> str:
    """What the input is; angle and speed are those at the flange of its component."""
    component = given.name.rpartition(".")[0]
    w, phi = (latex_name(f"{component}.{letter}" if component else letter) for letter in ("w", "phi"))
    if given.kind == TORQUE:
        return latex_name(given.name)
    if given.kind == COULOMB:
        return rf"\tanh({w} / \omega_{{0}})"
    if given.kind == ONE:
        return "1"
    return rf"\cos {phi}" if given.kind == COSINE else rf"\sin {phi}"


def _output(sensor: FlatSensor) -> str:
    return latex_name(f"{sensor.name}.{'w' if sensor.quantity == 'speed' else 'phi'}")


def _matrices(space: StateSpace) -> Iterator[str]:
    for letter, entries, (rows, columns) in zip(
        "ABC", (space.A, space.B, space.C), shapes(space), strict=True
    ):
        matrix = f"{letter} = {latex_matrix(space, entries, rows, columns)}"
        end = "." if letter == "C" else ","
        yield rf"\[ {_fitted(matrix) if columns > _WIDE else matrix}{end} \]"


def _fitted(formula: str) -> str:
    """Not wider than the text."""
    return rf"\resizebox{{\linewidth}}{{!}}{{$\displaystyle {formula}$}}"


def _definitions(space: StateSpace) -> Iterator[str]:
    if not space.definitions:
        return
    symbols = symbols_of(space)
    names = latex_names_of(space)
    yield "What cannot be told apart counts as one:"
    for definition in space.definitions:
        yield rf"\[ {names[definition.name]} = {latex(definition.value, symbols, names)} \]"


def _table(space: StateSpace, nominal: Mapping[str, float]) -> Iterator[str]:
    names = latex_names_of(space)
    yield r"\begin{center}\begin{tabular}{lp{0.5\linewidth}rl}"
    yield r"parameter & meaning & nominal & unit \\ \hline"
    for p in space.parameters:
        value = _number(nominal[p.name]) if p.name in nominal else "--"
        yield rf"${names[p.name]}$ & {latex_text(p.meaning)} & {value} & {_unit(p)} \\"
    yield r"\end{tabular}\end{center}"


def _number(value: float) -> str:
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    power = rf" \cdot 10^{{{int(exponent)}}}" if exponent else ""
    return f"${mantissa}{power}$"


def _unit(p: FlatParameter) -> str:
    """``kg m^2`` -> kg m with a raised 2, thin spaces between."""
    if not p.unit:
        return ""
    text = re.sub(r"\^(-?\d+)", r"^{\1}", p.unit).replace(" ", r"\,")
    return rf"$\mathrm{{{text}}}$"
