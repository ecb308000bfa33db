"""Drives for reports, made by hand: the three-mass one, and pictures of others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from monitor_core.drive.structure import Matrix, Output, Quantity
from monitor_core.kernel.tables import COULOMB, ONE, TORQUE
from monitor_core.modeling.flat import FlatComponent, FlatInput, FlatParameter, FlatSensor
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.modeling.statespace import Definition, Entries, Report, StateSpace

Row = tuple[str, str, str, dict[str, str]]
"""Kind, name, nodes with blanks between, parameters."""

CHAIN: list[Row] = [
    ("torque", "torque", "shaft", {"kT": "kT"}),
    ("inertia", "motor", "shaft", {"J": "Jm"}),
    ("viscous-friction", "bearing", "shaft", {"d": "fm"}),
    ("speed-sensor", "encoder", "shaft", {}),
    ("coulomb-friction", "dry", "shaft", {"fc": "fc"}),
    ("torque-offset", "offset", "shaft", {"tau0": "tau0"}),
    ("ideal-gear", "gear", "shaft slow", {"ratio": "1/r"}),
    ("spring-damper", "gearbox", "slow wheel", {"c": "kg", "d": "dg"}),
    ("inertia", "wheel", "wheel", {"J": "Jg"}),
    ("spring-damper", "link", "wheel tip", {"c": "ka", "d": "da"}),
    ("inertia", "arm", "tip", {"J": "Ja"}),
]

STATES = ("r phi_m - phi_g", "phi_g - phi_a", "phi_m'", "phi_g'", "phi_a'", "phi_m")
"""As the paper calls them."""


def space(output: Output = "speed", name: str = "three-mass") -> StateSpace:
    """The three-mass drive of the paper, from the engine's own terms."""
    drive = three_mass(output)
    kinds = {TORQUE: "torque.tau", COULOMB: "dry.direction", ONE: "1"}

    def entries(which: Matrix) -> dict[tuple[int, int], Laurent]:
        found: dict[tuple[int, int], Laurent] = {}
        for t in drive.terms:
            if t.matrix == which:
                term = Laurent([(tuple(sorted(t.powers)), Fraction(t.coefficient))])
                found[t.row, t.col] = found.get((t.row, t.col), Laurent()) + term
        return found

    parameters = tuple(
        FlatParameter(p.name, p.unit, p.meaning, REFERENCE_VALUES[p.name], p.positive)
        for p in drive.parameters
    )
    return StateSpace(
        name=name,
        states=tuple(Quantity(name, q.unit) for name, q in zip(STATES, drive.states, strict=False)),
        inputs=tuple(FlatInput(kinds[kind], kind) for kind in drive.inputs),
        sensors=(FlatSensor("encoder", "shaft", output),),
        A=entries("A"),
        B=entries("B"),
        C=entries("C"),
        rest=entries("rest"),
        ratio={},
        speed_states=(drive.speed_state,),
        parameters=parameters,
        drawn=parameters,
        definitions=(),
        report=Report(flat_equations=71, flat_variables=70, flat_states=11, remaining_equations=6),
        notes=("the angle of the whole drive cannot be seen by a speed sensor: it is no state",),
        components=components(CHAIN),
    )


def merged(drive: StateSpace, name: str = "Jm") -> StateSpace:
    """The same with Jm = J1 + n^2 J2, as two rigidly joined inertias give it, under this name."""
    symbol = Laurent.symbol
    one = FlatParameter("J1", "kg m^2", "rotor", 0.005, True)
    two = FlatParameter("J2", "kg m^2", "brake", 0.001, True)
    ratio = FlatParameter("n", "1", "ratio of the brake", 0.5)
    kept = tuple(p for p in drive.drawn if p.name != "Jm")
    definition = Definition(name, symbol("J1") + symbol("n", 2) * symbol("J2"))
    return replace(renamed(drive, {"Jm": name}), drawn=(one, two, ratio, *kept), definitions=(definition,))


def renamed(drive: StateSpace, names: Mapping[str, str]) -> StateSpace:
    """The same drive with other names of its parameters."""
    symbols = {old: Laurent.symbol(new) for old, new in names.items()}

    def of(entries: Entries) -> Entries:
        return {place: value.substitute(symbols) for place, value in entries.items()}

    parameters = tuple(replace(p, name=names.get(p.name, p.name)) for p in drive.parameters)
    return replace(
        drive, parameters=parameters, drawn=parameters, A=of(drive.A), B=of(drive.B), C=of(drive.C)
    )


def components(rows: list[Row]) -> tuple[FlatComponent, ...]:
    return tuple(
        FlatComponent(name, kind, tuple(nodes.split()), {role: value(text) for role, text in roles.items()})
        for kind, name, nodes, roles in rows
    )


def value(text: str) -> Laurent:
    """``Jm`` or ``1/r``."""
    return Laurent.symbol(text[2:], -1) if text.startswith("1/") else Laurent.symbol(text)
