"""State spaces made by hand: the library's three masses from their terms, and chains written from Newton's law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from monitor_core.drive.structure import Output, Quantity
from monitor_core.kernel.tables import COULOMB, ONE, TORQUE
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.flat import FlatInput, FlatParameter, FlatSensor
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.standard_drives import DRAWINGS
from monitor_core.modeling.statespace import Definition, Report, StateSpace
from tests.core.modeling.expressions import parse

UNITS = {"kT": "1", "M": "kg m^2", "J": "kg m^2", "k": "N m/rad", "d": "N m s/rad", "f": "N m s/rad"}
INPUTS = {
    TORQUE: FlatInput("tau", TORQUE),
    COULOMB: FlatInput("direction", COULOMB),
    ONE: FlatInput("1", ONE),
}

Table = Mapping[tuple[int, int], str]


def space(
    A: Mapping[tuple[int, int], Laurent],
    B: Mapping[tuple[int, int], Laurent],
    C: Mapping[tuple[int, int], Laurent],
    *,
    inputs: Sequence[int] = (TORQUE,),
    definitions: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> StateSpace:
    """A state space with the least around it."""
    n = 1 + max([r for r, _ in (*A, *B)] + [c for _, c in (*A, *C)])
    tied = tuple(Definition(name, parse(text)) for name, text in (definitions or {}).items())
    present = sorted(set[str]().union(*(e.names for M in (A, B, C) for e in M.values())))
    drawn = set(present).union(*(d.value.names for d in tied)) - {d.name for d in tied}
    known = units or {}

    def parameter(name: str) -> FlatParameter:
        return FlatParameter(name, known.get(name, UNITS.get(name, UNITS.get(name[0], "1"))))

    return StateSpace(
        name="by hand",
        states=tuple(Quantity(f"x{i}", "1") for i in range(n)),
        inputs=tuple(INPUTS[kind] for kind in inputs),
        sensors=tuple(FlatSensor(f"y{i}", "phi", "speed") for i in range(1 + max(r for r, _ in C))),
        A=A,
        B=B,
        C=C,
        rest={},
        ratio={},
        speed_states=(-1,) * (1 + max(r for r, _ in C)),
        parameters=tuple(parameter(name) for name in present),
        drawn=tuple(parameter(name) for name in sorted(drawn)),
        definitions=tied,
        report=Report(0, 0, 0),
        notes=(),
    )


def table(
    A: Table,
    B: Table,
    C: Table,
    inputs: Sequence[int] = (TORQUE,),
    definitions: Mapping[str, str] | None = None,
) -> StateSpace:
    """The same with its entries as text."""
    A_, B_, C_ = ({place: parse(text) for place, text in M.items()} for M in (A, B, C))
    return space(A_, B_, C_, inputs=inputs, definitions=definitions)


def library_three_mass(output: Output = "speed", inputs: Sequence[int] = (TORQUE,)) -> StateSpace:
    """The library's drive with some of its inputs."""
    ss = eliminate(DRAWINGS["three-mass"].flat(), output)
    columns = {k: inputs.index(u.kind) for k, u in enumerate(ss.inputs) if u.kind in inputs}
    B = {(i, columns[k]): entry for (i, k), entry in ss.B.items() if k in columns}
    return space(ss.A, B, ss.C, inputs=inputs, units={p.name: p.unit for p in ss.parameters})


@dataclass(frozen=True)
class Chain:
    """Masses J0, J1 ... in a row, spring k_i and damper d_i between i and i + 1; friction f_i from i to ground."""

    masses: int
    dampers: frozenset[int] = frozenset()
    friction: frozenset[int] = frozenset()
    sensor: int = 0
    torque_constant: bool = True

    def state_space(self) -> StateSpace:
        """States: the deflections, then the speeds; output: the speed of mass ``sensor``."""
        N, w = self.masses, self.masses - 1
        A: dict[tuple[int, int], Laurent] = {}
        s = Laurent.symbol
        for i in range(w):
            A[i, w + i], A[i, w + i + 1] = Laurent.number(1), Laurent.number(-1)
        for i in range(N):
            ends = [(j, sign) for j, sign in ((i, -1), (i - 1, 1)) if 0 <= j < w]
            for j, sign in ends:
                A[w + i, j] = Laurent.number(sign) * s(f"k{j}") / s(f"J{i}")
            if any(j in self.dampers for j, _ in ends) or i in self.friction:
                A[w + i, w + i] = -(self._damping(i, ends)) / s(f"J{i}")
            for j, sign in ends:
                if j in self.dampers:
                    A[w + i, w + (j + 1 if sign < 0 else j)] = s(f"d{j}") / s(f"J{i}")
        torque = s("kT") if self.torque_constant else Laurent.number(1)
        return space(A, {(w, 0): torque / s("J0")}, {(0, w + self.sensor): Laurent.number(1)})

    def _damping(self, i: int, ends: list[tuple[int, int]]) -> Laurent:
        names = [f"d{j}" for j, _ in ends if j in self.dampers] + ([f"f{i}"] if i in self.friction else [])
        return sum((Laurent.symbol(name) for name in names), Laurent())
