"""The state space from explicit balances: x = (deflections, speeds, angles that a sensor measures absolutely).

Springs depend on differences of angles only.  The deflections in the balances are expressed by as few independent ones
as span them, which replace the absolute angles, as nothing else depends on these (paper, section 2).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeVar

from monitor_core.drive.structure import Quantity
from monitor_core.modeling.elimination.balances import Balances, BalanceSum
from monitor_core.modeling.elimination.substitution import EquationSystem
from monitor_core.modeling.flat import FlatModel, FlatSensor, ModelError
from monitor_core.modeling.laurent import Laurent, NotLaurentError

K = TypeVar("K")

Angles = dict[str, Laurent]
"""A combination of angles: name -> coefficient."""

Dense = dict[tuple[int, int], Laurent]
"""A matrix by its entries that are not zero."""


class Reduction:
    """A drive after the substitution, with its states, and the matrices of these.

    ``order``: the moving angles and their rank by distance from the motor.  ``positions``: deflections first,
    ``relative`` of them, then the angles that sensors measure and deflections do not determine.  ``columns``: the state
    of each speed, by the angle of its inertia.
    """

    def __init__(
        self, flat: FlatModel, sensors: tuple[FlatSensor, ...], system: EquationSystem, balances: Balances
    ) -> None:
        self.flat, self.sensors, self.balances = flat, sensors, balances
        self.inputs = tuple(sorted(flat.inputs, key=lambda u: u.kind))
        declared = {v.name: k for k, v in enumerate(flat.variables)}
        angles = [*balances.masses, *balances.massless]
        ranked = sorted(angles, key=lambda name: (system.distance(name), declared[name]))
        self.order = {name: k for k, name in enumerate(ranked)}
        self.positions = self._deflections(system.stiff)
        self.relative = len(self.positions.rows)
        for sensor in sensors:
            if sensor.quantity == "angle":
                self.positions.extend(self.angle_of(sensor.angle))
        masses = [name for name in self.order if name in balances.masses]
        self.columns = {name: self.relative + k for k, name in enumerate(masses)}

    def _deflections(self, drawn: Iterable[str]) -> Basis:
        """Basis of the deflections that the balances depend on: drawn ones first, with the motor side positive."""
        basis = Basis(self.order)
        for candidate in map(self.angle_of, drawn):
            if candidate:
                basis.extend(_towards_motor(candidate, self.order))
        for total in [*self.balances.masses.values(), *self.balances.massless.values()]:
            _, rest = basis.express(_angles_of(total, self.order))
            if rest:
                basis.extend(_over_nearest(rest, self.order))
        return basis

    def position_state(self, k: int) -> int:
        """State of position k: deflections come before the speeds, absolute angles after."""
        return k if k < self.relative else k + len(self.columns)

    def angle_of(self, variable: str) -> Angles:
        """An angle as a combination of the remaining ones."""
        return _angles_of(self.balances.watched[variable], self.order)

    def A_B(self) -> tuple[Dense, Dense]:
        """The state equations."""
        A, B = Dense(), Dense()
        for k, row in enumerate(self.positions.rows):
            self._put(A, B, self.position_state(k), self._speed(row))
        for name, column in self.columns.items():
            self._put(A, B, column, self.balances.masses[name])
        return A, B

    def C(self) -> Dense:
        """The output equations."""
        C, D = Dense(), Dense()
        for k, sensor in enumerate(self.sensors):
            angle = self.angle_of(sensor.angle)
            absolute: BalanceSum = {(name, 0): c for name, c in angle.items()}
            self._put(C, D, k, absolute if sensor.quantity == "angle" else self._speed(angle))
        if D:
            raise ModelError(
                "what it measures responds to the torque without delay: an inertia is missing there",
                self.sensors[0].origin,
            )
        return C

    def _speed(self, angle: Angles) -> BalanceSum:
        """The derivative of a combination of angles."""
        total: BalanceSum = {}
        for name, c in angle.items():
            massless = self.balances.massless.get(name)
            total = _plus(total, {(name, 1): Laurent.number(1)} if massless is None else massless, c)
        return total

    def _put(self, A: Dense, B: Dense, row: int, total: BalanceSum) -> None:
        """Write a derivative, a sum over speeds, angles and inputs, into a row of A and B."""
        coordinates, rest = self.positions.express(_angles_of(total, self.order))
        assert not rest  # the balances depend only on combinations of the deflections
        for k, c in coordinates.items():
            A[row, self.position_state(k)] = c
        for name, column in self.columns.items():
            if (name, 1) in total:
                A[row, column] = total[name, 1]
        for k, u in enumerate(self.inputs):
            if (u.name, 0) in total:
                B[row, k] = total[u.name, 0]

    def quantities(self) -> tuple[Quantity, ...]:
        """Names and units of the states."""
        variables = {v.name for v in self.flat.variables}
        positions = [Quantity(_combination(row), "rad") for row in self.positions.rows]
        speeds = [Quantity(_speed_name(name, variables), "rad/s") for name in self.columns]
        return (*positions[: self.relative], *speeds, *positions[self.relative :])


def _combination(row: Angles) -> str:
    """``r*motor.phi - gearbox.phi``."""
    terms = []
    for name, c in row.items():
        factor = str(c)
        bracketed = f"({factor})" if " " in factor else factor
        terms.append({"1": name, "-1": f"-{name}"}.get(factor, f"{bracketed}*{name}"))
    return " + ".join(terms).replace("+ -", "- ")


def _speed_name(angle: str, variables: set[str]) -> str:
    speed = angle.removesuffix(".phi") + ".w"
    return speed if angle.endswith(".phi") and speed in variables else f"der({angle})"


# --- Combinations of angles -------------------------------------------------------------------------------------------


class Basis:
    """Independent combinations of angles in echelon form, by which others are expressed.

    ``order``: the rank of each angle by its distance from the motor.
    """

    def __init__(self, order: Mapping[str, int]) -> None:
        self.rows: list[Angles] = []
        self._order = order
        self._echelon: list[tuple[str, Angles, dict[int, Laurent]]] = []

    def express(self, row: Angles) -> tuple[dict[int, Laurent], Angles]:
        """Coordinates in the basis, and the part that is not in its span."""
        rest, coordinates = dict(row), dict[int, Laurent]()
        for pivot, reduced, combination in self._echelon:
            if pivot in rest:
                factor = rest[pivot] / reduced[pivot]
                rest = _plus(rest, reduced, -factor)
                coordinates = _plus(coordinates, combination, factor)
        return coordinates, rest

    def extend(self, row: Angles) -> None:
        """Add the part of the row that is independent of the basis, if there is any."""
        coordinates, rest = self.express(row)
        if not rest:
            return
        if not any(c.is_unit for c in rest.values()):
            # A loop through different gears: an absolute angle shows in a deflection, times (1 - ratio).  The angle
            # itself is the better state.
            row = rest = _over_nearest(rest, self._order)
            coordinates = {}
        combination = _plus({len(self.rows): Laurent.number(1)}, coordinates, Laurent.number(-1))
        pivot = min(rest, key=lambda name: (not rest[name].is_unit, -self._order[name]))
        self._echelon.append((pivot, rest, combination))
        self.rows.append(row)


def _plus(left: Mapping[K, Laurent], right: Mapping[K, Laurent], factor: Laurent) -> dict[K, Laurent]:
    """Left + factor * right of sparse sums."""
    out = dict(left)
    for key, c in right.items():
        total = out[key] + factor * c if key in out else factor * c
        if total:
            out[key] = total
        else:
            out.pop(key, None)
    return out


def _angles_of(total: BalanceSum, names: Iterable[str]) -> Angles:
    """The part of a sum that depends on angles themselves."""
    return {name: total[name, 0] for name in names if (name, 0) in total}


def _over_nearest(row: Angles, order: Mapping[str, int]) -> Angles:
    """The row divided by the coefficient of the angle nearest to the motor, where that is possible."""
    nearest = row[min(row, key=lambda name: order[name])]
    try:
        return {name: c / nearest for name, c in row.items()}
    except NotLaurentError:
        return row


def _towards_motor(row: Angles, order: Mapping[str, int]) -> Angles:
    """The row, or its negative, so that the angle nearest to the motor counts positive.

    Where the coefficients are sums (of stiffnesses: a massless node was eliminated), the row is divided by that of the
    nearest angle.
    """
    if not all(c.is_unit for c in row.values()):
        return _over_nearest(row, order)
    nearest = row[min(row, key=lambda name: order[name])]
    return {name: -c for name, c in row.items()} if next(iter(nearest.terms.values())) < 0 else row
