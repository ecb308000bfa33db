"""What a flat model does: its transfer functions at one point s, modulo a prime, by Gauss's elimination alone.

Modulo a prime numbers stay short, and two models that agree at random values agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from monitor_core.modeling.flat import FlatModel
from monitor_core.modeling.laurent import Laurent

PRIME = 2**61 - 1
Row = dict[str, int]


def residue(coefficient: Laurent, values: Mapping[str, int]) -> int:
    total = 0
    for monomial, c in coefficient:
        term = c.numerator * pow(c.denominator, -1, PRIME)
        for name, e in monomial:
            term = term * pow(values[name], e, PRIME) % PRIME
        total += term
    return total % PRIME


def responses(
    model: FlatModel, value_of: Callable[[str], int], s: int
) -> dict[tuple[str, int], dict[int, int]]:
    """(sensor's quantity, its number) -> kind of input -> transfer function there.

    Args:
        model: as many equations as variables, or the elimination fails.
        value_of: the value of a parameter, not zero.
        s: where the transfer functions are wanted.
    """
    values = {p.name: value_of(p.name) % PRIME for p in model.parameters}
    kinds = {i.name: i.kind for i in model.inputs}
    solution = solved([row(dict(e.terms), values, s) for e in model.equations], set(kinds))
    found = {}
    for k, sensor in enumerate(model.sensors):
        factor = s if sensor.quantity == "speed" else 1
        angle = solution[sensor.angle]
        found[sensor.quantity, k] = {kinds[u]: -c * factor % PRIME for u, c in angle.items() if c}
    return found


def row(terms: Mapping[tuple[str, int], Laurent], values: Mapping[str, int], s: int) -> Row:
    out: Row = {}
    for (name, order), coefficient in terms.items():
        out[name] = (out.get(name, 0) + residue(coefficient, values) * pow(s, order, PRIME)) % PRIME
    return {name: c for name, c in out.items() if c}


def solved(rows: list[Row], inputs: set[str]) -> dict[str, Row]:
    """Each variable as -(a sum of inputs); fails where the equations do not say."""
    pivots: dict[str, Row] = {}
    for equation in sorted(rows, key=len):
        reduced = _without(equation, pivots)
        name = next(n for n in reduced if n not in inputs)
        scale = pow(reduced.pop(name), -1, PRIME)
        pivot = {n: c * scale % PRIME for n, c in reduced.items()}
        for other, held in pivots.items():
            if name in held:
                pivots[other] = _without(held, {name: pivot})
        pivots[name] = pivot
    return pivots


def _without(equation: Row, pivots: Mapping[str, Row]) -> Row:
    out = dict(equation)
    for name in equation:
        if name in pivots:
            c = out.pop(name)
            for other, d in pivots[name].items():
                out[other] = (out.get(other, 0) - c * d) % PRIME
    return {n: c for n, c in out.items() if c}
