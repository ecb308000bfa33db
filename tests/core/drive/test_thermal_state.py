"""The heat of an axis without a thermometer: its equation, pauses, what is not known, and parameters that follow it."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from monitor_core.detection import MultiModelDetector, MultiModelThresholds
from monitor_core.drive import (
    HEAT,
    AxisModel,
    Conditions,
    Fast,
    NominalSchedule,
    Operating,
    Term,
    ThermalModel,
    Unwatched,
)
from monitor_core.excitation.reference_experiment import experiment
from monitor_core.modeling import INTERVAL_S, reference_model
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import MODEL_ERRORS, Settings

TURNING = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", "fm"))
MODEL = AxisModel(three_mass("angle"), REFERENCE_VALUES, ("kT", "fm"))
COLD = ThermalModel(600.0, 0.05, 0.4, 30.0, "cold")
UNKNOWN = ThermalModel(600.0, 0.05, 0.4, 30.0)
FRICTION = NominalSchedule("fm", Term.read(HEAT), -0.001, 10.0, 0.0, 30.0)
H_US = 100_000


def operating(thermal: ThermalModel, model: AxisModel = TURNING) -> Operating:
    return Operating(model, Conditions((), (FRICTION,), thermal=thermal))


def heat_of(axis: Operating, t_us: np.ndarray, y: np.ndarray) -> np.ndarray:
    block = axis.conditioned(SampleBlock(t_us, np.zeros(len(y)), y))
    assert block.signals is not None
    return np.asarray(block.signals[:, -1])


def warmed(heat: float, power: float, ends: tuple[float, float]) -> float:
    """The heat after the time between two ends, by a solver of differential equations."""
    run = solve_ivp(lambda _, x: (power - x) / COLD.tau_s, ends, [heat], rtol=1e-11, atol=1e-12)
    return float(run.y[0, -1])


def test_heat_is_the_exact_solution_for_a_power_that_is_held() -> None:
    rng = np.random.default_rng(1)
    t_us = np.cumsum(rng.integers(20_000, 600_000, 200))
    y = rng.normal(0, 15, 200)
    found = heat_of(operating(COLD), t_us, y)
    heat = 0.0
    for k in range(1, 200):
        power = 0.05 * y[k] ** 2 + 0.4 * abs(y[k])
        ends = t_us[k - 1] * 1e-6, t_us[k] * 1e-6
        heat = warmed(heat, power, ends)
        assert found[k] == pytest.approx(heat, rel=1e-8)


def test_one_wrong_angle_does_not_warm_the_axis() -> None:
    """A spike of 50 rad in one sample of 4 ms would be 7.8 MW of friction."""
    t_us, y = np.arange(2_000) * 4_000, np.linspace(0.0, 8.0, 2_000)
    usual = heat_of(operating(COLD, MODEL), t_us, y)[-1]
    y[1_000] += 50.0
    assert heat_of(operating(COLD, MODEL), t_us, y)[-1] - usual < 0.002 * COLD.largest


def test_a_lasting_motion_is_as_warm_as_its_friction_power() -> None:
    t_us = np.arange(60_000) * H_US  # ten time constants
    for axis, y in ((operating(COLD), np.full(t_us.size, 10.0)), (operating(COLD, MODEL), t_us * 1e-5)):
        assert heat_of(axis, t_us, y)[-1] == pytest.approx(9.0, rel=1e-3)


def test_a_pause_cools() -> None:
    axis = operating(COLD, MODEL)
    t_us = np.arange(6000) * H_US
    warm = heat_of(axis, t_us, t_us * 1e-5)[-1]
    pause_us = np.array([t_us[-1] + 300_000_000])
    assert heat_of(axis, pause_us, np.array([t_us[-1] * 1e-5]))[0] == pytest.approx(warm * math.exp(-0.5))
    assert axis.thermal is not None
    assert axis.thermal.known
    # One that cools half as fast would be warmer by so much.
    slower = warm * (math.exp(-0.25) - math.exp(-0.5))
    assert axis.thermal.sd == pytest.approx(slower)
    # So it is after a further pause: most of the doubt of the first one has gone with the heat.
    heat_of(axis, pause_us + 3_000_000_000, np.array([t_us[-1] * 1e-5]))
    more = warm * math.exp(-0.5) * (math.exp(-2.5) - math.exp(-5.0))
    assert axis.thermal.sd == pytest.approx(math.hypot(slower * math.exp(-5.0), more))


def test_many_short_pauses_doubt_less_than_a_long_one() -> None:
    """As there is motion in between; and the doubt of a heat that is not known hardly grows by them."""
    cold, unknown = operating(COLD), operating(UNKNOWN)
    t_us = np.cumsum(np.where(np.arange(600) % 2, 2_000_000, 100_000))
    for axis in (cold, unknown):
        heat_of(axis, t_us, np.full(t_us.size, 10.0))
    assert cold.thermal is not None
    assert unknown.thermal is not None
    assert 0 < cold.thermal.sd < 0.1
    alone = 15.0 * math.exp(-(t_us[-1] - t_us[0]) * 1e-6 / 600.0)
    assert alone < unknown.thermal.sd < 1.01 * alone
    assert unknown.thermal.since_us == t_us[0]


def test_two_parts_are_each_the_solution_of_their_time_constant() -> None:
    """In motion and in a pause; the heat is their weighted mean."""
    share, slow = 0.3, replace(COLD, fast=Fast(60.0, 0.3))
    both, alone = operating(slow), [operating(replace(COLD, tau_s=tau_s)) for tau_s in (600.0, 60.0)]
    t_us = np.cumsum(np.where(np.arange(3000) == 2500, 120_000_000, H_US))
    y = np.random.default_rng(2).normal(0, 10, t_us.size)
    parts = [heat_of(axis, t_us, y) for axis in alone]
    mean = (1 - share) * parts[0] + share * parts[1]
    np.testing.assert_allclose(heat_of(both, t_us, y), mean, rtol=1e-12)
    assert both.thermal is not None
    assert both.thermal.heat == pytest.approx(mean[-1])


def test_two_parts_are_saved_and_restored() -> None:
    model = replace(COLD, fast=Fast(60.0, 0.3))
    before, after, other = operating(model), operating(model), operating(COLD)
    t_us = np.arange(3000) * H_US
    y = np.full(t_us.size, 10.0)
    heat_of(before, t_us, y)
    saved = before.to_arrays()
    assert saved is not None
    after.from_arrays(saved)
    later_us = t_us[-1] + 60_000_000 + t_us
    np.testing.assert_array_equal(heat_of(before, later_us, y), heat_of(after, later_us, y))
    assert (before.thermal and before.thermal.sd) == (after.thermal and after.thermal.sd)
    with pytest.raises(ValueError, match="no state of a warm-up"):
        other.from_arrays(saved)


def test_what_is_observed_of_two_parts_leaves_none_below_zero() -> None:
    """Half a minute after a start at which nothing is known, the fast part has cooled more than the slow one."""
    thermal = operating(replace(UNKNOWN, fast=Fast(60.0, 0.3))).thermal
    assert thermal is not None
    for heat in (0.0, 2.0, 25.0, 99.0):
        thermal.parts = 14.0, 9.0
        thermal.observed(np.array([heat - thermal.heat, 0.0]), np.diag([1.0, 0.0]), known=True)
        assert min(thermal.parts) >= 0
        assert thermal.heat == pytest.approx(min(heat, UNKNOWN.largest))


def test_after_the_clock_was_set_the_heat_is_unknown() -> None:
    axis = operating(COLD, MODEL)
    t_us = np.arange(3000) * H_US
    heat_of(axis, t_us, t_us * 1e-5)
    thermal = axis.thermal
    assert thermal is not None
    assert (thermal.known, thermal.sd) == (True, 0.0)
    heat_of(axis, np.array([t_us[-1] - 100_000_000]), t_us[-1:] * 1e-5)
    assert (thermal.known, thermal.heat, thermal.sd) == (False, 15.0, 15.0)


@pytest.mark.parametrize("model", [COLD, replace(COLD, unwatched="unknown")], ids=["stood", "unknown"])
@pytest.mark.parametrize("restart", [False, True], ids=["silence", "restart"])
@pytest.mark.parametrize("pause_s", [2.0, 300.0, 30_000.0])
def test_an_axis_that_has_moved_in_a_pause_may_be_as_warm_as_it_can_become_in_it(
    model: ThermalModel, restart: bool, pause_s: float
) -> None:
    """From 9 W: between an axis that stood and one that worked at 30 W.  Two seconds change next to nothing."""
    axis = operating(model, MODEL)
    t_us = np.arange(60_000) * H_US
    warm = heat_of(axis, t_us, t_us * 1e-5)[-1]
    if restart:
        arrays = axis.to_arrays()
        assert arrays is not None
        axis = operating(model, MODEL)
        axis.from_arrays(arrays)
    (heat,) = heat_of(axis, t_us[-1:] + round(pause_s * 1e6), t_us[-1:] * 1e-5 + 1.5)
    thermal, a = axis.thermal, math.exp(-pause_s / COLD.tau_s)
    assert thermal is not None
    assert not thermal.known
    assert heat == pytest.approx(a * warm + (1 - a) * 15.0)
    assert thermal.sd == pytest.approx((1 - a) * 15.0)


def test_an_unknown_heat_is_forgotten_with_the_time_constant() -> None:
    axis, cold = operating(UNKNOWN), operating(COLD)
    t_us = np.arange(6000) * H_US
    y = np.full(t_us.size, 10.0)
    apart = heat_of(axis, t_us, y)[-1] - heat_of(cold, t_us, y)[-1]
    thermal = axis.thermal
    assert thermal is not None
    assert not thermal.known
    assert apart == pytest.approx(15.0 * math.exp(-599.9 / 600))
    assert thermal.sd == pytest.approx(15.0 * math.exp(-599.9 / 600))


def test_a_parameter_follows_the_heat_as_a_measured_signal() -> None:
    axis = operating(COLD)
    t_us = np.arange(6000) * H_US
    shift, gate = axis.take(t_us, np.full(t_us.size, 10.0), None)
    measured = Operating(TURNING, Conditions((HEAT,), (FRICTION,)))
    heat = heat_of(operating(COLD), t_us, np.full(t_us.size, 10.0))
    expected, _ = measured.take(t_us, np.full(t_us.size, 10.0), heat[:, np.newaxis])
    np.testing.assert_array_equal(shift, expected)
    assert gate.all()
    assert shift[0, 1] == pytest.approx(0.01)


def test_beyond_the_heat_of_the_records_nothing_is_known() -> None:
    axis = operating(COLD)
    t_us = np.arange(12_000) * H_US
    shift, _ = axis.take(t_us, np.full(t_us.size, 60.0), None)
    assert np.isnan(shift[-1, 1])
    assert axis.reason.startswith("heat = ")
    assert axis.reason.endswith(", beyond 0 to 30")


def test_with_a_wide_margin_friction_follows_beyond_the_records() -> None:
    """By the straight line; the part beyond the range is known apart."""
    wide = FRICTION._replace(margin=math.inf)
    axis = Operating(TURNING, Conditions((), (wide,), thermal=COLD))
    t_us = np.arange(12_000) * H_US
    shift, _ = axis.take(t_us, np.full(t_us.size, 60.0), None)
    assert axis.thermal is not None
    assert axis.thermal.heat > 100.0
    assert shift[-1, 1] == pytest.approx(-0.001 * (axis.thermal.heat - 10.0))
    assert axis.shift_beyond() == pytest.approx([0.0, -0.001 * (axis.thermal.heat - 30.0)])
    assert axis.far_beyond.endswith(", friction known from 0 to 30")
    axis.take(t_us[:1] + t_us[-1] + 3_600_000_000, np.zeros(1), None)
    assert axis.heat_range == (0.0, 30.0)
    assert not axis.shift_beyond().any()
    assert axis.far_beyond == ""


@pytest.mark.parametrize("unwatched", ["stood", "unknown"])
@pytest.mark.parametrize("pause_s", [3.0, 300.0, 30_000.0])
def test_what_it_did_while_nothing_was_received(unwatched: Unwatched, pause_s: float) -> None:
    """From 9 W, over a restart: it stood, or it may have worked at up to 30 W and come back."""
    model = ThermalModel(600.0, 0.05, 0.4, 30.0, "cold", unwatched)
    before, after = (operating(model, MODEL) for _ in range(2))
    t_us = np.arange(60_000) * H_US
    warm = heat_of(before, t_us, t_us * 1e-5)[-1]
    arrays = before.to_arrays()
    assert arrays is not None
    after.from_arrays(arrays)
    later_us = t_us[-1:] + round(pause_s * 1e6)
    (heat,) = heat_of(after, later_us, t_us[-1:] * 1e-5)
    a, thermal = math.exp(-pause_s / 600.0), after.thermal
    assert thermal is not None
    more = (1 - a) * 15.0 if unwatched == "unknown" else 0.0
    assert heat == pytest.approx(a * warm + more)
    slower = (math.sqrt(a) - a) * warm
    assert thermal.sd == pytest.approx(more if unwatched == "unknown" else slower)
    assert thermal.known == (unwatched == "stood")
    # A pause while it is received is one in which it stood.
    (last,) = heat_of(after, later_us + round(pause_s * 1e6), t_us[-1:] * 1e-5)
    assert last == pytest.approx(a * heat)


def test_what_the_model_lacks_stays_in_the_standard_deviation() -> None:
    axis = operating(ThermalModel(600.0, 0.05, 0.4, 30.0, error=2.0))
    t_us = np.arange(60_000) * H_US
    heat_of(axis, t_us[:1], np.zeros(1))
    assert axis.thermal is not None
    assert axis.thermal.sd == pytest.approx(math.hypot(15.0, 2.0))
    heat_of(axis, t_us[1:], np.full(t_us.size - 1, 10.0))
    assert axis.thermal.sd == pytest.approx(2.0, rel=1e-6)
    assert axis.thermal.sd_of_state < 0.001


@given(cuts=st.lists(st.integers(0, 60), max_size=4), seed=st.integers(0, 2**32 - 1), ambient=st.sampled_from([0, 8]))
def test_blocks_may_be_split_anywhere(cuts: list[int], seed: int, ambient: float) -> None:
    thermal = replace(UNKNOWN, ambient=ambient)
    rng = np.random.default_rng(seed)
    steps = rng.choice([0, 5000, 5001, 2_000_000, -3_000_000], 60, p=[0.05, 0.5, 0.35, 0.05, 0.05])
    t_us, y = np.cumsum(steps), np.cumsum(rng.normal(0, 0.5, 60))
    y[rng.random(60) < 0.1] = math.nan
    at_once, parts, saved = (operating(thermal, MODEL) for _ in range(3))
    expected = heat_of(at_once, t_us, y)
    found = []
    for a, b in pairwise([0, *sorted(cuts), 60]):
        found.append(heat_of(parts, t_us[a:b], y[a:b]))
        if (arrays := parts.to_arrays()) is not None:  # as over a restart
            saved = operating(thermal, MODEL)
            saved.from_arrays(arrays)
            parts = saved
    np.testing.assert_array_equal(np.concatenate(found), expected)
    assert at_once.thermal is not None
    assert parts.thermal is not None
    assert (parts.thermal.sd, parts.thermal.known) == (at_once.thermal.sd, at_once.thermal.known)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((0.0, 0.1, 0.1, 10.0), "tau_s = 0.0"),
        ((10.0, 0.0, 0.0, 10.0), "fm = 0.0, fc = 0.0"),
        ((10.0, -1.0, 2.0, 10.0), "fm = -1.0"),
        ((10.0, 0.1, 0.1, math.inf), "largest = inf"),
        ((10.0, 0.1, 0.1, 10.0, "cold", "stood", -1.0), "error = -1.0"),
    ],
)
def test_an_impossible_model_is_refused(values: tuple[Any, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ThermalModel(*values)


@pytest.mark.parametrize("heat", [np.zeros(4), np.array([-1.0, 0, 0, 0, 1]), np.full(5, math.nan)])
def test_a_damaged_state_is_refused(heat: np.ndarray) -> None:
    with pytest.raises(ValueError, match="no state of a warm-up"):
        operating(COLD).from_arrays({"heat": heat, "before": np.zeros(2)})


def test_a_friction_with_no_error_of_its_own_is_tested_all_the_same(seed: int) -> None:
    """Which kind of friction gets what no heat explains is chance; what got nothing would never be tested."""
    model = reference_model()
    settings = replace(Settings(interval_s=INTERVAL_S), model_error=(0.0, 2e-8, 0.013))
    monitor = AxisMonitor(model, settings, MultiModelDetector(model, settings, MultiModelThresholds(1e6)), "multimodel")
    monitor.update(SampleBlock(*experiment(seed, samples=4_000)))
    found = monitor.deviations()
    assert found is not None
    kT, other, fm = found.tolerated / model.scale
    assert fm == pytest.approx(MODEL_ERRORS * 0.013)
    assert other == pytest.approx(fm / math.sqrt(2))
    assert kT > 0
