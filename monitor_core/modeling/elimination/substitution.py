"""Converts flat equations to torque balances, by exact substitution of variables that a single equation determines.

With s = d/dt the flat equations are rows of polynomials in s.  A variable whose coefficient in a row is free of s and
can be divided by is solved for and substituted everywhere.  Such a step loses and adds no solution, also where inertias
are rigidly coupled: no list of variables to eliminate is needed, and nothing has to be differentiated by hand.

Every variable has an order, angle 0, speed 1, acceleration and torque 2, and a step must not raise it: a torque is
eliminated by the law of its spring (c phi + d s phi), never an angle by a torque.  The result is the balances M s^2 phi
+ D s phi + K phi = torques of as many angles as can move independently.
"""

import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.flat import FlatEquation, FlatModel, ModelError, Origin
from monitor_core.modeling.laurent import Laurent, NotLaurentError

# --- Equations as rows of operators: variable -> polynomial in s ------------------------------------------------------

Operator = dict[int, Laurent]
"""Power of s -> coefficient, none of them zero."""

Row = dict[str, Operator]
"""Variable or input -> operator, none of them empty: their sum is zero."""


def degree(operator: Operator) -> int:
    """The highest power of s."""
    return max(operator)


def add_multiple(row: Row, factor: Operator, other: Row) -> None:
    """Row += factor * other, in place; zero coefficients are removed."""
    for name, operator in other.items():
        target = row.setdefault(name, {})
        for i, a in factor.items():
            for j, b in operator.items():
                total = target[i + j] + a * b if i + j in target else a * b
                if total:
                    target[i + j] = total
                else:
                    target.pop(i + j, None)
        if not target:
            del row[name]


# --- The equations of a drive -----------------------------------------------------------------------------------------

ANGLE, SPEED, TORQUE_ORDER = 0, 1, 2
_ORDERS = {"rad": ANGLE, "rad/s": SPEED, "rad/s^2": TORQUE_ORDER, "N m": TORQUE_ORDER}


@dataclass
class Line:
    """An equation and the component that it belongs to.  ``kinematic``: it contains only angles, no torques."""

    row: Row
    origin: Origin
    kinematic: bool = False


class EquationSystem:
    """The remaining equations, and observed rows: name -> row that expresses a variable of interest.

    ``far``: number of equations between each variable and the motor torque.  ``stiff``: relative angles of springs,
    near the motor first.  ``flat_states``: number of variables that are differentiated in the flat equations.
    ``definitions``: parameters that were merged during the substitution.
    """

    def __init__(self, flat: FlatModel) -> None:
        rows = [_row(equation) for equation in flat.equations]
        moving = {v.name for v in flat.variables if v.unit.startswith("rad")}
        law = [any(name not in moving for name in row) for row in rows]
        self.inputs = frozenset(u.name for u in flat.inputs)
        self.drawn = tuple(p.name for p in flat.parameters)
        self.origins = {v.name: v.origin for v in flat.variables}
        self.orders = orders_of(flat, rows)
        self.far = distances(rows, [u.name for u in flat.inputs if u.kind == TORQUE])
        # Preference of variables to keep: angles of inertias, others, deflections; near the motor first; drawn first.
        self.keep = {v.name: (v.prefer - v.relative, -self.distance(v.name), -k) for k, v in enumerate(flat.variables)}
        relative = [v.name for v in flat.variables if v.relative]
        stiff = {name for row, is_law in zip(rows, law, strict=True) if is_law for name in row if 0 in row[name]}
        self.stiff = sorted((name for name in relative if name in stiff), key=self.distance)
        self.flat_states = len({name for row in rows for name, operator in row.items() if degree(operator) > 0})
        self.lines = [
            Line(row, equation.origin, kinematic=not is_law)
            for row, equation, is_law in zip(rows, flat.equations, law, strict=True)
        ]
        known = (*relative, *(s.angle for s in flat.sensors), *(u.angle for u in flat.inputs if u.angle))
        self.watched: dict[str, Row] = {name: {name: {0: Laurent.number(1)}} for name in known}
        self.definitions: dict[str, Laurent] = {}

    def distance(self, name: str) -> int:
        """Number of equations from the motor torque to a variable; variables that are not joined to it come last."""
        return self.far.get(name, len(self.far))

    def rows(self) -> list[Row]:
        """The remaining equations and the observed rows."""
        return [line.row for line in self.lines] + list(self.watched.values())

    def merge(self, total: Laurent) -> None:
        """Make a coefficient a single term, a merged parameter."""
        merge(total, self.rows(), self.drawn, self.definitions)

    def unknowns(self) -> list[str]:
        """The variables that still occur, in a fixed order."""
        names = {name for line in self.lines for name in line.row if name not in self.inputs}
        return sorted(names, key=lambda name: (self.keep[name], name), reverse=True)


def _row(equation: FlatEquation) -> Row:
    row: Row = {}
    for (name, power), c in equation.terms.items():
        if c:
            row.setdefault(name, {})[power] = c
    return row


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


def distances(rows: Iterable[Row], sources: Sequence[str]) -> dict[str, int]:
    """Number of equations between each variable and the sources; variables that are not reached are missing."""
    found, front, left = dict.fromkeys(sources, 0), set(sources), list(rows)
    for distance in range(1, len(left) + 1):
        near = [row for row in left if not front.isdisjoint(row)]
        left = [row for row in left if front.isdisjoint(row)]
        front = {name for row in near for name in row} - found.keys()
        found.update(dict.fromkeys(front, distance))
        if not front:
            break
    return found


# --- Substitution -----------------------------------------------------------------------------------------------------


def substitute_all(system: EquationSystem) -> None:
    """Substitute until no row determines a variable any more; shortest rows first."""
    _Substitution(system).run()
    system.lines = [line for line in system.lines if line.row]


class _Substitution:
    """Substitution in a system.  ``where``: rows in which each variable occurs; ``version``: changes of each row."""

    def __init__(self, system: EquationSystem) -> None:
        self.system = system
        self.rows = system.rows()
        self.alive = set(range(len(system.lines)))
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
            name = self._pivot(k)
            if name is not None:
                for changed in self._eliminate(k, name):
                    heapq.heappush(heap, (len(self.rows[changed]), changed, self.version[changed]))

    def _pivot(self, k: int) -> str | None:
        """The variable that row k is solved for.

        A sum before it becomes a parameter, unless another variable, no better a coordinate, has a single term.
        """
        row, keep = self.rows[k], self.system.keep
        candidates = _pivots(self.system, row)
        single = [name for name in candidates if row[name][0].is_unit]
        if single and keep[single[0]][0] <= keep[candidates[0]][0]:
            return single[0]
        if candidates:
            self.system.merge(row[candidates[0]][0])
        return candidates[0] if candidates else None

    def _eliminate(self, k: int, name: str) -> list[int]:
        """Substitute the solution of row k for the variable everywhere; returns the rows that have changed."""
        solution = self.rows[k]
        c = solution[name][0]
        self.alive.discard(k)
        affected = self.where.pop(name) - {k}
        for other in solution:
            self.where.get(other, set()).discard(k)
        for i in affected:
            row, before = self.rows[i], set(self.rows[i])
            add_multiple(row, {power: -(a / c) for power, a in row[name].items()}, solution)
            for gone in before - row.keys():
                self.where.get(gone, set()).discard(i)
            for new in row.keys() - before:
                self.where.setdefault(new, set()).add(i)
            self.version[i] += 1
        self.system.lines[k] = Line({}, Origin())
        return sorted(i for i in affected if i in self.alive)


def _pivots(system: EquationSystem, row: Row) -> list[str]:
    """The variables that the row may be solved for, best first: divided by numbers, far from the motor."""
    worth = {name: degree(op) + system.orders[name] for name, op in row.items()}
    highest = max(worth.values(), default=0)
    candidates = [
        name for name, op in row.items() if name not in system.inputs and set(op) == {0} and worth[name] == highest
    ]
    if highest == ANGLE:
        return sorted(candidates, key=lambda name: system.keep[name])
    return sorted(candidates, key=lambda name: (not row[name][0].is_number, system.keep[name]))


def _check(line: Line, system: EquationSystem) -> None:
    unknown = [name for name in line.row if name not in system.inputs]
    if line.row and not unknown:
        raise ModelError("its equations contradict each other: a torque acts where nothing can balance it", line.origin)
    if len(line.row) == 1 and line.kinematic:
        (operator,) = line.row.values()
        if set(operator) == {0} and not operator[0].is_unit:
            raise ModelError(
                f"the drive is locked: its equations allow no motion of {unknown[0]} "
                "(two rigid connections of different ratio in parallel?)",
                line.origin,
            )


# --- Merged parameters ------------------------------------------------------------------------------------------------


# Two rigidly joined inertias act only as q = J1 + r^2 J2, two springs in series divide by q = k1 + k2.  Where a part of
# q occurs elsewhere, too, it is replaced there by its solution: k1 = q - k2.  So q and the parameters that are left are
# independent of each other, everything stays a Laurent sum, and a sum that is zero is seen to be zero.


def merge(total: Laurent, rows: Sequence[Row], drawn: Sequence[str], definitions: dict[str, Laurent]) -> None:
    """Make ``total`` a single term wherever it occurs in the rows, and add the definition of the new parameter.

    Args:
        total: a coefficient in the rows.
        rows: equations, changed in place.
        drawn: the user's parameters, those to be merged first.
        definitions: merged parameters so far, in the order of their evaluation.

    Raises:
        NotLaurentError: none of its parts can be replaced.
    """
    for part in _parts(total, rows, drawn):
        slope = total.derivative(part)
        merged = total / slope
        name = merged.sum_text()
        solution = {part: Laurent.symbol(name) - (merged - Laurent.symbol(part))}
        try:
            changed = [(operator, s, c.substitute(solution)) for operator, s, c in _containing(part, rows)]
        except NotLaurentError:
            continue  # an expression is divided by this part
        for operator, s, c in changed:
            operator[s] = c
        definitions[name] = merged
        return
    raise NotLaurentError(str(total))


def _parts(total: Laurent, rows: Sequence[Row], drawn: Sequence[str]) -> list[str]:
    """Parameters for which the sum can be solved; those that occur least elsewhere come first."""
    linear = [
        name
        for name in (*drawn, *sorted(total.names - set(drawn)))
        if name in total.names and total.derivative(name).is_unit and name not in total.derivative(name).names
    ]
    return sorted(linear, key=lambda name: sum(c != total for _, _, c in _containing(name, rows)))


def _containing(name: str, rows: Iterable[Row]) -> Iterator[tuple[Operator, int, Laurent]]:
    """The coefficients that a parameter occurs in, each with its operator and power of s."""
    for row in rows:
        for operator in row.values():
            for s, c in operator.items():
                if name in c.names:
                    yield operator, s, c


def needed(definitions: Mapping[str, Laurent], entries: Iterable[Laurent]) -> dict[str, Laurent]:
    """The definitions that the entries need, directly or indirectly, in order."""
    wanted = {n for entry in entries for n in entry.names}
    for name in reversed(list(definitions)):
        if name in wanted:
            wanted |= definitions[name].names
    return {name: value for name, value in definitions.items() if name in wanted}
