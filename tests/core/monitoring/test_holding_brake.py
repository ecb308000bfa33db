"""An axis that its brake holds is not tested; one that is controlled, moves, falls or has a stuck sensor is."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.drive import AxisModel, Conditions, NominalSchedule, Operating, Term
from monitor_core.drive.holding_brake import HOLD_S, HoldingBrake, rigid_accelerations
from monitor_core.kernel.tables import COSINE, ONE, TORQUE
from monitor_core.modeling.standard_drives import INTERVAL_S as MOVING_S
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.chains import chain, one_mass, values
from tests.core.moving_weight import MODEL, SETTINGS, moving

MASS = AxisModel(one_mass("angle"), {"kT": 1.0, "J": 0.01, "fm": 0.004, "fc": 0.1, "tau0": -1.0}, ("kT", "fm"))
"""A vertical linear axis: its weight always pulls with 1 N m, by which it falls with 100 rad/s^2."""
N = 200
T_US = np.arange(N, dtype=np.int64) * 5000
STOPS = 80


def held(model: AxisModel, u: Floats, y: Floats, t_us: NDArray[np.int64] = T_US) -> Bools:
    return HoldingBrake(model).take(t_us, u, y, None)


def stopped() -> tuple[Floats, Floats]:
    """Torque and angle of an axis that moves until its brake closes."""
    moves = np.minimum(np.arange(N), STOPS)
    return np.where(np.arange(N) < STOPS, 1.0, 0.003), 0.5 * np.sin(0.05 * moves)


@pytest.mark.parametrize("masses", [1, 2, 3, 5])
def test_accelerations_are_those_of_all_masses_at_the_motor(masses: int) -> None:
    drive, own = chain(masses, "angle"), values(masses)
    behind = sum(own[f"J{i}"] for i in range(2, masses + 1))
    J = own["J1"] + own["r"] ** 2 * behind
    by_input = rigid_accelerations(drive, own)
    kinds = np.array(drive.inputs)
    assert by_input[kinds == TORQUE] == pytest.approx(own["kT"] / J)
    assert by_input[kinds == ONE] == pytest.approx(own["tau0"] / J)
    (cosine,) = by_input[kinds == COSINE]
    assert abs(cosine) == pytest.approx(own["r"] * own["gc"] / J)


def test_an_axis_without_torque_that_stands_is_held() -> None:
    u, y = stopped()
    found = held(MASS, u, y)
    since = STOPS + round(HOLD_S / 0.005)
    assert not found[:since].any()
    assert found[since + 1 :].all()


def test_an_axis_whose_brake_fails_is_no_longer_held() -> None:
    """A noisy sample is no motion; a fall is one within a tenth of a second."""
    u, t = np.zeros(N), np.maximum(np.arange(N) * 0.005 - 0.5, 0.0)
    y = np.asarray(-50.0 * t**2)
    y[60] += 0.1
    found = held(MASS, u, y)
    assert found[21:100].all()
    assert not found[120:].any()


@pytest.mark.parametrize(
    "what",
    [
        "controlled",
        "stuck sensor",
        "falls",
        "turns back",
        "friction bears it",
        "friction bears the rest",
        "not measured",
        "clock",
    ],
)
def test_no_other_axis_is_held(what: str) -> None:
    u, y = stopped()
    model, t, t_us = MASS, np.arange(N) * 0.005, T_US
    if what == "controlled":
        u = np.full(N, 0.9)
    elif what == "stuck sensor":  # the controller tries to move it
        u = 1.0 + 2.0 * np.sin(20 * t)
        y = np.zeros(N)
    elif what == "falls":
        u, y = np.zeros(N), np.asarray(-50.0 * t**2)
    elif what == "turns back":  # thrown up, and at the highest point for a moment
        u, y = np.zeros(N), np.asarray(50 * t - 50.0 * t**2)
    elif what == "friction bears it":
        model = AxisModel(one_mass("angle"), {**MASS.nominal, "fc": 1.2}, ("kT", "fm"))
    elif what == "friction bears the rest":
        model, u = AxisModel(one_mass("angle"), {**MASS.nominal, "fc": 0.7}, ("kT", "fm")), np.where(u > 0.5, u, 0.4)
    elif what == "not measured":
        y = np.full(N, np.nan)
    else:  # it is set back every fifty milliseconds
        t_us = (T_US % 50_000).astype(np.int64)
    assert not held(model, u, y, t_us).any()


def test_a_measured_speed_tells_it_too() -> None:
    model = AxisModel(one_mass("speed"), MASS.nominal, ("kT", "fm"))
    u, _ = stopped()
    speed = np.where(np.arange(N) < STOPS, 3.0, 0.01)
    assert held(model, u, speed)[STOPS + 21 :].all()
    assert not held(model, u, np.where(np.arange(N) < STOPS, 3.0, 2.0)).any()


def test_a_weight_that_turns_with_the_angle_is_held_where_it_pulls() -> None:
    """The tests of friction and balance point are those of the pose."""
    model = AxisModel(chain(2, "angle"), values(2), ("kT",))
    gc, gs, tau0, fc = 0.8, 0.5, 0.1, 0.3 + 0.2  # at the motor
    for angle in np.linspace(0, 60, 25):
        pulls = abs(tau0 - (gc * np.cos(0.1 * angle) + gs * np.sin(0.1 * angle)))
        found = held(model, np.zeros(N), np.full(N, angle))
        if abs(pulls - fc) > 0.05:
            assert found[30:].all() == (pulls > fc)
            assert found.any() == (pulls > fc)


def test_where_nothing_pulls_no_brake_is_looked_for() -> None:
    light = AxisModel(one_mass("angle"), {**MASS.nominal, "tau0": 0.05}, ("kT", "fm"))
    assert not HoldingBrake(light).possible
    assert not Operating(light, Conditions()).needed
    assert Operating(MASS, Conditions()).needed


@given(cuts=st.lists(st.integers(0, N), max_size=5), seed=st.integers(0, 2**32 - 1))
def test_blocks_may_be_split_anywhere(cuts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = rng.choice([0.0, 0.0, 0.0, 0.05], N) * np.repeat(rng.integers(0, 2, 10), N // 10)
    u, y = np.repeat(rng.choice([0.0, 1.0], 10), N // 10), np.cumsum(steps)
    at_once, parts = Operating(MASS, Conditions()), Operating(MASS, Conditions())
    block = SampleBlock(T_US, u, y)
    gate = at_once.conditioned(block).gate
    ends = [0, *sorted(cuts), N]
    found = [parts.conditioned(block.select(slice(a, b))).gate for a, b in pairwise(ends)]
    assert gate is not None
    np.testing.assert_array_equal(np.concatenate([part for part in found if part is not None]), gate)
    assert parts.reason == at_once.reason


def test_the_reason_is_stated() -> None:
    u, y = stopped()
    operating = Operating(MASS, Conditions())
    operating.conditioned(SampleBlock(T_US, u, y))
    assert operating.reason == "held by its brake: it stands, and the motor does not bear its weight"
    more = SampleBlock(T_US + T_US[-1] + 5000, np.ones(N), np.full(N, y[-1]))
    operating.conditioned(more)
    assert operating.reason == ""


def with_brake(seed: int, seconds: float) -> SampleBlock:
    """An axis whose weight turns with the pose; its brake stops it for so long, and then it starts again."""
    first, second, n = moving(seed, 1.0), moving(seed + 1, 1.0), round(seconds / MOVING_S)
    rng = np.random.default_rng(seed)
    u, y = 0.02 * rng.standard_normal(n), 0.1 * rng.standard_normal(n)
    weights = (np.asarray(first.weight), np.full(n, 1.2), np.asarray(second.weight))
    t_us = np.arange(first.size + n + second.size, dtype=np.int64) * round(MOVING_S * 1e6)
    return SampleBlock(
        t_us,
        np.concatenate([first.u, u, second.u]),
        np.concatenate([first.y, y, second.y]),
        signals=np.concatenate(weights)[:, np.newaxis],
    )


def test_an_axis_that_its_brake_holds_raises_no_alarm(seed: int) -> None:
    """Without the look at the brake the predictor expects it to fall."""
    block = with_brake(seed, 20.0)
    follows = (NominalSchedule("tau0", Term.read("pose"), 1.0, 0.0),)
    conditioned = Operating(MODEL, Conditions(("pose",), weight=follows)).conditioned(block)
    assert AxisMonitor(MODEL, SETTINGS).update(conditioned) == []
    assert AxisMonitor(MODEL, SETTINGS).update(conditioned._replace(gate=None)) != []
