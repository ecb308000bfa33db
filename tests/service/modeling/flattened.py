"""A second way to read a drive: pymoca's own flattener, and a standard library in other words (rotational.mo).

Its flat equations become numbers, E z' + F z = G c, where the knowns c are the torque, the one, and each nonlinear
function of a variable.  Nothing of this is shared with monitor_core.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
from pymoca import ast, parser, tree

from monitor_core.arrays import Floats

ROOT = Path(__file__).resolve().parents[3]
LIBRARIES = (Path(__file__).with_name("rotational.mo"), ROOT / "config" / "modelica" / "AxisWatch.mo")
ONE = "1"

Sum = dict[str, Fraction]
"""Coefficients of variables, "der(..)" of variables, knowns and ONE."""


@dataclass
class Function:
    """``known`` = function(argument), of the variables."""

    known: str
    function: str
    argument: Sum


class FlatText:
    """The flat equations of a model, each a sum that is zero."""

    def __init__(self, text: str, model: str, values: Mapping[str, float]) -> None:
        """``values``: of parameters of the model, other than the text's."""
        flat = tree.flatten_class(_parsed(text), model)
        self._symbols, self._values = flat.symbols, values
        self.functions: list[Function] = []
        self.equations = [minus(self._sum(e.left), self._sum(e.right)) for e in flat.equations]

    @cached_property
    def parameters(self) -> dict[str, Fraction]:
        names = [n for n, s in self._symbols.items() if "parameter" in s.prefixes and "." not in n]
        return {name: self._parameter(name) for name in names}

    def knowns(self, torque: str) -> list[str]:
        return [torque, ONE, *(f.known for f in self.functions)]

    def variables(self, torque: str) -> list[str]:
        """In the order in which they occur; knowns are not among them."""
        names = dict.fromkeys(undifferentiated(n) for e in self.equations for n in e)
        return [n for n in names if n not in self.knowns(torque)]

    def _sum(self, node: object) -> Sum:
        if isinstance(node, ast.Primary):
            return self._sum(node.value)
        if isinstance(node, int | float):
            return {ONE: number(node)}
        if isinstance(node, ast.Symbol):
            return {ONE: self._parameter(_name_of(node))}
        if isinstance(node, ast.ComponentRef):
            name = str(node)
            known = name in self._symbols and "parameter" in self._symbols[name].prefixes
            return {ONE: self._parameter(name)} if known else {name: Fraction(1)}
        assert isinstance(node, ast.Expression), node
        return self._operation(str(node.operator), [self._sum(operand) for operand in node.operands])

    def _operation(self, operator: str, operands: list[Sum]) -> Sum:
        first, *rest = operands
        if operator == "der":
            ((name, factor),) = first.items()
            return {f"der({name})": factor}
        if not rest and operator in ("+", "-"):
            return times(first, Fraction(1 if operator == "+" else -1))
        if not rest:
            self.functions.append(Function(f"{operator}:{len(self.functions)}", operator, first))
            return {self.functions[-1].known: Fraction(1)}
        (second,) = rest
        if operator in ("+", "-"):
            return plus(first, second) if operator == "+" else minus(first, second)
        if operator == "*":
            return times(second, constant(first)) if first.keys() <= {ONE} else times(first, constant(second))
        assert operator == "/", operator
        return times(first, 1 / constant(second))

    def _parameter(self, name: str) -> Fraction:
        if name in self._values:
            return number(self._values[name])
        return constant(self._sum(self._symbols[name].value))


@dataclass
class Numbers:
    """E z' + F z = G c."""

    variables: list[str]
    knowns: list[str]
    E: Floats
    F: Floats
    G: Floats

    def responses(self, known: str, s: complex) -> dict[str, complex]:
        """Of every variable to a known, by solving (s E + F) z = G c there."""
        pencil = s * self.E + self.F
        rows, columns = (1 / np.sqrt(np.max(np.abs(pencil), axis=axis)) for axis in (1, 0))
        scaled = rows[:, None] * pencil * columns
        z = columns * np.linalg.solve(scaled, rows * self.G[:, self.knowns.index(known)])
        return dict(zip(self.variables, z.tolist(), strict=True))


def numbers(flat: FlatText, torque: str) -> Numbers:
    variables, knowns = flat.variables(torque), flat.knowns(torque)
    assert len(flat.equations) == len(variables), (len(flat.equations), variables)

    def matrix(names: Iterable[str], sign: int = 1) -> Floats:
        return np.array([[float(sign * e.get(name, 0)) for name in names] for e in flat.equations])

    rates = [f"der({v})" for v in variables]
    return Numbers(variables, knowns, matrix(rates), matrix(variables), matrix(knowns, -1))


def plus(left: Sum, right: Sum) -> Sum:
    return {n: left.get(n, Fraction(0)) + right.get(n, Fraction(0)) for n in {**left, **right}}


def minus(left: Sum, right: Sum) -> Sum:
    return plus(left, times(right, Fraction(-1)))


def times(left: Sum, factor: Fraction) -> Sum:
    return {name: c * factor for name, c in left.items()}


def constant(left: Sum) -> Fraction:
    assert left.keys() <= {ONE}, f"not linear: {left}"
    return left.get(ONE, Fraction(0))


def number(value: float) -> Fraction:
    return Fraction(repr(value))


def undifferentiated(name: str) -> str:
    return name.removeprefix("der(").removesuffix(")") if name.startswith("der(") else name


def _name_of(symbol: ast.Symbol) -> str:
    return ".".join(tree.instance.element_instance_name_tuple(symbol)[1:])


def _parsed(text: str) -> ast.Tree:
    """bypass_cache: or pymoca writes to the user's home."""
    root: ast.Tree | None = None
    for source in (*(file.read_text(encoding="utf-8") for file in LIBRARIES), text):
        parsed = parser.parse(source, bypass_cache=True)
        if root is None:
            root = parsed
        else:
            root.extend(parsed)
    assert root is not None
    return root
