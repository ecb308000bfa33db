"""The plant that tests and demo run against, its excitation, and the reference experiment.

Also of inputs that depend on the motion at a flange that is not the sensor's: gravity, Coulomb friction of the arm.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import FAULT_AT, experiment, faulty
from monitor_core.modeling.simulated_axis import SimulatedAxis, simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisBatch
from tests.core.cases import BY_NAME, H
from tests.core.chains import Sensor, chain, values


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
    given = {**REFERENCE_VALUES, "tau0": 0.1}
    y, end = simulate_linear(three_mass(output), given, u, H)
    for a in range(3):
        axis = SimulatedAxis(given)
        motion = [(0.0, 0.0)] + [axis.step(torque, H) for torque in u[:, a]]
        expected = [angle if output == "angle" else speed for angle, speed in motion]
        assert y[:, a] == pytest.approx(expected[:-1], abs=1e-12)
        assert end[2, a] == pytest.approx(axis.speed, abs=1e-12)


def test_a_run_can_be_continued(seed: int) -> None:
    """Wherever the cut: the blocks of steps then lie elsewhere, and rounding differs."""
    u = np.random.default_rng(seed).standard_normal((160, 2))
    drive = three_mass("speed")
    at_once, end = simulate_linear(drive, REFERENCE_VALUES, u, H)
    first, x = simulate_linear(drive, REFERENCE_VALUES, u[:25], H)
    second, last = simulate_linear(drive, REFERENCE_VALUES, u[25:], H, x)
    assert np.concatenate([first, second]) == pytest.approx(at_once, rel=1e-9, abs=1e-12)
    assert last == pytest.approx(end, rel=1e-9, abs=1e-15)


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


def by_ode(given: dict[str, float], u: NDArray[np.float64], speed_scale: float) -> NDArray[np.float64]:
    """Motor angle and speed of a chain of two masses after each interval: Newton's law for each, by an ODE solver."""
    v, w, out = given, np.zeros(4), []
    for torque in u:

        def slope(_: float, w: NDArray[np.float64], torque: float = torque) -> list[float]:
            motor, arm, motor_speed, arm_speed = w
            spring = v["k1"] * (v["r"] * motor - arm) + v["d1"] * (v["r"] * motor_speed - arm_speed)
            # Of the arm's own motion there is only what the motor tells; weight and friction take it to be rigid.
            weight = v["gc"] * np.cos(v["r"] * motor) + v["gs"] * np.sin(v["r"] * motor)
            arm_friction = v["fa"] * np.tanh(v["r"] * motor_speed / speed_scale)
            friction = v["f"] * motor_speed + v["fc"] * np.tanh(motor_speed / speed_scale)
            on_motor = v["kT"] * torque + v["tau0"] - friction - v["r"] * spring
            return [motor_speed, arm_speed, on_motor / v["J1"], (spring - arm_friction - weight) / v["J2"]]

        w = solve_ivp(slope, (0, H), w, rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
        out.append((w[0], w[2]))
    return np.array(out)


@pytest.mark.parametrize("sensor", ["motor", "gear"])
def test_the_plant_converges_to_newtons_law(sensor: Sensor, seed: int) -> None:
    u = 3 * np.random.default_rng(seed).standard_normal(100)

    def off(given: dict[str, float], substeps: int) -> NDArray[np.float64]:
        axis, exact = SimulatedAxis(given, 0.5, substeps, chain(2, "angle", sensor)), by_ode(given, u, 0.5)
        motion = np.array([axis.step(torque, H) for torque in u]) / (given["r"] if sensor == "gear" else 1.0)
        return np.asarray(np.abs(motion - exact).max(axis=0) / np.abs(exact).max(axis=0))

    errors = [off(values(2), substeps) for substeps in (1, 5, 50)]
    assert (errors[1] < 0.1).all()
    assert (errors[1] < errors[0] / 2).all()
    assert (errors[2] < errors[1] / 5).all()
    linear = {**values(2), **dict.fromkeys(("fc", "fa", "gc", "gs"), 0.0)}
    assert (off(linear, 1) < 1e-8).all()


@pytest.mark.parametrize("name", ["fc", "fa", "gc", "gs"])
def test_a_linear_simulation_refuses_each_of_them(name: str, seed: int) -> None:
    drive, u = chain(2, "angle"), np.random.default_rng(seed).standard_normal((50, 1))
    linear = {**values(2), "fc": 0.0, "fa": 0.0, "gc": 0.0, "gs": 0.0}
    axis = SimulatedAxis(linear, drive=drive)
    moved = [0.0] + [axis.step(torque, H)[0] for torque in u[:, 0]]
    assert simulate_linear(drive, linear, u, H)[0][:, 0] == pytest.approx(moved[:-1], abs=1e-12)
    with pytest.raises(ValueError, match="Coulomb friction and gravity are not linear: use SimulatedAxis"):
        simulate_linear(drive, {**linear, name: 0.1}, u, H)


def test_a_state_that_is_not_the_speed_at_the_sensor_is_refused() -> None:
    model = AxisModel(replace(chain(2, "angle"), speed_state=2), values(2), ("gc",))
    with pytest.raises(ValueError, match="needs the speed at the sensor, which mass2"):
        AxisBatch([model], [BY_NAME["gravity"].settings()])
