"""Converts the rows after the substitution to explicit balances: one for the highest derivative of each angle.

s^2 phi_j = sum of (c s phi_i), (c phi_i), (c u)      where an inertia moves with phi_j
s   phi_l = the same                                  where nothing does: massless, between dampers
"""

from collections.abc import Collection
from dataclasses import dataclass

from monitor_core.modeling.elimination.substitution import (
    ANGLE,
    EquationSystem,
    Line,
    Row,
    add_multiple,
    degree,
    substitute_all,
)
from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.laurent import Laurent

BalanceSum = dict[tuple[str, int], Laurent]
"""(angle, power of s) or (input, 0) -> coefficient."""


@dataclass
class Balances:
    """Explicit derivatives.  ``masses``: phi_j -> s^2 phi_j; ``massless``: phi_l -> s phi_l."""

    masses: dict[str, BalanceSum]
    massless: dict[str, BalanceSum]
    watched: dict[str, BalanceSum]


def balances_of(system: EquationSystem) -> Balances:
    """Substitute, then solve for the highest derivatives."""
    while True:
        substitute_all(system)
        _check_shape(system)
        masses = _solve_for(system, 2, system.unknowns(), ())
        massless = _solve_for(system, 1, [n for n in system.unknowns() if n not in masses], masses.values())
        used = {*masses.values(), *massless.values()}
        left = [line for k, line in enumerate(system.lines) if k not in used]
        if not left:
            return _explicit(system, masses, massless)
        _check_progress(system, left)


def _solve_for(system: EquationSystem, power: int, names: list[str], used: Collection[int]) -> dict[str, int]:
    """Row operations until each of the found names has s^power in one row only: name -> that row."""
    found: dict[str, int] = {}
    free = [k for k in range(len(system.lines)) if k not in used]
    for name in names:
        rows = {k: system.lines[k].row for k in free if k not in found.values()}
        rows = {k: row for k, row in rows.items() if power in row.get(name, {})}
        if not rows:
            continue
        pivot = min(
            rows,
            key=lambda k: (not rows[k][name][power].is_unit, sum(power in op for op in rows[k].values())),
        )
        found[name] = pivot
        if not rows[pivot][name][power].is_unit:
            system.merge(rows[pivot][name][power])
        solution = rows[pivot]
        for row in system.rows():
            if row is not solution and power in row.get(name, {}):
                add_multiple(row, {0: -(row[name][power] / solution[name][power])}, solution)
    return found


def _check_shape(system: EquationSystem) -> None:
    names, equations = system.unknowns(), len(system.lines)
    for name in names:
        if system.orders[name] != ANGLE:
            raise ModelError(
                f"nothing determines {name}: an equation or a connection is missing", system.origins.get(name)
            )
    if equations < len(names):
        raise ModelError(
            f"nothing determines {names[-1]}: its component is not connected to the drive, or is held rigidly on "
            "both sides, or an equation is missing",
            system.origins.get(names[-1]),
        )
    if equations > len(names):
        raise ModelError(
            f"{equations - len(names)} equations too many: they contradict each other",
            system.lines[-1].origin,
        )


def _check_progress(system: EquationSystem, left: list[Line]) -> None:
    """Check that rows without a derivative are solvable: substitution continues with those free of s now."""
    for line in left:
        if any(degree(operator) for operator in line.row.values()):
            raise ModelError("its equations cannot be solved for the motion", line.origin)
    for line in system.lines:
        if not line.row:
            raise ModelError("its equations are linearly dependent: a part is held twice", line.origin)
    moving = {name for line in system.lines for name, operator in line.row.items() if degree(operator) > 0}
    for line in left:  # a torque on a part held only by springs turns it at once: no row eliminates its angle
        if not system.inputs.isdisjoint(line.row):
            jumping = min(line.row.keys() - system.inputs, key=lambda name: (name in moving, name))
            raise ModelError(
                f"a torque acts where only springs are, and {jumping} would jump with it: "
                "an inertia or a damper is missing there",
                line.origin,
            )


def _explicit(system: EquationSystem, masses: dict[str, int], massless: dict[str, int]) -> Balances:
    accelerations = {name: _solved(system.lines[k].row, name, 2) for name, k in masses.items()}
    speeds = {name: _solved(system.lines[k].row, name, 1) for name, k in massless.items()}
    for name, total in [*accelerations.items(), *speeds.items()]:
        for other, power in total:
            if power > (other in masses):
                origin = system.lines[masses.get(name, 0)].origin
                raise ModelError(f"the motion of {name} depends on a derivative of {other}", origin)
    return Balances(accelerations, speeds, {name: _flatten(row) for name, row in system.watched.items()})


def _solved(row: Row, name: str, power: int) -> BalanceSum:
    """The row solved for s^power of the name."""
    c = row[name][power]
    return {key: -(a / c) for key, a in _flatten(row).items() if key != (name, power)}


def _flatten(row: Row) -> BalanceSum:
    return {(name, power): a for name, operator in row.items() for power, a in operator.items()}
