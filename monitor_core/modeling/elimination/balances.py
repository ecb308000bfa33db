"""From the rows left by the substitution to explicit balances: one row for the highest derivative of each angle.

s^2 phi_j = sum of (c s phi_i), (c phi_i), (c u)      where an inertia moves with phi_j s   phi_l = ...
massless, between dampers
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from monitor_core.modeling.elimination.operators import (
    Coefficient,
    Operator,
    Row,
    add_multiple,
    degree,
    is_unit,
)
from monitor_core.modeling.elimination.substitution import ANGLE, Line, System, substitute_all
from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.laurent import Laurent

Sum = dict[tuple[str, int], Coefficient]
"""(angle, power of s) or (input, 0) -> coefficient."""


@dataclass
class Balances:
    """Explicit derivatives.  ``masses``: phi_j -> s^2 phi_j; ``massless``: phi_l -> s phi_l."""

    masses: dict[str, Sum]
    massless: dict[str, Sum]
    watched: dict[str, Sum]


def balances_of(system: System) -> Balances:
    """Substitute, then solve for the highest derivatives.

    Raises:
        ModelError: too few or too many equations, or no solution.
        NotLaurentError: rational coefficients are needed.
    """
    while True:
        substitute_all(system)
        _check_shape(system)
        masses = _solve_for(system, 2, system.unknowns(), ())
        massless = _solve_for(system, 1, [n for n in system.unknowns() if n not in masses], masses.values())
        left = [k for k in range(len(system.lines)) if k not in {*masses.values(), *massless.values()}]
        if not left:
            return _explicit(system, masses, massless)
        _check_progress(system, left)


def _solve_for(system: System, power: int, names: list[str], used: Collection[int]) -> dict[str, int]:
    """Row operations until each of the found names has s^power in one row only: name -> that row."""
    found: dict[str, int] = {}
    free = [k for k in range(len(system.lines)) if k not in used]
    for name in names:
        rows = [k for k in free if k not in found.values() and power in system.lines[k].row.get(name, {})]
        if not rows:
            continue
        pivot = min(
            rows, key=lambda k: (not is_unit(system.lines[k].row[name][power]), _weight(system, k, power))
        )
        found[name] = pivot
        _merge(system, system.lines[pivot].row[name], power)
        _clear_column(system, name, power, pivot)
    return found


def _merge(system: System, operator: Operator, power: int) -> None:
    """Rigidly joined inertias: their sum, if it occurs nowhere else, becomes one parameter: J1 + r^2 J2.

    If all of its parts occur elsewhere, too, it would depend on them: this is left to rational functions.
    """
    c = operator[power]
    if is_unit(c) or not isinstance(c, Laurent):
        return
    free = c.names - _occurring(system, operator)
    inertias = [name for name in system.drawn if name in free and name not in c.derivative(name).names]
    if not inertias:
        return
    factor = c.derivative(inertias[0])
    if not factor.is_unit:
        return
    total = c / factor
    name = total.sum_text()
    system.definitions[name] = total
    operator[power] = factor * Laurent.symbol(name)


def _occurring(system: System, but: Operator) -> set[str]:
    """The parameters that occur in any other operator."""
    rows = [line.row for line in system.lines] + list(system.watched.values())
    operators = (operator for row in rows for operator in row.values() if operator is not but)
    return {name for operator in operators for c in operator.values() for name in c.names}


def _weight(system: System, k: int, power: int) -> int:
    return sum(power in operator for operator in system.lines[k].row.values())


def _clear_column(system: System, name: str, power: int, pivot: int) -> None:
    solution = system.lines[pivot].row
    c = solution[name][power]
    others = [line.row for k, line in enumerate(system.lines) if k != pivot]
    for row in others + list(system.watched.values()):
        if power in row.get(name, {}):
            add_multiple(row, {0: -(row[name][power] / c)}, solution)


def _check_shape(system: System) -> None:
    names, equations = system.unknowns(), len(system.lines)
    for name in names:
        if system.orders[name] != ANGLE:
            raise ModelError(
                f"nothing determines {name}: an equation or a connection is missing", system.origins.get(name)
            )
    if equations < len(names):
        raise ModelError(
            f"nothing determines {names[-1]}: what it belongs to is not connected to the drive, or it is held "
            "rigidly on both sides, or an equation is missing",
            system.origins.get(names[-1]),
        )
    if equations > len(names):
        raise ModelError(
            f"{equations - len(names)} equations too many: they contradict each other",
            system.lines[-1].origin,
        )


def _check_progress(system: System, left: list[int]) -> None:
    """Check that rows without a derivative are solvable: substitution continues with those free of s now."""
    for k in left:
        line = system.lines[k]
        if all(degree(op) == 0 for op in line.row.values()):
            continue
        raise ModelError("its equations cannot be solved for the motion", line.origin)
    if any(not line.row for line in system.lines):
        raise ModelError(
            "its equations depend on each other: something is held twice", _first_empty(system).origin
        )
    for k in left:
        _check_answered(system, system.lines[k])


def _check_answered(system: System, line: Line) -> None:
    """A torque on a part held only by springs turns it at once: no substitution eliminates its angle."""
    if not system.inputs.isdisjoint(line.row):
        moving = {name for other in system.lines for name, op in other.row.items() if degree(op) > 0}
        jumping = min(line.row.keys() - system.inputs, key=lambda name: (name in moving, name))
        raise ModelError(
            f"a torque acts where only springs are, and {jumping} would jump with it: "
            "an inertia or a damper is missing there",
            line.origin,
        )


def _first_empty(system: System) -> Line:
    return next(line for line in system.lines if not line.row)


def _explicit(system: System, masses: dict[str, int], massless: dict[str, int]) -> Balances:
    speeds = {name: _solved(system, k, name, 1) for name, k in massless.items()}
    accelerations = {name: _solved(system, k, name, 2) for name, k in masses.items()}
    watched = {name: _flatten(row) for name, row in system.watched.items()}
    _check_explicit(system, accelerations, masses, speeds)
    return Balances(accelerations, speeds, watched)


def _solved(system: System, k: int, name: str, power: int) -> Sum:
    """The row solved for s^power of the name."""
    row = system.lines[k].row
    c = row[name][power]
    return {key: -(a / c) for key, a in _flatten(row).items() if key != (name, power)}


def _flatten(row: Row) -> Sum:
    return {(name, power): a for name, operator in row.items() for power, a in operator.items()}


def _check_explicit(
    system: System, accelerations: dict[str, Sum], masses: dict[str, int], speeds: dict[str, Sum]
) -> None:
    for name, total in [*accelerations.items(), *speeds.items()]:
        for other, power in total:
            highest = 1 if other in masses or other in system.inputs else 0
            if power > highest or (other in system.inputs and power):
                line = system.lines[masses[name]] if name in masses else Line({}, system.lines[0].origin)
                raise ModelError(f"the motion of {name} depends on a derivative of {other}", line.origin)
