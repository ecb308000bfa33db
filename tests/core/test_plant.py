"""The plant that tests and demo run against, its excitation, and the reference experiment."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import FAULT_AT, experiment, experiments, faulty
from monitor_core.modeling.simulated_axis import SimulatedAxis, simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, reference_model, three_mass


def simulate_speed(model: AxisModel, values: Mapping[str, float], u: Floats, interval_s: float) -> Floats:
    """Output of the model's drive from rest, for one torque record (N,) or many (N, W), without noise.

    Raises:
        ValueError: the drive's output is not the speed; there is Coulomb friction or gravity.
    """
    if model.drive.output != "speed":
        raise ValueError("the output of this drive is the angle: use simulate_linear")
    y, _ = simulate_linear(model.drive, values, u.reshape(len(u), -1), interval_s)
    return y.reshape(u.shape)


H = 0.005
FRICTION = {**REFERENCE_VALUES, "fc": 0.5, "tau0": 0.1}


def by_ode(values: dict[str, float], u: np.ndarray, speed_scale: float) -> np.ndarray:
    """Motor angle and speed after each interval, by an ODE solver; in balanced states."""
    model = AxisModel(three_mass("angle"), values, ())
    A, B, _ = model.matrices()
    d = model.balance()
    x, out = np.zeros(6), []
    for torque in u:

        def slope(_: float, w: np.ndarray, torque: float = torque) -> np.ndarray:
            inputs = np.array([torque, np.tanh(w[2] * d[2] / speed_scale), 1.0])
            return np.asarray((A @ (w * d) + B @ inputs) / d)

        w = solve_ivp(slope, (0, H), x / d, rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
        x = w * d
        out.append((x[5], x[2]))
    return np.array(out)


def test_linear_axis_is_exact(seed: int) -> None:
    u = np.random.default_rng(seed).standard_normal(100)
    values = {**REFERENCE_VALUES, "tau0": 0.1}
    axis = SimulatedAxis(values)
    motion = np.array([axis.step(torque, H) for torque in u])
    assert motion == pytest.approx(by_ode(values, u, 1.0), abs=1e-8)


def test_friction_converges_to_the_differential_equation(seed: int) -> None:
    u = 2 * np.random.default_rng(seed).standard_normal(100)
    exact = by_ode(FRICTION, u, 1.0)
    errors = []
    for substeps in (1, 5, 50):
        axis = SimulatedAxis(FRICTION, substeps=substeps)
        errors.append(np.abs([axis.step(torque, H) for torque in u] - exact).max(axis=0))
    assert (errors[1] < [0.02, 0.3]).all()  # of 0.5 rad and some 5 rad/s
    assert (errors[2] < errors[1] / 5).all()
    assert (errors[1] < errors[0] / 2).all()


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
    assert (simulate_speed(reference_model(), REFERENCE_VALUES, u, H) == whole).all()
    assert simulate_speed(reference_model(), REFERENCE_VALUES, u[:, 1], H) == pytest.approx(
        whole[:, 1], abs=1e-12
    )


def test_what_is_not_linear_or_not_a_speed_is_refused() -> None:
    u = np.zeros((3, 1))
    with pytest.raises(ValueError, match="Coulomb friction and gravity are not linear"):
        simulate_linear(three_mass("speed"), FRICTION, u, H)
    with pytest.raises(ValueError, match="output of this drive is the angle"):
        simulate_speed(reference_model("angle"), REFERENCE_VALUES, u, H)


def test_zero_order_hold_of_a_double_integrator() -> None:
    Ad, Bd = zero_order_hold(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [2.0]]), 0.5)
    assert pytest.approx(np.array([[1, 0.5], [0, 1]])) == Ad
    assert pytest.approx(np.array([[0.25], [1.0]])) == Bd


@pytest.mark.parametrize(
    ("N", "band"), [(2000, (0.0, 30.0)), (1999, (0.5, 20.0)), (400, (10.0, 10.0)), (64, (0.0, 1e9))]
)
def test_multisine(N: int, band: tuple[float, float], seed: int) -> None:
    u = multisine(np.random.default_rng(seed), N, H, band, 1.23)
    assert u.shape == (N,)
    assert np.sqrt(np.mean(u**2)) == pytest.approx(1.23, rel=1e-12)
    amplitude = abs(np.fft.rfft(u))
    frequency = np.fft.rfftfreq(N, H)
    inside = (frequency >= band[0] - 1e-9) & (frequency <= band[1] + 1e-9)
    inside[0] = False
    if N % 2 == 0:
        inside[-1] = False
    assert amplitude[inside] == pytest.approx(amplitude[inside].mean())
    assert abs(amplitude[~inside]).max() < 1e-9


def test_multisine_phases_are_uniform_and_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (multisine(rng, 2000, H, (0.0, 90.0), 1.0) for _ in range(2))
    assert abs(np.mean(first * second)) < 0.2
    phase = np.angle(np.fft.rfft(first)[1:901])
    # The mean of 900 unit vectors of uniform phase is longer than 0.15 once in a billion.
    assert abs(np.exp(1j * phase).mean()) < 0.15
    assert abs(np.exp(2j * phase).mean()) < 0.15


def test_multisine_without_a_line_is_refused(seed: int) -> None:
    with pytest.raises(ValueError, match=r"100 samples 0\.005 s apart have no line between 0\.1 and 1 Hz"):
        multisine(np.random.default_rng(seed), 100, H, (0.1, 1), 1.0)


def test_reference_experiment(seed: int) -> None:
    t_us, u, y = experiment(seed)
    assert (np.diff(t_us) == 5000).all()
    assert np.sqrt(np.mean(u**2)) == pytest.approx(1.23)
    assert 3.5 < np.std(y) < 4.7  # 4 rad/s and the noise
    noise = y - simulate_speed(reference_model(), REFERENCE_VALUES, u, INTERVAL_S)
    assert np.std(noise) == pytest.approx(1.0, abs=0.1)
    angle = experiment(seed, output="angle")
    assert (angle.u == u).all()
    assert np.std(np.diff(angle.y) / INTERVAL_S - y[:-1]) < 2.5
    assert [len(field) for field in experiment(seed, samples=400)] == [400] * 3


def test_columns_of_many_experiments_are_single_ones(seed: int) -> None:
    many = experiments([seed, seed + 1], {"fm": 1.2})
    for a in range(2):
        one = experiment(seed + a, {"fm": 1.2})
        assert (many.u[:, a] == one.u).all()
        assert many.y[:, a] == pytest.approx(one.y, abs=1e-12)


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
