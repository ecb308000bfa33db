"""A drive as a function file for MATLAB's idgrey: the hand-over to the System Identification Toolbox."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from monitor_core.modeling import Laurent, StateSpace
from service.reports.model_facts import input_words, output_words

_WORDS = """
break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd switch
try while
"""
KEYWORDS = frozenset(_WORDS.split())
_OURS = frozenset({"A", "B", "C", "D", "K", "x0", "Ts", "varargin", "zeros"})
_LONGEST = 63
"""Characters of a MATLAB name that count."""


def as_matlab(space: StateSpace, nominal: Mapping[str, float], function: str = "drive") -> str:
    """The function file.  ``nominal``: the values that are known; ``function``: its name, a MATLAB name.

    Raises:
        ValueError: ``function`` cannot be the name of a function.
    """
    if not is_function_name(function):
        raise ValueError(f"{function} is no name for a MATLAB function")
    names = matlab_names((p.name for p in space.parameters), taken={function})
    arguments = ", ".join([*names.values(), "Ts"])
    n, outputs = len(space.states), len(space.sensors)
    lines = (
        f"function [A,B,C,D,K,x0] = {function}({arguments})",
        *(f"% {line}".rstrip() for line in _explanation(space, names, nominal, function)),
        *_assignments(space, names),
        f"D = zeros({outputs},{len(space.inputs)});",
        f"K = zeros({n},{outputs});",
        f"x0 = zeros({n},1);",
        "end",
    )
    return "\n".join(lines) + "\n"


def is_function_name(name: str) -> bool:
    """Whether a function, and so its file, can be called so."""
    return name not in KEYWORDS and matlab_name(name) == name


def matlab_name(name: str) -> str:
    """``motor.J`` -> ``motor_J``: letters, digits and underscores, a letter first."""
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name)[:_LONGEST]
    return plain if plain[:1].isalpha() else f"p_{plain}"[:_LONGEST]


def matlab_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """A MATLAB name for each, no two alike none of them a word of the language."""
    used = {*KEYWORDS, *_OURS, *taken}
    found: dict[str, str] = {}
    for name in names:
        plain, number = matlab_name(name), 1
        candidate = plain
        while candidate in used:
            number += 1
            candidate = f"{plain[: _LONGEST - 4]}_{number}"
        used.add(candidate)
        found[name] = candidate
    return found


def _explanation(
    space: StateSpace, names: Mapping[str, str], nominal: Mapping[str, float], function: str
) -> Iterator[str]:
    yield f"{_line(space.name)}:  dx/dt = A x + B u,  y = C x.  Ts is not used: the drive is in continuous time."
    yield ""
    yield from (f"  x({i}) = {_line(s.name)}  [{s.unit}]" for i, s in enumerate(space.states, 1))
    yield from (f"  u({i}) = {_line(input_words(u))}" for i, u in enumerate(space.inputs, 1))
    yield from (f"  y({i}) = {_line(output_words(s))}" for i, s in enumerate(space.sensors, 1))
    for d in space.definitions:
        yield f"  {names.get(d.name, _line(d.name))} stands for {_line(str(d.value))}"
    yield ""
    yield "From nominal values (NaN: give one):"
    yield "  parameters = {"
    for p in space.parameters:
        words = f"{p.meaning} [{p.unit}]" if p.unit else p.meaning
        value = f"{nominal[p.name]:.12g}" if p.name in nominal else "NaN"
        yield f"    '{names[p.name]}', {value}; ...  {_line(words)}"
    yield "  };"
    yield f"  model = idgrey('{function}', parameters, 'c');"
    yield "  model.Structure.Parameters(1).Free = false;    what is known, here the first one, stays fixed"
    yield "  model = greyest(data, model);"


def _line(text: str) -> str:
    """On one line, whatever the drawing says."""
    return " ".join(text.split())


def _assignments(space: StateSpace, names: Mapping[str, str]) -> Iterator[str]:
    renamed = {name: Laurent.symbol(new) for name, new in names.items() if name != new}
    for letter, entries, (rows, columns) in zip(
        "ABC", (space.A, space.B, space.C), space.shapes, strict=True
    ):
        yield f"{letter} = zeros({rows},{columns});"
        for (row, column), value in sorted(entries.items()):
            yield f"{letter}({row + 1},{column + 1}) = {value.substitute(renamed)};"
