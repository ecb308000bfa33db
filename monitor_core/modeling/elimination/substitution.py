"""From flat equations to torque balances: exact substitution of every variable that one equation determines.

With s = d/dt the flat equations are rows of polynomials in s.  A variable whose coefficient in a row is free of s and
can be divided by is solved for and substituted everywhere.  Such a step loses and adds no solution, also where inertias
are rigidly coupled: no list of variables to eliminate is needed, and nothing has to be differentiated by hand.

Every variable has an order, angle 0, speed 1, acceleration and torque 2, and a step must not raise it: a torque is
eliminated by the law of its spring (c phi + d s phi), never an angle by a torque.  The result is the balances M s^2 phi
+ D s phi + K phi = torques of as many angles as can move independently.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from monitor_core.modeling.elimination.operators import Row, degree, is_number, is_unit, substitute
from monitor_core.modeling.flat import FlatModel, ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError

ANGLE, SPEED, TORQUE_ORDER = 0, 1, 2
_ORDERS = {"rad": ANGLE, "rad/s": SPEED, "rad/s^2": TORQUE_ORDER, "N m": TORQUE_ORDER}


@dataclass
class Line:
    """An equation and the component that it belongs to.  ``kinematic``: it is about angles only, not torques."""

    row: Row
    origin: Origin
    kinematic: bool = False


@dataclass
class System:
    """The equations that are left, and rows that only watch: name -> row expressing a variable of interest.

    ``drawn``: the user's parameters in their order; ``definitions``: those merged on the way, as sums of them.
    ``origins``: of the variables.
    """

    lines: list[Line]
    watched: dict[str, Row]
    orders: Mapping[str, int]
    inputs: frozenset[str]
    keep: Mapping[str, tuple[int, ...]]
    drawn: tuple[str, ...]
    definitions: dict[str, Laurent] = field(default_factory=dict)
    origins: Mapping[str, Origin] = field(default_factory=dict)

    def unknowns(self) -> list[str]:
        """The variables that still occur, in a settled order."""
        names = {name for line in self.lines for name in line.row if name not in self.inputs}
        return sorted(names, key=lambda name: (self.keep[name], name), reverse=True)


def orders_of(flat: FlatModel, rows: Sequence[Row]) -> dict[str, int]:
    """The order of each variable: by its unit, else by the equations that it occurs in."""
    orders = {v.name: _ORDERS[v.unit] for v in flat.variables if v.unit in _ORDERS}
    orders.update((u.name, TORQUE_ORDER) for u in flat.inputs)
    names = [v.name for v in flat.variables if v.name not in orders]
    changed = True
    while names and changed:
        changed = False
        for row in rows:
            unknown = [name for name in row if name not in orders]
            if len(unknown) == 1 and len(row) > 1:
                (name,) = unknown
                others = [degree(op) + orders[n] for n, op in row.items() if n != name]
                orders[name] = max(0, max(others) - degree(row[name]))
                changed = True
    return {**dict.fromkeys(names, TORQUE_ORDER), **orders}


def distances(rows: Sequence[Row], sources: Sequence[str]) -> dict[str, int]:
    """How many equations lie between each variable and the sources; what is not reached is missing."""
    where: dict[str, list[int]] = {}
    for k, row in enumerate(rows):
        for name in row:
            where.setdefault(name, []).append(k)
    found, front, used = dict.fromkeys(sources, 0), list(sources), set[int]()
    while front:
        following: list[str] = []
        for name in front:
            for k in where.get(name, ()):
                if k in used:
                    continue
                used.add(k)
                for other in rows[k]:
                    if other not in found:
                        found[other] = found[name] + 1
                        following.append(other)
        front = following
    return found


def substitute_all(system: System) -> None:
    """Eliminate until no row gives a variable any more; shortest rows first.

    Raises:
        ModelError: equations contradict each other, or something is locked.
        NotLaurentError: a sum of terms would have to be divided by; possible with rational coefficients only.
    """
    worker = _Substitution(system)
    worker.run()
    system.lines = [line for line in system.lines if line.row]
    _check_none_left(system, worker.pivots)


class _Substitution:
    def __init__(self, system: System) -> None:
        self.system = system
        self.rows: list[Row] = [line.row for line in system.lines] + list(system.watched.values())
        self.equations = len(system.lines)
        self.alive = set(range(self.equations))
        self.version = [0] * len(self.rows)
        self.where: dict[str, set[int]] = {}
        for k, row in enumerate(self.rows):
            for name in row:
                self.where.setdefault(name, set()).add(k)

    def run(self) -> None:
        heap = [(len(self.rows[k]), k, 0) for k in self.alive]
        heapq.heapify(heap)
        while heap:
            _, k, version = heapq.heappop(heap)
            if k not in self.alive or version != self.version[k]:
                continue
            _check(self.system.lines[k], self.system)
            found = self.pivots(self.rows[k], is_unit)
            if not found:
                continue
            for changed in self._eliminate(k, found[0]):
                heapq.heappush(heap, (len(self.rows[changed]), changed, self.version[changed]))

    def pivots(self, row: Row, usable: Callable[[object], bool]) -> list[str]:
        """The variables that the row may be solved for, best first: divided by numbers, far from the motor."""
        s = self.system
        worth = {name: degree(op) + s.orders[name] for name, op in row.items()}
        highest = max(worth.values(), default=0)
        candidates = [
            name
            for name, op in row.items()
            if name not in s.inputs and set(op) == {0} and usable(op[0]) and worth[name] == highest
        ]
        if highest == ANGLE:
            return sorted(candidates, key=lambda name: s.keep[name])
        return sorted(candidates, key=lambda name: (not is_number(row[name][0]), s.keep[name]))

    def _eliminate(self, k: int, name: str) -> list[int]:
        """Substitute the solution of row k for the variable everywhere; the rows that have changed."""
        solution = self.rows[k]
        self.alive.discard(k)
        affected = self.where.pop(name) - {k}
        for other in solution:
            self.where.get(other, set()).discard(k)
        for i in affected:
            before = set(self.rows[i])
            substitute(self.rows[i], name, solution)
            for gone in before - set(self.rows[i]):
                self.where.get(gone, set()).discard(i)
            for new in set(self.rows[i]) - before:
                self.where.setdefault(new, set()).add(i)
            self.version[i] += 1
        self.system.lines[k] = Line({}, Origin())
        return sorted(i for i in affected if i in self.alive)


def _check(line: Line, system: System) -> None:
    unknown = [name for name in line.row if name not in system.inputs]
    if line.row and not unknown:
        raise ModelError(
            "its equations contradict each other: a torque acts, and nothing can answer it", line.origin
        )
    if len(line.row) == 1 and line.kinematic:
        (operator,) = line.row.values()
        if set(operator) == {0} and not _is_single_term(operator[0]):
            raise ModelError(
                f"the drive is locked: its equations let {unknown[0]} stand still only "
                "(two rigid connections of different ratio in parallel?)",
                line.origin,
            )


def _is_single_term(c: object) -> bool:
    """A single term: setting it to zero says something about its variable, not about the parameters."""
    numerator = getattr(c, "numer", None)
    return is_unit(c) if numerator is None else len(numerator.terms()) == 1


def _check_none_left(system: System, pivots: Callable[[Row, Callable[[object], bool]], list[str]]) -> None:
    for line in system.lines:
        if pivots(line.row, bool):
            raise NotLaurentError(str(line.origin))
