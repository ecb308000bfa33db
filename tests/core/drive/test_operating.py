"""Nominal values that follow signals, and gates: what each sample gets."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.gates import Gate
from monitor_core.drive.operating_conditions import MARGIN, Conditions, NominalSchedule, Operating
from monitor_core.drive.signal_terms import Term
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass

MODEL = AxisModel(three_mass("angle"), REFERENCE_VALUES, ("kT", "1/Ja", "fm"))
TURNING = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", "1/Ja", "fm"))
FRICTION = NominalSchedule("fm", Term.read("temperature"), -0.0005, 40.0, 20.0, 60.0)
NAN = math.nan


def follow(name: str, function: str = "") -> NominalSchedule:
    return NominalSchedule(name, Term.read(f"{function}(t)" if function else "t"), 1.0, 0.0)


def taken(
    conditions: Conditions, *rows: tuple[float, ...], model: AxisModel = TURNING
) -> tuple[np.ndarray, np.ndarray, str]:
    operating = Operating(model, conditions)
    t_us = np.arange(len(rows)) * 5000
    shift, gate = operating.take(t_us, np.ones(len(rows)), np.array(rows, float))
    return shift, gate, operating.reason


def test_a_nominal_value_follows_its_signals_and_no_other() -> None:
    shift, gate, reason = taken(Conditions(("mode", "temperature"), (FRICTION,)), (7, 40), (7, 50), (7, 25))
    assert gate.all()
    assert reason == ""
    np.testing.assert_allclose(shift[:, 2], [0.0, -0.005, 0.0075], rtol=1e-12)
    assert (shift[:, :2] == 0).all()
    more = NominalSchedule("fm", Term.read("square(load)"), 0.001, 1.0)
    shift, _, _ = taken(Conditions(("temperature", "load"), (FRICTION, more)), (50, 3))
    assert shift[0, 2] == pytest.approx(-0.005 + 0.008)


@pytest.mark.parametrize(("watched", "given"), [("1/Ja", "Ja"), ("Ja", "1/Ja"), ("Ja", "Ja"), ("1/Ja", "1/Ja")])
def test_slopes_of_a_parameter_and_of_its_reciprocal_are_converted_exactly(watched: str, given: str) -> None:
    model = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", watched))
    ja = REFERENCE_VALUES["Ja"]
    base = ja if given == "Ja" else 1 / ja
    follow = NominalSchedule(given, Term.read("s"), 0.3 * base, 0.0)
    shift, _, _ = taken(Conditions(("s",), (follow,)), (0.0,), (1.0,), (-1.0,), model=model)
    value = base * np.array([1.0, 1.3, 0.7])
    expected = value if given == watched else 1 / value
    assert shift[0, 1] == 0
    np.testing.assert_allclose(model.theta0[1] + shift[:, 1], expected, rtol=1e-12)


def test_a_tenth_beyond_the_range_is_followed_and_no_more() -> None:
    reach = MARGIN * 40
    inside, outside = (20 - 0.99 * reach, 60 + 0.99 * reach), (20 - 1.01 * reach, 60 + 1.01 * reach)
    shift, gate, reason = taken(Conditions(("temperature",), (FRICTION,)), *((s,) for s in (*inside, *outside)))
    assert gate.all()
    assert np.isfinite(shift[:2, 2]).all()
    assert np.isnan(shift[2:, 2]).all()
    assert reason == "temperature = 64.04, beyond 20 to 60"


def test_what_is_not_known_is_said() -> None:
    shift, _, reason = taken(Conditions(("temperature",), (FRICTION,)), (30,), (NAN,))
    assert np.isfinite(shift[0]).all()
    assert np.isnan(shift[1, 2])
    assert reason == "temperature is not known"
    operating = Operating(TURNING, Conditions(("temperature",), (FRICTION,)))
    assert operating.reason == ""
    shift, _ = operating.take(np.zeros(2, np.int64), np.zeros(2), None)
    assert np.isnan(shift[:, 2]).all()


@pytest.mark.parametrize(("name", "slope"), [("fm", -1.0), ("Ja", -3.0), ("1/Ja", -3.0), ("1/Ja", 30.0)])
def test_an_impossible_nominal_value_is_none(name: str, slope: float) -> None:
    model = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("1/Ja", "fm"), bounds={"fm": (0.01, 0.1)})
    value = {"Ja": REFERENCE_VALUES["Ja"], "1/Ja": 1 / REFERENCE_VALUES["Ja"], "fm": REFERENCE_VALUES["fm"]}[name]
    i = 1 if name == "fm" else 0
    follow = NominalSchedule(name, Term.read("s"), slope * value, 0.0)
    shift, _, reason = taken(Conditions(("s",), (follow,)), (0.1,), (1.0,), model=model)
    assert np.isnan(shift[:, i]).tolist() == [False, True]
    assert reason == f"{model.monitored[i]} would leave its bounds"


@pytest.mark.parametrize(
    ("gate", "is_open"),
    [
        (
            Gate("mode", equals=(3.0, 4.0)),
            {3.0: True, 4.0: True, 3.5: False, 0.0: False, NAN: False, 4 + 1e-9: True},
        ),
        (Gate("mode", above=2.0), {2.0: False, 2.1: True, NAN: False}),
        (Gate("mode", below=2.0), {2.0: False, 1.9: True, NAN: False}),
    ],
)
def test_gates(gate: Gate, is_open: dict[float, bool]) -> None:
    for value, expected in is_open.items():
        _, opened, reason = taken(Conditions(("mode",), (), (gate,)), (value,))
        assert opened.tolist() == [expected]
        closed = "mode is not known" if math.isnan(value) else f"mode = {value:g}"
        assert reason == ("" if expected else closed)


def test_all_gates_must_be_open() -> None:
    conditions = Conditions(("mode", "brake"), (), (Gate("mode", (3.0,)), Gate("brake", below=0.5)))
    _, gate, reason = taken(conditions, (3, 0), (3, 1), (2, 0), (2, 1))
    assert gate.tolist() == [True, False, False, False]
    assert reason == "mode = 2"


@pytest.mark.parametrize("cuts", [[], [3], [1, 2, 3, 4, 5, 6, 7]])
def test_a_gate_settles_after_its_signal(cuts: list[int]) -> None:
    """Each time for more than 10 ms, and from block to block; not before the first sample."""
    operating = Operating(TURNING, Conditions(("closed",), (), (Gate("closed", below=0.5, settle_s=0.01),)))
    t_us = 1_760_000_000_000_000 + 5_000 * np.arange(9)
    closed = np.array([[0.0], [1.0], [0.0], [0.0], [0.0], [1.0], [NAN], [0.0], [0.0]])
    expected = [True, False, False, False, True, False, False, False, False]
    found, reasons = list[bool](), list[str]()
    for part in np.split(np.arange(9), cuts):
        _, gate = operating.take(t_us[part], np.zeros(part.size), closed[part])
        found += gate.tolist()
        reasons.append(operating.reason)
    assert found == expected
    assert reasons[-1] == "closed closed a gate less than 0.01 s ago"
    if len(cuts) == 7:
        assert reasons[:4] == ["", "closed = 1", reasons[-1], reasons[-1]]


# Angles: first; 2 rad/s; -2 rad/s; 0.4 rad/s; no later than the one before; no number; 3 rad/s over two intervals.
@pytest.mark.parametrize(
    ("model", "t_ms", "y", "expected"),
    [
        (TURNING, [0, 5, 10, 15], [0.4, -0.5, 2.0, NAN], [False, True, True, False]),
        (
            MODEL,
            [0, 5, 10, 20, 20, 25, 30],
            [1.0, 1.01, 1.0, 1.004, 3.0, NAN, 3.03],
            [False, True, True, False, False, False, True],
        ),
    ],
    ids=["speed", "angle"],
)
def test_slow_is_gated(model: AxisModel, t_ms: list[int], y: list[float], expected: list[bool]) -> None:
    operating = Operating(model, Conditions(min_speed=0.5))
    shift, gate = operating.take(1000 * np.array(t_ms), np.array(y), None)
    assert gate.tolist() == expected
    assert not shift.any()
    assert operating.reason == ("" if expected[-1] else "slower than 0.5 rad/s")


@given(cuts=st.lists(st.integers(0, 60), max_size=4), seed=st.integers(0, 2**32 - 1))
def test_blocks_may_be_split_anywhere(cuts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    inertia = NominalSchedule("Ja", Term.read("cos(angle2)"), 20.0, 0.1)
    conditions = Conditions(
        ("temperature", "angle2", "mode"), (FRICTION, inertia), (Gate("mode", (1.0, 2.0)),), min_speed=1.0
    )
    t_us, y = np.cumsum(rng.integers(0, 6000, 60)), np.cumsum(rng.normal(0, 0.005, 60))
    signals = np.column_stack([rng.choice([NAN, 30.0, 45.0, 90.0], 60), rng.normal(0, 3, 60), rng.integers(0, 3, 60)])
    y[rng.random(60) < 0.05] = NAN
    at_once, parts = Operating(MODEL, conditions), Operating(MODEL, conditions)
    shift, gate = at_once.take(t_us, y, signals)
    ends = [0, *sorted(cuts), 60]
    found = [parts.take(t_us[a:b], y[a:b], signals[a:b]) for a, b in pairwise(ends)]
    np.testing.assert_array_equal(np.concatenate([s for s, _ in found]), shift)
    np.testing.assert_array_equal(np.concatenate([g for _, g in found]), gate)
    assert parts.reason == at_once.reason


@pytest.mark.parametrize(
    ("conditions", "error", "words"),
    [
        (Conditions(("t",), (follow("fc"),)), ValueError, "fc is to follow t, but is not"),
        (Conditions(("t",), (follow("fm", "tan"),)), ValueError, "no function tan of signals"),
        (Conditions(("t",), (follow("Ja"), follow("1/Ja"))), ValueError, "slopes of both Ja and 1/Ja"),
        (Conditions(("t",), (FRICTION,)), KeyError, "no signal temperature"),
        (Conditions((), (), (Gate("mode"),)), KeyError, "no signal mode"),
    ],
)
def test_what_cannot_be_followed_is_refused(conditions: Conditions, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        Operating(MODEL, conditions)
