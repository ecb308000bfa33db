"""Syntax of a Modelica text: classes, components, modifications, equations, each with its line.

It contains what a drive may be drawn with; the rest is kept by name (Other), so that it can be refused where it
matters.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Source:
    """A Modelica text; ``name`` is the file as the user is shown it."""

    name: str
    text: str


# --- expressions ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Number:
    """A literal, exact as it is written."""

    value: Fraction
    line: int


@dataclass(frozen=True, slots=True)
class Literal:
    """A string or a truth value."""

    value: str | bool
    line: int


@dataclass(frozen=True, slots=True)
class Name:
    """``motor.flange_a``; ``subscripts``: array elements are named somewhere in it."""

    parts: tuple[str, ...]
    line: int
    subscripts: bool = False

    def __str__(self) -> str:
        return ".".join(self.parts)


@dataclass(frozen=True, slots=True)
class Operation:
    """``+ - * / ^ and or not`` and comparisons, of one or two operands."""

    symbol: str
    operands: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Call:
    """A function of its arguments; ``der`` is one."""

    function: str
    arguments: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Array:
    """``{a, b}``; a matrix is an array of rows."""

    values: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Other:
    """Something else: ``what`` says what it is, in words."""

    what: str
    line: int


Expression: TypeAlias = Number | Literal | Name | Operation | Call | Array | Other

# --- declarations --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Modification:
    """``name(inner ...) = value`` in the brackets after a component or base class."""

    name: tuple[str, ...]
    line: int
    value: Expression | None = None
    inner: tuple[Modification, ...] = ()
    final: bool = False
    refused: str = ""  # "redeclare"


@dataclass(frozen=True, slots=True)
class Component:
    """``parameter Real J(min = 0) = 1 if b "comment"``."""

    name: str
    type: Name
    line: int
    variability: str = ""  # parameter, constant
    causality: str = ""  # input, output
    flow: bool = False
    final: bool = False
    modifications: tuple[Modification, ...] = ()
    value: Expression | None = None
    condition: Expression | None = None
    comment: str = ""
    refused: str = ""  # "inner", "array", ...


@dataclass(frozen=True, slots=True)
class Extends:
    """A base class and the modifications of what it brings along."""

    base: Name
    modifications: tuple[Modification, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Import:
    """``import alias = path``, ``import path`` (alias is its last name), ``import path.*`` (alias is "*")."""

    path: tuple[str, ...]
    alias: str
    line: int


@dataclass(frozen=True, slots=True)
class Equation:
    """left = right."""

    left: Expression
    right: Expression
    line: int


@dataclass(frozen=True, slots=True)
class Connect:
    """connect(left, right)."""

    left: Name
    right: Name
    line: int


Statement: TypeAlias = Equation | Connect | Other


@dataclass(slots=True, eq=False)
class ClassDef:
    """A class with all that is in it; ``prefix`` is the causality in ``connector RealInput = input Real``."""

    name: str
    sort: str  # model, block, connector, package, type, ...
    file: str
    line: int
    parent: ClassDef | None = field(default=None, repr=False)
    partial: bool = False
    comment: str = ""
    prefix: str = ""
    refused: tuple[Other, ...] = ()
    classes: dict[str, ClassDef] = field(default_factory=dict)
    imports: list[Import] = field(default_factory=list)
    extends: list[Extends] = field(default_factory=list)
    components: dict[str, Component] = field(default_factory=dict)
    statements: list[Statement] = field(default_factory=list)

    @property
    def path(self) -> tuple[str, ...]:
        """The names of the enclosing packages and its own."""
        around = self.parent.path if self.parent is not None else ()
        return (*around, self.name) if self.name else around

    def __str__(self) -> str:
        return ".".join(self.path)


@dataclass(frozen=True, slots=True)
class Text:
    """A parsed text: its classes, and the package that they are ``within``."""

    source: Source
    within: tuple[str, ...]
    classes: tuple[ClassDef, ...]
