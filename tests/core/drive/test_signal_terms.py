"""Terms that nominal values follow: how they are read, and their values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive.signal_terms import FUNCTIONS, Factor, SignalProduct, Term

PLAIN = ((1, "temperature"),)


@pytest.mark.parametrize(
    ("text", "factors"),
    [
        ("temperature", [("", PLAIN)]),
        (" cos(angle2) ", [("cos", ((1, "angle2"),))]),
        ("square ( a-b )", [("square", ((1, "a-b"),))]),
        ("tan(x)", [("tan", ((1, "x"),))]),
        ("cos(a2+a3 - a-4)", [("cos", ((1, "a2"), (1, "a3"), (-1, "a-4")))]),
        ("sin(-a -b)", [("sin", ((-1, "a"), (-1, "b")))]),
        ("payload*cos(a + b)", [("", ((1, "payload"),)), ("cos", ((1, "a"), (1, "b")))]),
    ],
)
def test_terms_are_read(text: str, factors: list[tuple[str, tuple[tuple[int, str], ...]]]) -> None:
    assert Term.read(text).factors == tuple(factors)


NAMES = st.tuples(st.sampled_from("abz"), st.text("az09_", max_size=3), st.sampled_from(["", "-a", "-1"])).map("".join)
FACTORS = st.builds(
    Factor,
    st.sampled_from(sorted(FUNCTIONS)),
    st.lists(st.tuples(st.sampled_from((1, -1)), NAMES), min_size=1, max_size=3).map(tuple),
) | NAMES.map(lambda name: Factor("", ((1, name),)))


PRODUCTS = st.builds(
    SignalProduct,
    st.lists(FACTORS, min_size=1, max_size=3).map(tuple),
    st.sampled_from((1.0, -1.0, 2.0, -2.0, 0.25)),
)


@given(st.lists(PRODUCTS, min_size=1, max_size=3).map(lambda products: Term(tuple(products))))
def test_a_term_is_written_as_it_is_read(term: Term) -> None:
    assert Term.read(str(term)) == term


@pytest.mark.parametrize(
    "text",
    [
        "",
        "cos()",
        "2",
        "x * 2",
        "0 * x",
        "cos(x",
        "a +",
        "+ a",
        "cos(sin(x))",
        "a *",
        "cos(a- b)",
        "cos(a + )",
    ],
)
def test_what_is_no_term_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"is neither a signal nor one of cos\(...\), sin\(...\), square\(...\)"):
        Term.read(text)


def test_functions_are_what_they_are_called() -> None:
    x = np.array([0.3, -2.0, math.nan, math.inf])
    expected = {"cos": np.cos(x[:2]), "sin": np.sin(x[:2]), "square": x[:2] ** 2}
    assert set(FUNCTIONS) == set(expected)
    with pytest.raises(KeyError, match="tan"):
        Term.read("tan(x)").value({"x": x})
    for name, values in expected.items():
        found = Term.read(f"{name}(x)").value({"x": x})
        np.testing.assert_allclose(found[:2], values, rtol=1e-15)
        assert np.isnan(found[2:]).all()


def test_the_load_of_a_link_is_a_product_with_the_cosine_of_a_sum_of_angles() -> None:
    signals = {"m": np.array([0.0, 2.0, 3.0]), "a": np.array([1.0, 1.0, math.nan]), "b": np.full(3, 0.5)}
    term = Term.read("m * cos(a - b)")
    assert term.signals == ("m", "a", "b")
    assert term.functions == ("cos",)
    np.testing.assert_allclose(term.value(signals), [0.0, 2 * math.cos(0.5), math.nan], rtol=1e-15)


def test_a_sum_of_products_has_one_value() -> None:
    a, b, v, w = np.array([[0.3, 0.4], [1.0, -2.0], [0.5, 3.0], [2.0, 0.7]])
    term = Term.read("-a*cos(b) + 2 * v * w * sin(b + b) - square(v - w)")
    assert [product.number for product in term.products] == [-1, 2, -1]
    expected = -a * np.cos(b) + 2 * v * w * np.sin(2 * b) - (v - w) ** 2
    np.testing.assert_allclose(term.value({"a": a, "b": b, "v": v, "w": w}), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "is_load"),
    [
        ("cos(axis2)", True),
        ("payload * cos(axis2)", True),
        ("grip * lift-acceleration", True),
        ("lift-acceleration", False),
        ("payload", False),
        ("square(axis1-speed)", False),
    ],
)
def test_what_is_a_torque_of_what_the_axis_carries(text: str, is_load: bool) -> None:
    assert Term.read(text).is_load == is_load
