"""Connections: equal angles, torques that add up to zero, for any way of drawing the same joints."""

from hypothesis import given
from hypothesis import strategies as st

from monitor_core.modeling.components.fragments import End, Joint, connect
from monitor_core.modeling.flat import FlatEquation, Origin
from monitor_core.modeling.laurent import Laurent

FLANGES = [f"c{i}.flange" for i in range(9)]
PAIRS = st.lists(st.tuples(st.sampled_from(FLANGES), st.sampled_from(FLANGES)), max_size=12)


def joints(pairs: list[tuple[str, str]]) -> list[Joint]:
    return [Joint(f"n{i}", (End(a), End(b)), Origin(f"n{i}")) for i, (a, b) in enumerate(pairs)]


def groups(pairs: list[tuple[str, str]]) -> set[frozenset[str]]:
    """By closing over neighbours until nothing changes: a second way."""
    reach = {flange: {flange} for flange in FLANGES}
    for _ in FLANGES:
        for a, b in pairs:
            union = reach[a] | reach[b]
            for flange in union:
                reach[flange] = reach[flange] | union
    return {frozenset(group) for group in reach.values()}


def coefficients(equation: FlatEquation) -> dict[str, int]:
    assert all(k == 0 and c in (Laurent.number(1), Laurent.number(-1)) for (_, k), c in equation.terms.items())
    return {name: int(c.value({})) for (name, _), c in equation.terms.items()}


@given(PAIRS, st.permutations(FLANGES))
def test_torques_add_up_to_zero_in_each_group(pairs: list[tuple[str, str]], flanges: list[str]) -> None:
    flows = [c for c in map(coefficients, connect(joints(pairs), flanges)) if "tau" in next(iter(c))]
    assert {frozenset(flow) for flow in flows} == {
        frozenset(f"{flange}.tau" for flange in group) for group in groups(pairs)
    }
    assert {sign for flow in flows for sign in flow.values()} == {1}


@given(PAIRS)
def test_angles_are_equal_in_each_group_and_only_there(pairs: list[tuple[str, str]]) -> None:
    """Equalities of two angles each, one fewer than flanges in the group, that connect all of the group."""
    equal = [c for c in map(coefficients, connect(joints(pairs), FLANGES)) if "phi" in next(iter(c))]
    assert all(sorted(c.values()) == [-1, 1] for c in equal)
    drawn = [tuple(name.removesuffix(".phi") for name in c) for c in equal]
    assert groups([(a, b) for a, b in drawn]) == groups(pairs)
    assert len(drawn) == len(FLANGES) - len(groups(pairs))


def test_no_torque_acts_on_an_unconnected_flange() -> None:
    (equation,) = connect([], ["motor.flange_b"])
    assert coefficients(equation) == {"motor.flange_b.tau": 1}
    assert equation.origin == Origin("motor.flange_b")


def test_outside_connectors_have_the_other_sign() -> None:
    """An arm with one flange of its own: inside, the torque on its mass comes from there."""
    inside = Joint("1", (End("arm.flange", outside=True), End("arm.mass.flange_a")))
    around = Joint("2", (End("motor.flange_b"), End("arm.flange")))
    equations = connect([inside, around], ["motor.flange_b", "arm.flange", "arm.mass.flange_a"])
    assert [coefficients(e) for e in equations] == [
        {"arm.flange.phi": 1, "arm.mass.flange_a.phi": -1},
        {"arm.flange.tau": -1, "arm.mass.flange_a.tau": 1},
        {"motor.flange_b.phi": 1, "arm.flange.phi": -1},
        {"motor.flange_b.tau": 1, "arm.flange.tau": 1},
    ]


def test_an_outside_connector_that_nothing_is_connected_to_around_it_is_free() -> None:
    inside = Joint("1", (End("arm.flange", outside=True), End("arm.mass.flange_a")))
    *_, last = connect([inside], ["arm.flange", "arm.mass.flange_a"])
    assert coefficients(last) == {"arm.flange.tau": 1}
