"""Inputs that depend on the motion at a flange that is not the sensor's: gravity, and Coulomb friction of the arm."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Matrix, Output
from monitor_core.modeling.simulated_axis import SimulatedAxis, simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.alarm_versions import alarm_versions
from tests.core.cases import BY_NAME, Case, H, record
from tests.core.chains import Sensor, chain, values

SENSORS: tuple[Sensor, ...] = ("motor", "gear")
WHICH: tuple[Matrix, ...] = ("A", "B", "C", "rest")
OUTPUTS: tuple[Output, ...] = ("angle", "speed")


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_chain_of_three_masses_is_that_of_the_library(output: Output) -> None:
    names = {"J1": "Jm", "J2": "Jg", "J3": "Ja", "k1": "kg", "k2": "ka", "d1": "dg", "d2": "da", "f": "fm"}
    given = {**values(3, gravity=False), "fa": 0.0}
    library = {names.get(name, name): v for name, v in given.items() if name != "fa"}
    ours = AxisModel(chain(3, output, gravity=False), given, ())
    theirs = AxisModel(three_mass(output), library, ())
    for which in WHICH:
        found, expected = (m.drive.matrix(which, m.nominal) for m in (ours, theirs))
        assert pytest.approx(expected, rel=1e-14) == found[:, : expected.shape[1]], which


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


@pytest.mark.parametrize("sensor", SENSORS)
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
    assert (
        off({**values(2), **dict.fromkeys(("fc", "fa", "gc", "gs"), 0.0)}, 1) < 1e-8
    ).all()  # linear: exact


def test_the_plant_comes_to_rest_where_the_torque_bears_the_weight() -> None:
    given = {**values(2), "fc": 0.0, "fa": 0.0, "f": 0.1}
    axis = SimulatedAxis(given, drive=chain(2, "angle"))
    for _ in range(8000):
        angle, speed = axis.step(0.6, H)
    r = given["r"]
    weight = r * (given["gc"] * np.cos(r * angle) + given["gs"] * np.sin(r * angle))
    assert abs(r * angle) > 0.05
    assert abs(speed) < 1e-9
    assert weight == pytest.approx(0.6 + given["tau0"], rel=1e-9)


@pytest.mark.parametrize("name", ["fc", "fa", "gc", "gs"])
def test_a_linear_simulation_refuses_each_of_them(name: str, seed: int) -> None:
    drive, u = chain(2, "angle"), np.random.default_rng(seed).standard_normal((50, 1))
    linear = {**values(2), "fc": 0.0, "fa": 0.0, "gc": 0.0, "gs": 0.0}
    axis = SimulatedAxis(linear, drive=drive)
    moved = [0.0] + [axis.step(torque, H)[0] for torque in u[:, 0]]
    assert simulate_linear(drive, linear, u, H)[0][:, 0] == pytest.approx(moved[:-1], abs=1e-12)
    with pytest.raises(ValueError, match="Coulomb friction and gravity are not linear: use SimulatedAxis"):
        simulate_linear(drive, {**linear, name: 0.1}, u, H)


def scales(model: AxisModel, speed_scale: float) -> NDArray[np.float64]:
    return Assembly(model.drive, model.monitored).model_constants(model, speed_scale)["u_scale"]


def test_scales_lead_from_what_is_known_to_the_flange() -> None:
    """What is known is the measured motion, or the motor's speed in the state."""
    given = values(2)
    r = given["r"]
    no_gravity = values(2, gravity=False)
    for model, expected in (
        (AxisModel(chain(2, "angle"), given, ()), [0, 1 / 0.5, 0, r / 0.5, r, r]),
        (AxisModel(chain(2, "angle", "gear"), given, ()), [0, 1 / 0.5, 0, r / 0.5, 1, 1]),
        (AxisModel(chain(2, "speed", gravity=False), no_gravity, ()), [0, 1 / 0.5, 0, r / 0.5]),
        (AxisModel(chain(2, "speed", "gear", gravity=False), no_gravity, ()), [0, 1 / r / 0.5, 0, 1 / 0.5]),
        (AxisModel(three_mass("angle"), REFERENCE_VALUES, ()), [0, 1 / 0.5, 0]),
    ):
        assert scales(model, 0.5) == pytest.approx(expected, rel=1e-14)


def test_a_state_that_is_not_the_speed_at_the_sensor_is_refused() -> None:
    model = AxisModel(replace(chain(2, "angle"), speed_state=2), values(2), ("gc",))
    with pytest.raises(ValueError, match="Coulomb friction needs the speed at the sensor, which w2 is not"):
        AxisBatch([model], [BY_NAME["gravity"].settings()])


def test_gravity_follows_the_measured_angle_and_not_theta(seed: int) -> None:
    case = BY_NAME["gravity"]
    rec = record(seed, case, 300)
    monitor = AxisMonitor(case.model, case.settings())
    monitor.update(SampleBlock(*rec))
    st, angle = monitor.batch.state, case.values["r"] * rec.y[-1]
    assert st.u[4:, 0] == pytest.approx([np.cos(angle), np.sin(angle)], rel=1e-14)
    assert (st.du[:, 4:] == 0).all()
    assert (st.du[:, (1, 3)] != 0).all()


@pytest.mark.parametrize("output", OUTPUTS)
def test_the_estimates_do_not_depend_on_the_side_of_the_gear_that_is_measured(
    output: Output, seed: int
) -> None:
    """The same motion, behind the gear r times as large, its noise too: theta is the same, and so is its spread."""
    gravity, r = output == "angle", values(2)["r"]
    monitored = ("fa", "fc", "gs" if gravity else "1/J2")
    at_motor, at_gear = (
        Case(sensor, output, monitored, values(2, gravity), drive=lambda o, s=sensor: chain(2, o, s, gravity))  # type: ignore[misc]
        for sensor in SENSORS
    )
    rec = record(seed, at_motor, 600)
    own = at_motor.settings(alpha2=1e9)
    per_state = np.ones(len(at_motor.model.drive.states))
    if gravity:
        per_state[-1] = r  # the angle itself is a state
    gain = tuple(np.array(own.K) * per_state / r)
    theirs = replace(own, K=gain, lam0=own.lam0 * r**2, P0=tuple(np.array(own.P0) / r**2))
    near, far = AxisMonitor(at_motor.model, own), AxisMonitor(at_gear.model, theirs)
    near.update(SampleBlock(*rec))
    far.update(SampleBlock(*rec._replace(y=rec.y * r)))
    moved = near.batch.state.theta[:, 0] / near.model.theta0 - 1
    assert (abs(moved) > 1e-5).all()
    assert far.batch.state.theta[:, 0] == pytest.approx(near.batch.state.theta[:, 0], rel=1e-9)
    spread = [[p.standard_deviation for p in m.status().parameters] for m in (near, far)]
    assert spread[1] == pytest.approx(spread[0], rel=1e-9)


def test_a_heavier_load_is_found(seed: int) -> None:
    case = Case("load", "angle", ("gc", "gs", "f"), values(2), drive=lambda output: chain(2, output))
    rec = record(seed, case, 4000, true={**case.values, "gc": 1.2 * case.values["gc"]})
    monitor = AxisMonitor(case.model, case.settings(relative_sd=0.05, lam=0.999))
    alarms, _ = alarm_versions(monitor, SampleBlock(*rec))
    assert (alarms[0].parameter, alarms[0].direction) == ("gc", "up")
    gc = monitor.status().parameters[0]
    assert gc.estimate / gc.nominal == pytest.approx(1.2, abs=0.05)
