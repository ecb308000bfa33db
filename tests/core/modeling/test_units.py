"""Units: both ways of writing them, their arithmetic, and what the uses of parameters say about them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.modeling.components.component_kinds import Role
from monitor_core.modeling.components.units import BASE, ONE, Dimension, parse
from monitor_core.modeling.components.uses import Use, infer
from monitor_core.modeling.flat import ModelError, Origin
from tests.core.modeling import expressions

HOUSE = ["kg m^2", "N m/rad", "N m s/rad", "N m", "rad", "rad/s", "rad/s^2", "1"]
DIMENSIONS = st.builds(Dimension, st.tuples(*[st.integers(-4, 4)] * len(BASE)), st.integers(-2, 2))


# --- reading and writing -------------------------------------------------------------------------------


@given(DIMENSIONS)
def test_what_is_printed_can_be_read(dimension: Dimension) -> None:
    assert parse(str(dimension)) == dimension


@given(DIMENSIONS, DIMENSIONS)
def test_products_are_those_of_the_texts(a: Dimension, b: Dimension) -> None:
    assert parse(f"({a}) ({b})") == a * b
    assert parse(f"({a})/({b})") == a / b


@given(DIMENSIONS, DIMENSIONS, st.integers(1, 4), st.booleans())
def test_laws(a: Dimension, b: Dimension, n: int, negative: bool) -> None:
    degree = -n if negative else n
    assert a * b == b * a
    assert a * b / b == a
    assert a * ONE == a
    assert (a * b) ** n == a**n * b**n
    assert (a**degree).root(degree) == a


@pytest.mark.parametrize("text", HOUSE)
def test_house_names_are_printed_as_they_are_written(text: str) -> None:
    assert str(parse(text)) == text


@pytest.mark.parametrize(
    ("modelica", "house"),
    [
        ("kg.m2", "kg m^2"),
        ("N.m.s/rad", "N m s/rad"),
        ("N.m/(rad/s)", "N m s/rad"),
        ("N.m/rad", "N m/rad"),
        ("rad/s2", "rad/s^2"),
        ("J", "N m"),
        ("N.m.s", "N m s"),
        ("s-1", "1/s"),
        ("V.s/Wb", "1"),
        ("N.m/A", "N m/A"),
        ("1/(kg m^2)", "1/(kg m^2)"),
        ("m/s/s", "m/s^2"),
        ("N/m", "N/m"),
        ("(m/s)^2", "m^2/s^2"),
    ],
)
def test_both_ways_of_writing(modelica: str, house: str) -> None:
    assert str(parse(modelica)) == house


def test_radians_make_no_difference() -> None:
    assert parse("N m/rad") == parse("N m") == parse("kg m^2/s^2")
    assert parse("rad") == parse("1") == ONE
    assert parse("N m") != parse("N m s")
    assert parse("kg m^2").root(4) is None


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "ends too early"),
        ("deg", "deg is not among kg m s"),
        ("mm", "mm is not among kg m s"),
        ("N m/rad s", 'in brackets: "N m/(rad/s)"'),
        ("N m/", "ends too early"),
        ("(m", "ends too early"),
        ("m)", "a bracket is out of place"),
        ("()", "ends too early"),
        ("m^", "'^' is no unit"),
        ("2", "'2' is no unit"),
        ("m^2^2", "'^2' is no unit"),
        ("kg..m", "'.m' is no unit"),
        ("kg m^½", "is no unit"),
        ("m" * 200, "longer than"),
        ("(" * 200, "longer than"),
    ],
)
def test_units_that_are_none(text: str, problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        parse(text, Origin("motor", "drive.mo", 7))
    assert str(caught.value).startswith("drive.mo:7: motor: unit ")
    assert problem in str(caught.value)


# --- inference -----------------------------------------------------------------------------------------


def use(text: str, unit: str, place: str) -> Use:
    """``place``: "J (inertia) of motor"."""
    what, _, component = place.partition(" of ")
    role, _, meaning = what.rstrip(")").partition(" (")
    origin = Origin(component, "drive.mo", 3)
    return Use(expressions.parse(text), unit, origin, Role(role, unit, meaning) if role else None)


MOTOR, BELT, DAMPING = "J (inertia) of motor", "c (stiffness) of belt", "d (damping) of belt"


def test_a_name_alone_has_the_unit_of_its_use() -> None:
    uses = [use("Jm", "kg m^2", MOTOR), use("k", "N m/rad", BELT), use("u", "", "k (gain) of gain")]
    assert infer(uses) == {"Jm": "kg m^2", "k": "N m/rad", "u": ""}


def test_products_are_solved_for_the_one_unknown() -> None:
    uses = [
        use("m*l^2", "kg m^2", MOTOR),
        use("alpha*m*l^2 + beta*k", "N m s/rad", DAMPING),
        use("k", "N m/rad", BELT),
        use("k*r^2", "N m/rad", "c (stiffness) of arm"),
        use("q/z", "1", "ratio of gear"),
    ]
    assert infer(uses, {"l": "m"}) == {
        "l": "m",
        "m": "kg",
        "k": "N m/rad",
        "r": "1",
        "alpha": "1/s",
        "beta": "s",
        "q": "",
        "z": "",
    }


def test_how_radians_are_written_is_taken_from_where_the_name_stands_alone() -> None:
    assert infer([use("2*k", "N m", "fc of brake"), use("k", "N m/rad", BELT)]) == {"k": "N m/rad"}


def test_summands_say_it_to_each_other() -> None:
    assert infer([use("a + b + 2*c", "", "k of gain")], {"b": "N.m"}) == {"a": "N m", "b": "N m", "c": "N m"}


@given(st.permutations([("a", "N m"), ("a*b", "N m s"), ("b*c", "m s"), ("c*d^2", "m/s^2"), ("d*e", "1/s")]))
def test_the_order_of_the_uses_does_not_matter(pairs: list[tuple[str, str]]) -> None:
    uses = [use(text, unit, "x of y") for text, unit in pairs]
    assert infer(uses) == {"a": "N m", "b": "s", "c": "m", "d": "1/s", "e": "1"}


@pytest.mark.parametrize("order", [1, -1])
def test_a_stiffness_is_no_inertia(order: int) -> None:
    uses = [use("k", "kg m^2", MOTOR), use("k", "N m/rad", BELT)][::order]
    with pytest.raises(ModelError) as caught:
        infer(uses)
    assert str(caught.value) in (
        "drive.mo:3: belt: its c (stiffness) is in N m/rad, but k is in kg m^2 (k is kg m^2: J (inertia) of motor)",
        "drive.mo:3: motor: its J (inertia) is in kg m^2, but k is in N m/rad (k is N m/rad: c (stiffness) of belt)",
    )


@pytest.mark.parametrize(
    ("text", "unit", "declared", "problem"),
    [
        ("m*l^2", "kg m^2", {"m": "kg", "l": "s"}, "is in kg m^2, but l^2*m is in kg s^2 (l is s: declared so"),
        ("k", "kg m^2", {"k": "N.m/rad"}, "but k is in N m/rad (k is N m/rad: declared so)"),
        ("a + b", "", {"a": "m", "b": "s"}, "a + b is in m, but b is in s"),
        ("Jm + k", "kg m^2", {"k": "N m"}, "but k is in N m"),
        ("l^2*r + 2*k", "kg m^2", {"r": "1", "k": "N m"}, "but k is in N m"),
    ],
)  # fmt: skip
def test_conflicts_name_the_place_and_the_reason(text: str, unit: str, declared: dict[str, str], problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        infer([use(text, unit, MOTOR if unit else " of motor")], declared)
    assert str(caught.value).startswith("drive.mo:3: motor: ")
    assert problem in str(caught.value)


def test_a_root_without_a_unit_stays_unknown() -> None:
    assert infer([use("x^2", "kg m^2", MOTOR), use("l^2", "m^2", "x of y")]) == {"x": "", "l": "m"}


def test_numbers_stand_for_parameters_alone_and_as_summands() -> None:
    assert infer([use("0.01", "kg m^2", MOTOR), use("Jm + 0.01", "kg m^2", MOTOR)]) == {"Jm": "kg m^2"}
