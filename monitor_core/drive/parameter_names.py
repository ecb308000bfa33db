"""Names of parameters: of reciprocals such as 1/Ja, and of slopes over signals; values by such names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from monitor_core.arrays import Floats

_OPERATORS = frozenset(" +*/^()")


def split_name(name: str) -> tuple[str, bool]:
    """Name of the parameter, and whether the name is its reciprocal: "1/Ja" gives ("Ja", True).

    ``"1/(Jm + r^2*Jg)"`` is a reciprocal, too; ``"1/k1 + 1/k2"`` is not.
    """
    if name.startswith("1/"):
        base = name[2:].strip()
        if _OPERATORS.isdisjoint(base):
            return base, True
        if _in_brackets(base):
            return base[1:-1].strip(), True
    return name, False


def slope_name(name: str, term: str) -> str:
    """Name of the slope of a parameter over a signal, or a function of signals: "fm per temperature"."""
    return f"{name} per {term}"


def value_of(values: Mapping[str, float], name: str) -> float:
    """The value of the parameter ``name``, which may be a reciprocal such as "1/Ja"."""
    base, inverse = split_name(name)
    return 1 / values[base] if inverse else values[base]


def with_values(values: Mapping[str, float], names: Iterable[str], theta: Iterable[float] | Floats) -> dict[str, float]:
    """The values with those of ``theta`` for parameters with these names, which may be reciprocals such as "1/Ja"."""
    out = dict(values)
    for name, value in zip(names, theta, strict=True):
        base, inverse = split_name(name)
        out[base] = 1 / value if inverse else value
    return out


def _in_brackets(text: str) -> bool:
    """Whether one pair of brackets encloses the whole text."""
    depth = 0
    for k, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth <= 0:
            return k == len(text) - 1 and letter == ")"
    return False
