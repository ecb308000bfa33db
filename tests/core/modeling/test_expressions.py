"""Expressions of parameters become the Laurent sums that they say, or an error that shows them."""

import re
from fractions import Fraction

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from monitor_core.modeling.drawing.expressions import HIGHEST, LONGEST, parse
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.laurent import Laurent

VALUES = {"Jm": Fraction(2, 11), "r": Fraction(1, 118), "arm.l": Fraction(5), "x_1": Fraction(-101, 7)}


def expressions() -> st.SearchStrategy[str]:
    leaves = st.sampled_from([*VALUES, "3", "0.25", "1e-3", "  r ", ".5"])
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]}) {t[1]} ({t[2]})"),
            st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda t: f"{t[0]}{t[1]}{t[2]}"),
            st.tuples(inner, st.integers(0, 3)).map(lambda t: f"({t[0]})^{t[1]}"),
            inner.map(lambda text: f"-{text}"),
        ),
        max_leaves=8,
    )


def evaluated(text: str) -> Fraction:
    """Python's own arithmetic on the same text, numbers written as fractions: a second way."""
    exact = re.sub(r"(?<![\w.])(\d*\.?\d+(?:e-?\d+)?)", r"Fraction('\1')", text.strip().replace("^", "**"))
    names = {name.replace(".", "_"): value for name, value in VALUES.items()}
    result = eval(exact.replace("arm.l", "arm_l"), {"Fraction": Fraction}, names)
    return Fraction(result)


@given(expressions())
def test_the_value_is_that_of_the_text(text: str) -> None:
    try:
        value = parse(text)
    except ModelError as error:
        assume("divides by" not in str(error) and len(text) <= LONGEST)
        raise
    assert value.value(VALUES) == evaluated(text)


@given(expressions())
def test_what_is_printed_can_be_read(text: str) -> None:
    try:
        value = parse(text)
    except ModelError:
        assume(False)
        raise
    if len(str(value)) <= LONGEST and all(abs(e) <= HIGHEST for m in value.terms for _, e in m):
        assert parse(str(value)) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1/r", Laurent.symbol("r", -1)),
        ("m*l^2", Laurent.symbol("m") * Laurent.symbol("l", 2)),
        ("m*l**2", Laurent.symbol("m") * Laurent.symbol("l", 2)),
        ("-l^2", -Laurent.symbol("l", 2)),
        ("2*(a + b)", (Laurent.symbol("a") + Laurent.symbol("b")) * Laurent.number(2)),
        ("motor.J", Laurent.symbol("motor.J")),
        ("0.1", Laurent.number(Fraction(1, 10))),
        ("(a + b)^2/(a + b)^2", Laurent.number(1)),
    ],
)
def test_expressions_as_drawn(text: str, value: Laurent) -> None:
    assert parse(text) == value


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "it is empty"),
        ("  ", "it is empty"),
        ("a b", "out of place"),
        ("a +", "ends too early"),
        ("(a", "ends too early"),
        ("sin(a)", "'sin(a)' is not arithmetic"),
        ("a if b else c", "is not arithmetic"),
        ("True", "'True' is not arithmetic"),
        ("a//b", "'a // b' is not arithmetic"),
        ("1e999", "is not arithmetic"),
        ("a[1]", "'[' at character 2"),
        ("'a'", '"\'" at character 1'),
        ("a..b", "'a' at character 1"),
        ("1and 2", "'1' at character 1"),
        ("3x", "'3' at character 1"),
        ("lambda", "out of place"),
        ("a\0", "at character 2"),
        ("a^b", "the exponent b is not a whole number"),
        ("a^0.5", "the exponent 1/2 is not a whole number"),
        ("a^13", "the exponent 13 is not a whole number"),
        ("1/(a + b)", "divides by a + b: only a product"),
        ("(a - b)^-1", "divides by"),
        ("1/0", "divides by 0"),
        ("0^-1", "divides by 0"),
        ("a" * 201, "longer than 200 characters"),
        ("((((9^12)^12)^12)^12)^12", "multiplied out, it is too long"),
        ("(a+b+c+d+e+f+g)^12", "has too many terms"),
        ("(a+b+c)^12*(d+e+f)^12", "multiplied out, it is too long"),
    ],
)
def test_errors_show_the_text_and_say_where(text: str, problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        parse(text, Origin("motor", "drive.mo", 7))
    assert str(caught.value).startswith(f"drive.mo:7: motor: {text!r} ")
    assert problem in str(caught.value)


@pytest.mark.parametrize("text", ["-" * 199 + "a", "(" * 99 + "a" + ")" * 99, "a+" * 99 + "a"])
def test_deep_nesting_is_read(text: str) -> None:
    assert parse(text).names == {"a"}


def test_deep_nesting_of_what_is_refused() -> None:
    with pytest.raises(ModelError, match="is not an expression"):
        parse("sin" + "(-" * 90 + "a" + ")" * 90)
