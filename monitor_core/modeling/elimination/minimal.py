"""The state space from explicit balances: x = (deflections, speeds, angles that a sensor measures absolutely)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from monitor_core.drive.structure import Quantity
from monitor_core.modeling.elimination.balances import Balances, Sum
from monitor_core.modeling.elimination.operators import Coefficient
from monitor_core.modeling.elimination.rational import Field
from monitor_core.modeling.elimination.states import Angles, Basis, add, angles_of, deflections
from monitor_core.modeling.flat import FlatInput, FlatModel, FlatSensor, ModelError
from monitor_core.modeling.laurent import Laurent

Dense = dict[tuple[int, int], Coefficient]


@dataclass(frozen=True, slots=True)
class Counts:
    """Counts before and after the elimination."""

    equations: int
    variables: int
    states: int
    left: int


@dataclass
class Reduction:
    """The result of the substitution, and the matrices computed from it.

    ``stiff``: the relative angles of springs.  ``far``: distance of each variable from the motor. ``definitions``:
    inertias that were merged.
    """

    flat: FlatModel
    sensors: tuple[FlatSensor, ...]
    balances: Balances
    stiff: tuple[str, ...]
    far: Mapping[str, int]
    field: Field | None
    counts: Counts
    definitions: Mapping[str, Laurent]

    @cached_property
    def unit(self) -> Coefficient:
        """1, in the ring of the coefficients."""
        return Laurent.number(1) if self.field is None else self.field.element(Laurent.number(1))

    @cached_property
    def order(self) -> dict[str, int]:
        """The moving angles, and their rank by distance from the motor."""
        declared = {v.name: k for k, v in enumerate(self.flat.variables)}
        angles = [*self.balances.masses, *self.balances.massless]
        ranked = sorted(angles, key=lambda name: (self.far.get(name, len(self.far)), declared[name]))
        return {name: k for k, name in enumerate(ranked)}

    @cached_property
    def masses(self) -> list[str]:
        """The angles of inertias; their speeds are states."""
        return [name for name in self.order if name in self.balances.masses]

    @cached_property
    def inputs(self) -> tuple[FlatInput, ...]:
        """Inputs by kind."""
        return tuple(sorted(self.flat.inputs, key=lambda u: u.kind))

    @cached_property
    def positions(self) -> Basis:
        """Deflections first, then the angles that sensors measure and deflections do not determine."""
        drawn = sorted(self.stiff, key=lambda name: self.far.get(name, len(self.far)))
        candidates = [angles_of(self.balances.watched[name], self.order) for name in drawn]
        basis = deflections(self.balances, [c for c in candidates if c], self.order)
        self._relative = len(basis.rows)
        for sensor in self.sensors:
            if sensor.quantity == "angle":
                basis.extend(self.angle_of(sensor.angle), self.order)
        return basis

    @cached_property
    def relative(self) -> int:
        """Number of deflections among the positions."""
        _ = self.positions
        return self._relative

    @cached_property
    def columns(self) -> dict[str, int]:
        """State of each speed."""
        return {name: self.relative + k for k, name in enumerate(self.masses)}

    def position_state(self, k: int) -> int:
        """State of position k: deflections come before the speeds, absolute angles after."""
        return k if k < self.relative else k + len(self.masses)

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.positions.rows) + len(self.masses)

    def angle_of(self, variable: str) -> Angles:
        """An angle as a combination of the remaining ones."""
        return angles_of(self.balances.watched[variable], self.order)

    def A_B(self) -> tuple[Dense, Dense]:
        """The state equations."""
        A, B = Dense(), Dense()
        for k, row in enumerate(self.positions.rows):
            self._put(A, B, self.position_state(k), self._speed(row))
        for name in self.masses:
            self._put(A, B, self.columns[name], self.balances.masses[name])
        return A, B

    def C(self) -> Dense:
        """The output equations."""
        C, D = Dense(), Dense()
        for k, sensor in enumerate(self.sensors):
            angle = self.angle_of(sensor.angle)
            absolute: Sum = {(name, 0): c for name, c in angle.items()}
            self._put(C, D, k, absolute if sensor.quantity == "angle" else self._speed(angle))
        if D:
            raise ModelError(
                "what it measures follows the torque at once: an inertia is missing there",
                self.sensors[0].origin,
            )
        return C

    def _speed(self, angle: Angles) -> Sum:
        """The derivative of a combination of angles."""
        total: Sum = {}
        for name, c in angle.items():
            massless = self.balances.massless.get(name)
            total = add(total, {(name, 1): self.unit} if massless is None else massless, c)
        return total

    def _put(self, A: Dense, B: Dense, row: int, total: Sum) -> None:
        """Write a derivative, a sum over speeds, angles and inputs, into a row of A and B."""
        coordinates, rest = self.positions.express(angles_of(total, self.order))
        assert not rest  # the deflections span what the balances depend on
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
        rows = [_combination(row) for row in self.positions.rows]
        speeds = [_speed_name(name, variables) for name in self.masses]
        return (
            *(Quantity(name, "rad") for name in rows[: self.relative]),
            *(Quantity(name, "rad/s") for name in speeds),
            *(Quantity(name, "rad") for name in rows[self.relative :]),
        )


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
