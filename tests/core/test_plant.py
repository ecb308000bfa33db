"""The plant that tests and demo run against, its excitation, and the reference experiment."""

import numpy as np
import pytest

from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import FAULT_AT, experiment, faulty
from monitor_core.modeling.simulated_axis import SimulatedAxis, simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass

H = 0.005
FRICTION = {**REFERENCE_VALUES, "fc": 0.5, "tau0": 0.1}


def test_steady_speed_and_sticking() -> None:
    axis = SimulatedAxis(FRICTION, speed_scale=0.1)
    for _ in range(2000):
        _, speed = axis.step(1.0, H)
    assert speed == pytest.approx((1.0 - 0.5 + 0.1) / 0.06, rel=1e-3)
    for _ in range(2000):
        _, speed = axis.step(0.2, H)  # less than friction: it only creeps
    assert 0 < speed < 0.1


def test_parameters_change_and_the_motion_goes_on() -> None:
    axis = SimulatedAxis(REFERENCE_VALUES)
    for _ in range(100):
        before = axis.step(1.0, H)
    axis.set({"fm": 0.12})
    assert (axis.angle, axis.speed) == before
    assert axis.values == {**REFERENCE_VALUES, "fm": 0.12}
    for _ in range(2000):
        _, speed = axis.step(1.0, H)
    assert speed == pytest.approx(1 / 0.12, rel=1e-3)


def test_wrong_parameters_leave_the_axis_as_it_was() -> None:
    axis = SimulatedAxis(REFERENCE_VALUES)
    with pytest.raises(KeyError, match="Jx"):
        axis.set({"Jx": 1.0})
    with pytest.raises(ValueError, match=r"nominal Jm = 0\.0"):
        axis.set({"Jm": 0.0})
    assert axis.values == dict(REFERENCE_VALUES)
    with pytest.raises(ValueError, match="0 substeps"):
        SimulatedAxis(REFERENCE_VALUES, substeps=0)


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_many_records_side_by_side_are_those_of_single_axes(output: Output, seed: int) -> None:
    u = np.random.default_rng(seed).standard_normal((50, 3))
    values = {**REFERENCE_VALUES, "tau0": 0.1}
    y, end = simulate_linear(three_mass(output), values, u, H)
    for a in range(3):
        axis = SimulatedAxis(values)
        motion = [(0.0, 0.0)] + [axis.step(torque, H) for torque in u[:, a]]
        expected = [angle if output == "angle" else speed for angle, speed in motion]
        assert y[:, a] == pytest.approx(expected[:-1], abs=1e-12)
        assert end[2, a] == pytest.approx(axis.speed, abs=1e-12)


def test_a_run_can_be_continued(seed: int) -> None:
    """Wherever the cut: the blocks of steps then lie elsewhere, and rounding differs."""
    u = np.random.default_rng(seed).standard_normal((160, 2))
    drive = three_mass("speed")
    whole, end = simulate_linear(drive, REFERENCE_VALUES, u, H)
    first, x = simulate_linear(drive, REFERENCE_VALUES, u[:25], H)
    second, last = simulate_linear(drive, REFERENCE_VALUES, u[25:], H, x)
    assert np.concatenate([first, second]) == pytest.approx(whole, rel=1e-9, abs=1e-12)
    assert last == pytest.approx(end, rel=1e-9, abs=1e-15)


def test_zero_order_hold_of_a_double_integrator() -> None:
    Ad, Bd = zero_order_hold(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [2.0]]), 0.5)
    assert pytest.approx(np.array([[1, 0.5], [0, 1]])) == Ad
    assert pytest.approx(np.array([[0.25], [1.0]])) == Bd


def test_reference_experiment(seed: int) -> None:
    t_us, u, y = experiment(seed)
    assert (np.diff(t_us) == 5000).all()
    assert np.sqrt(np.mean(u**2)) == pytest.approx(1.23)
    assert 3.5 < np.std(y) < 4.7  # 4 rad/s and the noise
    quiet, _ = simulate_linear(three_mass("speed"), REFERENCE_VALUES, u[:, np.newaxis], INTERVAL_S)
    assert np.std(y - quiet[:, 0]) == pytest.approx(1.0, abs=0.1)
    angle = experiment(seed, output="angle")
    assert (angle.u == u).all()
    assert np.std(np.diff(angle.y) / INTERVAL_S - y[:-1]) < 2.5
    assert [len(field) for field in experiment(seed, samples=400)] == [400] * 3


def test_the_fault_comes_in_the_middle(seed: int) -> None:
    healthy, ill = experiment(seed), experiment(seed, {"kT": 1.2})
    assert (ill.u == healthy.u).all()
    assert (ill.y[: FAULT_AT + 1] == healthy.y[: FAULT_AT + 1]).all()
    assert (ill.y[FAULT_AT + 1 :] != healthy.y[FAULT_AT + 1 :]).all()
    assert (experiment(seed, noise=0.0).y[0] == 0.0).all()


def test_faults_by_factor() -> None:
    assert faulty({"Ja": 6.0, "fm": 1.0}, {"1/Ja": 1.2, "fm": 0.5}) == pytest.approx({"Ja": 5.0, "fm": 0.5})
    with pytest.raises(KeyError, match="Jx"):
        faulty({"Ja": 6.0}, {"Jx": 1.2})
