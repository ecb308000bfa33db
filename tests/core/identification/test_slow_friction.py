"""Motion that is left out because friction falls with the speed there."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification import IdentificationOptions, Problem, identify
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.slow_friction import slow_friction_speed
from monitor_core.identification.torque_balance.torque_windows import SIGNAL
from tests.core.chains import one_mass
from tests.core.identification.record_cases import H, picks

STRIBECK = 3.0
"""Stribeck speed of ``picks`` [rad/s]"""


def weighed(record: Record, seed: int) -> Record:
    """The record with the torque of links that other axes move, known as the signal of the links."""
    rng = np.random.default_rng(seed)
    weight = 3.0 * np.cos(2 * np.pi * rng.uniform(0.05, 0.15) * record.t + rng.uniform(0, 6))
    return replace(record, u=record.u + weight, signals={SIGNAL: weight})


@pytest.mark.parametrize("stiction", [0.15, 0.25])
def test_motion_is_left_out_in_which_friction_falls_with_the_speed(stiction: float, seed: int) -> None:
    """Up to where little of that is left: one and a half times the Stribeck speed, by steps of that of a half."""
    for number in range(seed, seed + 6):
        record = picks(number, stiction)
        assert STRIBECK < slow_friction_speed([record]) < 3 * STRIBECK
        assert STRIBECK < slow_friction_speed([weighed(record, number)]) < 3 * STRIBECK


def test_friction_as_the_drives_have_it_leaves_nothing_out(seed: int) -> None:
    assert [slow_friction_speed([picks(number)]) for number in range(seed, seed + 6)] == [0.0] * 6


def test_friction_that_grows_as_an_axis_slows_down_less_than_linearly_is_not_left_out(seed: int) -> None:
    """As by a lubricant film that shears: the term of Stribeck would have to be negative."""
    assert slow_friction_speed([picks(seed, -0.15)]) == 0.0


def test_a_short_or_slow_record_keeps_its_motion(seed: int) -> None:
    """Too few equations tell a difference; or too little motion would remain."""
    record = picks(seed, 0.25)
    assert slow_friction_speed([picks(seed, 0.25, moves=2)]) == 0.0
    still = replace(record, y=np.zeros(len(record)))
    assert slow_friction_speed([still]) == 0.0
    rng = np.random.default_rng(seed)
    t: Floats = H * np.arange(40_000, dtype=np.float64)
    wave, fast = np.sin(2 * np.pi * 0.3 * t), np.sin(2 * np.pi * 0.05 * t) > 0.9
    speed = wave * (1.0 + 12.0 * fast)
    friction = (0.5 + 0.3 * np.exp(-((speed / 1.5) ** 2))) * np.tanh(speed / 0.05)
    u = 2e-3 * np.gradient(speed, H) + 5e-3 * speed + friction
    mostly_slow = Record(t, u + rng.normal(0, 0.01, t.size), np.cumsum(speed) * H, "angle")
    assert slow_friction_speed([mostly_slow]) == 0.0


def test_without_the_slow_motion_viscous_friction_is_right(seed: int) -> None:
    record = picks(seed, 0.25)
    start = {"J": 3e-3, "fm": 3e-3, "fc": 0.3, "tau0": 0.0, "kT": 1.0}
    problem = Problem(one_mass("angle"), start, ("J", "fm", "fc", "tau0"), speed_scale=0.5)
    options = IdentificationOptions("values", speed_scales=speed_scales([record]))
    found = identify(problem, [record], options=options)
    assert found.slow_left_out > STRIBECK
    assert found.estimate.values["fm"] == pytest.approx(5e-3, rel=0.05)
    assert found.estimate.values["fc"] == pytest.approx(0.5, rel=0.05)
    all_of_it = identify(replace(problem, min_speed=0.1), [record], options=options)
    assert all_of_it.slow_left_out == pytest.approx(0.1)
    assert all_of_it.estimate.values["fm"] < 0.9 * 5e-3
