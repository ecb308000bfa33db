"""State spaces for tests: entries as text, the library's three masses, chains of masses; drawings of random drives."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from hypothesis import strategies as st

from monitor_core.drive.structure import Output, Quantity
from monitor_core.kernel.tables import COULOMB, ONE, TORQUE
from monitor_core.modeling.drawing import Drawing, part
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.flat import FlatInput, FlatParameter, FlatSensor
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modular import Seed, krylov_basis, points_of, residues
from monitor_core.modeling.standard_drives import DRAWINGS
from monitor_core.modeling.statespace import Report, StateSpace, SymbolicDefinition
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
    tied = tuple(SymbolicDefinition(name, parse(text)) for name, text in (definitions or {}).items())
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


def free_chain(
    masses: int, dampers: Collection[int] = (), friction: Collection[int] = (), sensor: int = 0
) -> StateSpace:
    """Masses J0, J1 .. in a row; between i and i + 1 a spring k_i and, of some, a damper d_i; of some friction f_i.

    The torque acts on the first; the output is the speed of mass ``sensor``.
    """
    parts = [part("torque", "motor", "m0", kT="kT"), part("speed-sensor", "encoder", f"m{sensor}")]
    parts += [part("inertia", f"mass{i}", f"m{i}", J=f"J{i}") for i in range(masses)]
    parts += [part("viscous-friction", f"bearing{i}", f"m{i}", d=f"f{i}") for i in sorted(friction)]
    for i in range(masses - 1):
        kind, damping = ("spring-damper", {"d": f"d{i}"}) if i in dampers else ("spring", {})
        parts.append(part(kind, f"spring{i}", f"m{i}", f"m{i + 1}", c=f"k{i}", **damping))
    return eliminate(Drawing("chain", parts).flat())


def some_chain(masses: int, data: st.DataObject, least: int = 0) -> StateSpace:
    """Dampers and friction, at ``least`` so many of each, and the sensor anywhere."""
    some = st.frozensets(st.integers(0, masses - 1), min_size=least)
    return free_chain(masses, data.draw(some), data.draw(some), data.draw(st.integers(0, masses - 1)))


def minimality(ss: StateSpace, seed: Seed) -> tuple[int, int]:
    """Dimensions of the part that the inputs reach and of the part that the sensors see, for generic values."""
    ranks = []
    for point in points_of(ss, seed):
        A, B, C = residues(ss, point)
        ranks.append((len(krylov_basis(A, B, point.prime)), len(krylov_basis(A.T, C.T, point.prime))))
    return max(c for c, _ in ranks), max(o for _, o in ranks)


def drawn(parts: Iterable[Mapping[str, Any]], name: str = "random") -> Drawing:
    """The drawing of a random drive's parts; the node "ground" is fixed."""
    components = [
        part(p["type"], p["name"], *p["at"], **{k: v for k, v in p.items() if k not in ("type", "name", "at")})
        for p in parts
    ]
    if any("ground" in each.nodes for each in components):
        components.append(part("fixed", "ground", "ground"))
    return Drawing(name, components)
