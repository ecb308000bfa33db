"""What a flat model does: its transfer functions at one point s, modulo a prime.

Modulo a prime numbers stay short, and two models that agree at random values agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from sympy import GF
from sympy.polys.matrices import DomainMatrix

from monitor_core.modeling.flat import FlatModel
from monitor_core.modeling.laurent import Laurent

PRIME = 2**61 - 1
FIELD = GF(PRIME, symmetric=False)


def residue(coefficient: Laurent, values: Mapping[str, Fraction]) -> int:
    value = Fraction(coefficient.value(values))
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME


def responses(model: FlatModel, value_of: Callable[[str], int], s: int) -> dict[tuple[str, int], dict[int, int]]:
    """(sensor's quantity, its number) -> kind of input -> transfer function there.

    Args:
        model: as many equations as variables, or there is no solution.
        value_of: the value of a parameter, not zero.
        s: where the transfer functions are wanted.
    """
    values = {p.name: Fraction(value_of(p.name)) for p in model.parameters}
    names = [v.name for v in model.variables]
    column = {name: j for j, name in enumerate([*names, *(i.name for i in model.inputs)])}
    rows = [[FIELD(0)] * len(column) for _ in model.equations]
    for row, equation in zip(rows, model.equations, strict=True):
        for (name, order), coefficient in equation.terms.items():
            row[column[name]] += FIELD(residue(coefficient, values) * pow(s, order, PRIME))
    M, n = DomainMatrix(rows, (len(rows), len(column)), FIELD), len(names)
    solution = M[:, :n].lu_solve(-M[:, n:]).to_list()
    found = {}
    for k, sensor in enumerate(model.sensors):
        factor = s if sensor.quantity == "speed" else 1
        angle = zip(model.inputs, solution[column[sensor.angle]], strict=True)
        found[sensor.quantity, k] = {i.kind: int(c) * factor % PRIME for i, c in angle if c}
    return found
