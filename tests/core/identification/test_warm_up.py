"""The search for a warm-up in records: what it finds, and what it leaves alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.drive.thermal_state import MOVED
from monitor_core.identification import IdentificationOptions, identify
from monitor_core.identification.greybox import Estimate, fit
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal.warm_up import LEAST_MOTION_S, find_warm_up, moving_s, with_heat
from monitor_core.modeling.standard_drives import three_mass
from tests.core.mismatch_monitor import FOUND
from tests.core.warming import Warming, WarmingPlant

STEADY = Warming(fm=0.0, fc=0.0, stribeck=0.0)
QUICK = Warming(fast_s=60.0, slow_s=150.0)
RISING = replace(QUICK, fm=-0.2, fc=-0.1, stribeck=0.0)
FOLLOWERS = ("fm", "fc")


def recorded(seed: int, warming: Warming, seconds: float = 300.0) -> tuple[Record, Estimate]:
    """A record from cold on, and the fit with constant friction."""
    block = WarmingPlant(np.random.default_rng(seed), warming=warming).take(seconds)
    record = Record(np.asarray(block.t_us * 1e-6, np.float64), block.u, block.y, "angle", "cold")
    return record, fit(Problem(three_mass("angle"), FOUND, FOLLOWERS), [record], most_iterations=15)


def test_friction_that_falls_is_found_with_its_time_constant(seed: int) -> None:
    record, constant = recorded(seed, QUICK)
    found = find_warm_up(constant, [record], FOLLOWERS)
    assert found is not None
    assert QUICK.fast_s / 2 < found.model.tau_s < QUICK.slow_s
    assert found.starts == ((0.0,),)
    slope, sd = found.slopes["fm"]
    assert slope < -4 * sd
    heat = with_heat(record, found.model, found.starts[0]).signals["heat"]
    assert heat.max() == pytest.approx(found.model.largest)
    # Five minutes are too short to judge the law.
    assert not found.judged
    half = {name: abs(slope) * found.model.largest / 2 for name, (slope, _) in found.slopes.items()}
    assert found.errors == pytest.approx(half)


def test_heat_goes_on_through_a_moment_in_which_nothing_was_received(seed: int) -> None:
    record, _ = recorded(seed, QUICK)
    parts = [record.select(record.t < 150.0), record.select(record.t > 150.45)]
    assert abs(parts[1].y[0] - parts[0].y[-1]) > MOVED  # a longer pause would leave the heat unknown
    constant = fit(Problem(three_mass("angle"), FOUND, FOLLOWERS), parts, most_iterations=15)
    found = find_warm_up(constant, parts, FOLLOWERS, begins_s=[part.t[0] for part in parts])
    assert found is not None
    before = with_heat(parts[0], found.model, found.starts[0]).signals["heat"][-1]
    away_s = float(parts[1].t[0] - parts[0].t[-1])
    assert sum(found.starts[1]) == pytest.approx(before * found.model.kept(away_s), rel=1e-3)
    assert QUICK.fast_s / 2 < found.model.tau_s < QUICK.slow_s


def test_friction_that_is_steady_follows_nothing(seed: int) -> None:
    record, constant = recorded(seed, STEADY)
    assert moving_s([record]) > LEAST_MOTION_S
    assert find_warm_up(constant, [record], FOLLOWERS) is None


def test_friction_that_rises_is_no_warm_up(seed: int) -> None:
    record, constant = recorded(seed, RISING)
    assert find_warm_up(constant, [record], FOLLOWERS) is None


def test_what_stands_does_not_count_as_motion() -> None:
    t = np.arange(0.0, 200.0, 0.1)
    y = np.where(t < 100.0, 3.0 * t, 300.0)
    record = Record(t, np.zeros(t.size), y, "angle")
    assert moving_s([record]) == pytest.approx(100.0, abs=0.5)
    assert moving_s([record, replace(record, name="again")]) == pytest.approx(200.0, abs=1.0)


def test_an_angle_that_never_changes_shows_no_warm_up() -> None:
    """It is explained in every digit, so there are no errors to learn from; and nothing is identified."""
    t = np.arange(0.0, 15.0, 0.005)
    record = Record(t, np.sin(t), np.ones(t.size), "angle")
    options = IdentificationOptions("values", monitored=FOLLOWERS, thermal="cold", begins_s=(0.0,))
    found = identify(Problem(three_mass("angle"), FOUND, FOLLOWERS), [record], options=options)
    assert found.warm_up is None
    assert found.rejection
