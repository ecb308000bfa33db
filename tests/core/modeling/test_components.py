"""Each component against physics: the motion and torques that physics gives satisfy its equations, no others do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling.components import COMPONENT_KINDS, Fragment, fragment, join
from monitor_core.modeling.components.component_kinds import ComponentKind
from monitor_core.modeling.components.units import parse
from monitor_core.modeling.flat import CONSTANT, FlatEquation, Origin
from monitor_core.modeling.laurent import Laurent

Jet = tuple[Fraction, ...]
"""A value and its derivatives."""

NUMBERS = st.fractions(min_value=-9, max_value=9, max_denominator=4)
MOTION = st.tuples(NUMBERS, NUMBERS, NUMBERS)


def jet(value: Fraction | int) -> Jet:
    return (Fraction(value),)


def scaled(motion: Jet, factor: Fraction) -> Jet:
    return tuple(factor * x for x in motion)


def component(kind: str) -> Fragment:
    """The component "x" with parameters named as their roles."""
    names = {role.name: Laurent.symbol(role.name) for role in COMPONENT_KINDS[kind].roles}
    return fragment(COMPONENT_KINDS[kind], "x", names, Origin("x"))


# --- physics, written down a second time -----------------------------------------------------------------


@dataclass(frozen=True)
class Moment:
    """Motion at the flanges, parameters, and a number that is free: a torque from outside, or a signal."""

    a: Jet
    b: Jet
    p: Mapping[str, Fraction]
    free: Fraction


def between(m: Moment, torque_on_b: Fraction, with_speed: bool) -> dict[str, Jet]:
    """Actio and reactio."""
    rel = tuple(y - x for x, y in zip(m.a, m.b, strict=True))
    return {
        "flange_a.phi": m.a,
        "flange_b.phi": m.b,
        "phi_rel": rel,
        "tau": jet(torque_on_b),
        "flange_a.tau": jet(-torque_on_b),
        "flange_b.tau": jet(torque_on_b),
        **({"w_rel": rel[1:], "a_rel": rel[2:]} if with_speed else {}),
    }


def stretched(m: Moment) -> Fraction:
    return m.p.get("c", Fraction(0)) * (m.b[0] - m.a[0]) + m.p.get("d", Fraction(0)) * (m.b[1] - m.a[1])


def at_flange(m: Moment, torque: Fraction | int, **more: Jet) -> dict[str, Jet]:
    return {"flange.phi": m.a, "flange.tau": jet(torque), **more}


PHYSICS: dict[str, Callable[[Moment], dict[str, Jet]]] = {
    "inertia": lambda m: {
        "flange_a.phi": m.a,
        "flange_b.phi": m.a,
        "phi": m.a,
        "w": m.a[1:],
        "a": m.a[2:],
        "flange_a.tau": jet(m.free),
        "flange_b.tau": jet(m.p["J"] * m.a[2] - m.free),
    },
    "fixed": lambda m: {"flange.phi": scaled(m.a, Fraction(0)), "flange.tau": jet(m.free)},
    "spring": lambda m: between(m, stretched(m), False),
    "damper": lambda m: between(m, stretched(m), True),
    "spring-damper": lambda m: between(m, stretched(m), True),
    # what goes in at a comes out at b: tau_a w_a + tau_b w_b = 0
    "ideal-gear": lambda m: {
        "flange_a.phi": m.a,
        "flange_b.phi": scaled(m.a, 1 / m.p["ratio"]),
        "flange_a.tau": jet(m.free),
        "flange_b.tau": jet(-m.free * m.p["ratio"]),
    },
    # a torque on the component brakes what is connected
    "viscous-friction": lambda m: at_flange(m, m.p["d"] * m.a[1], w=m.a[1:]),
    "coulomb-friction": lambda m: at_flange(m, m.p["fc"] * m.free, direction=jet(m.free)),
    "gravity": lambda m: at_flange(
        m, m.p["gc"] * m.free + m.p["gs"] * (1 - m.free), cosine=jet(m.free), sine=jet(1 - m.free)
    ),
    "torque-offset": lambda m: at_flange(m, -m.p["tau0"]),
    "torque": lambda m: at_flange(m, -m.p["kT"] * m.free, tau=jet(m.free)),
    "speed-sensor": lambda m: at_flange(m, 0, w=m.a[1:]),
    "angle-sensor": lambda m: at_flange(m, 0, phi=m.a),
    "gain": lambda m: {"u": jet(m.free), "y": jet(m.p["k"] * m.free)},
}

ANYTHING = {
    "fixed": {"x.flange.tau"},
    "coulomb-friction": {"x.flange.phi"},
    "gravity": {"x.flange.phi"},
    "torque-offset": {"x.flange.phi"},
    "torque": {"x.flange.phi"},
}
"""Variables that the component itself says nothing about."""


def residual(equation: FlatEquation, jets: Mapping[str, Jet], p: Mapping[str, Fraction]) -> Fraction:
    return sum((Fraction(c.value(p)) * jets[name][k] for (name, k), c in equation.terms.items()), Fraction(0))


@pytest.mark.parametrize("kind", COMPONENT_KINDS)
@settings(max_examples=6)  # the equations are linear
@given(a=MOTION, b=MOTION, free=NUMBERS, data=st.data())
def test_physics_satisfies_the_equations_and_nothing_else_does(
    kind: str, a: Jet, b: Jet, free: Fraction, data: st.DataObject
) -> None:
    part = component(kind)
    p = {role.name: data.draw(NUMBERS.filter(bool), label=role.name) for role in COMPONENT_KINDS[kind].roles}
    jets = {f"x.{name}": value for name, value in PHYSICS[kind](Moment(a, b, p, free)).items()}
    assert jets.keys() == {v.name for v in part.variables} | {i.name for i in part.inputs} - {CONSTANT}
    jets[CONSTANT] = jet(1)
    assert [residual(e, jets, p) for e in part.equations] == [0] * len(part.equations)
    changed = {v.name: {**jets, v.name: tuple(x + 1 for x in jets[v.name])} for v in part.variables}
    unnoticed = {n for n, wrong in changed.items() if not any(residual(e, wrong, p) for e in part.equations)}
    assert unnoticed == ANYTHING.get(kind, set())


@pytest.mark.parametrize("kind", COMPONENT_KINDS.values(), ids=lambda kind: kind.name)
def test_connections_and_signals_make_up_for_the_missing_equations(kind: ComponentKind) -> None:
    part = component(kind.name)
    assert len(part.variables) == len(part.equations) + len(kind.flanges) + len(kind.signals_in)
    for name in (*kind.signals_in, *kind.signals_out):
        assert f"x.{name}" in {v.name for v in part.variables}
    for flange in kind.flanges:
        assert {f"x.{flange}.phi", f"x.{flange}.tau"} <= {v.name for v in part.variables}


def test_units_of_the_parameters_make_the_equations_homogeneous() -> None:
    for kind in COMPONENT_KINDS.values():
        part = component(kind.name)
        units = {role.name: role.unit for role in kind.roles}
        unit_by_name = {v.name: v.unit for v in part.variables} | {i.name: "1" for i in part.inputs}
        for equation in part.equations if kind.name != "gain" else ():
            dimensions = set()
            for (name, order), c in equation.terms.items():
                product = parse(unit_by_name[name]) * parse("s") ** -order
                for factor in c.names:
                    product = product * parse(units[factor])
                dimensions.add(product)
            assert len(dimensions) == 1, (kind.name, equation)


# --- inputs and sensors ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "inputs"),
    [
        ("coulomb-friction", [("x.direction", COULOMB, "x.flange.phi")]),
        ("gravity", [("x.cosine", COSINE, "x.flange.phi"), ("x.sine", SINE, "x.flange.phi")]),
        ("torque-offset", [(CONSTANT, ONE, "")]),
        ("torque", []),
        ("inertia", []),
    ],
)
def test_inputs(kind: str, inputs: list[tuple[str, int, str]]) -> None:
    assert [(i.name, i.kind, i.angle) for i in component(kind).inputs] == inputs


def test_a_torque_that_is_measured() -> None:
    part = component("torque").measured("x.tau")
    assert [(i.name, i.kind, i.angle) for i in part.inputs] == [("x.tau", TORQUE, "")]
    assert "x.tau" not in {v.name for v in part.variables}
    assert part.equations == component("torque").equations


def test_joined_fragments_share_the_constant() -> None:
    offset, brake = component("torque-offset"), component("coulomb-friction")
    together = join([offset, brake, offset])
    assert [i.name for i in together.inputs] == [CONSTANT, "x.direction"]
    assert together.equations == offset.equations + brake.equations + offset.equations


# --- mistakes --------------------------------------------------------------------------------------------


def test_a_parameter_that_is_zero_leaves_no_term() -> None:
    part = fragment(COMPONENT_KINDS["viscous-friction"], "x", {"d": Laurent()}, Origin("x"))
    assert dict(part.equations[1].terms) == {("x.flange.tau", 0): Laurent.number(1)}


@pytest.mark.parametrize(
    ("kind", "role", "value", "problem"),
    [
        ("inertia", "J", 0.1, ""),
        ("inertia", "J", 0.0, "must be greater than zero"),
        ("inertia", "J", -1.0, "must be greater than zero"),
        ("inertia", "J", float("nan"), "must be finite"),
        ("inertia", "J", float("inf"), "must be finite"),
        ("ideal-gear", "ratio", -118.0, ""),
        ("ideal-gear", "ratio", 0.0, "must not be zero"),
        ("damper", "d", 0.0, ""),
        ("torque-offset", "tau0", -1.0, ""),
    ],
)
def test_values_that_make_no_sense(kind: str, role: str, value: float, problem: str) -> None:
    assert COMPONENT_KINDS[kind].role(role).problem(value) == problem
