"""The ambient heat of an axis: how it varies while nothing shows it, and how the estimates correct both heats."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive import ThermalModel
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.thermal_state import AMBIENT_TAU_S, ThermalState
from monitor_core.monitoring.heat_observer import corrected
from monitor_core.monitoring.lane_status import Deviations

MODEL = ThermalModel(600.0, 0.05, 0.4, 30.0, "cold", ambient=8.0)
H_US = 100_000
HOUR = 36_000
"""Samples of an hour"""


class Turning:
    """An axis that turns at 10 rad/s."""

    def __init__(self, model: ThermalModel) -> None:
        self.state, self._speed, self.now_us = ThermalState(model), MeasuredSpeed("speed"), 0
        self.heats = np.zeros(0)

    def turn(self, samples: int) -> None:
        t_us = self.now_us + H_US * np.arange(samples, dtype=np.int64)
        self.heats = self.state.take(t_us, self._speed.take(t_us, np.full(samples, 10.0)))
        self.now_us = int(t_us[-1]) + H_US


def test_an_observed_ambient_heat_is_forgotten_with_its_time_constant() -> None:
    """The law of an Ornstein-Uhlenbeck process, in motion; in a pause its expectation decays, too."""
    axis = Turning(MODEL)
    state = axis.state
    axis.turn(1)
    state.observed(np.array([0.0, -6.0]), np.diag([0.0, 4.0]), known=True)
    axis.turn(HOUR)
    kept = math.exp(-3600.0 / AMBIENT_TAU_S)
    assert state.ambient == -6.0
    assert axis.heats[-1] == pytest.approx(state.model.mean(state.parts) - 6.0)
    assert state.covariance[1, 1] == pytest.approx(4.0 * kept**2 + 64.0 * (1 - kept**2), rel=1e-4)
    assert state.covariance[0, 0] < 0.01
    before = state.since_us
    axis.now_us += round(14 * 3600e6)
    axis.turn(2)
    night = math.exp(-14 * 3600.0 / AMBIENT_TAU_S)
    assert state.ambient == pytest.approx(-6.0 * night, rel=1e-4)
    assert state.covariance[1, 1] == pytest.approx(64.0, rel=0.05)
    assert state.since_us != before  # so that it is observed again


def test_friction_below_that_of_a_cold_axis_is_due_to_the_hall() -> None:
    axis = Turning(replace(MODEL, start="unknown"))
    axis.turn(1)
    assert axis.state.heat == 15.0
    axis.state.observed(np.array([-17.0, -4.0]), np.diag([1.0, 1.0]), known=True)
    assert axis.state.parts == (0.0,)
    assert axis.state.heat == axis.state.ambient == pytest.approx(-6.0)


def test_a_saved_state_goes_on_alike() -> None:
    axis = Turning(MODEL)
    axis.turn(100)
    axis.state.observed(np.array([0.5, -6.0]), np.array([[2.0, -1.0], [-1.0, 3.0]]), known=True)
    axis.turn(100)
    saved, other = axis.state.to_array(), copy.deepcopy(axis)
    other.state = ThermalState(MODEL)
    other.state.restore(saved)
    for each in (axis, other):
        each.turn(100)
    a, b = axis.state, other.state
    assert (a.heat, a.ambient, a.sd, a.known) == (b.heat, b.ambient, b.sd, True)
    for k in (0, 2, 4):
        damaged = saved.copy()
        damaged[k] = -1.0
        with pytest.raises(ValueError, match="no state of a warm-up"):
            b.restore(damaged)


def test_a_variance_below_zero_by_rounding_is_none() -> None:
    """A saved state with one would be refused."""
    axis = Turning(MODEL)
    axis.turn(1)
    axis.state.observed(np.zeros(2), np.array([[-1e-18, 0.0], [0.0, 2.0]]), known=True)
    other = ThermalState(MODEL)
    other.restore(axis.state.to_array())
    assert other.covariance.tolist() == [[0.0, 0.0], [0.0, 2.0]]


@given(seed=st.integers(0, 2**32 - 1))
def test_a_correction_is_that_of_a_kalman_filter(seed: int) -> None:
    """Oracle: the update of a Kalman filter with two states, in matrices."""
    rng = np.random.default_rng(seed)
    P, C = (a @ a.T + 0.1 * np.eye(len(a)) for a in (rng.normal(size=(2, 2)), rng.normal(size=(3, 3))))
    slopes, errors = rng.uniform(0.5, 2.0, 3), rng.uniform(0.1, 1.0, 3)
    H = np.outer(slopes, [1.0, 1.0])
    S = H @ P @ H.T + C + np.diag(errors**2)
    d = 0.5 * np.linalg.cholesky(S) @ rng.normal(size=3)
    gain = P @ H.T @ np.linalg.inv(S)
    if d @ np.linalg.solve(S, d) > 3.0**2 * 3:
        return
    found = corrected(P, slopes, Deviations(d, C, np.ones(3), errors))
    assert found is not None
    step, covariance = found
    np.testing.assert_allclose(step, gain @ d, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(covariance, P - gain @ H @ P, rtol=1e-7, atol=1e-9)
