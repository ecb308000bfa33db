"""The Kalman gain: against the recursion it is the limit of, and by the innovations it must leave white."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.kalman import filter_gain, gains_after, slowest_time_constant
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import NOISE, experiment
from monitor_core.kernel.tables import GAINS
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

H = 0.005


def limit_of_the_recursion(model: AxisModel, q: float, r: float, steps: int) -> tuple[np.ndarray, float]:
    """The covariance recursion of the book, run until it stands still."""
    A, B, C = model.matrices()
    n = len(A)
    exp = expm(H * np.block([[A, B[:, :1]], [np.zeros((1, n + 1))]]))
    Ad, b = exp[:n, :n], exp[:n, n:]
    P = b @ b.T * q**2
    for _ in range(steps):
        S = (C @ P @ C.T)[0, 0] + r**2
        K = P @ C.T / S
        P = Ad @ (P - K @ K.T * S) @ Ad.T + b @ b.T * q**2
        P = (P + P.T) / 2
    S = (C @ P @ C.T)[0, 0] + r**2
    return (P @ C.T / S)[:, 0], float(S)


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("torque_noise", [0.01, 0.1, 1.0])
def test_gain_is_the_limit_of_the_covariance_recursion(output: Output, torque_noise: float) -> None:
    model = reference_model(output)
    K, lam0 = filter_gain(model, H, torque_noise, NOISE[output])
    expected, S = limit_of_the_recursion(model, torque_noise, NOISE[output], 6000)
    scale = abs(expected).max()
    assert pytest.approx(expected, rel=1e-5, abs=1e-9 * scale) == K
    assert lam0 == pytest.approx(S, rel=1e-8)


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_innovations_are_white_and_of_variance_lambda_0(output: Output, seed: int) -> None:
    """A plant with torque noise, filtered by the monitor with its theta pinned."""
    rng = np.random.default_rng(seed)
    model, torque_noise, N = reference_model(output), 0.3, 20_000
    K, lam0 = filter_gain(model, H, torque_noise, NOISE[output])
    u = rng.standard_normal((N, 1))
    moved, _ = simulate_linear(model.drive, model.nominal, u + torque_noise * rng.standard_normal((N, 1)), H)
    y = moved + NOISE[output] * rng.standard_normal((N, 1))
    pinned = Settings.paper(H, K=tuple(K), lam0=lam0, P0=tuple(1e-60 * model.scale**2))
    monitor = AxisMonitor(model, pinned)
    _, trace = monitor.update_traced(SampleBlock(np.arange(N) * 5000, u[:, 0], y[:, 0]))
    eps = trace.eps[1000:] / np.sqrt(lam0)
    assert np.mean(eps**2) == pytest.approx(1, abs=5 * np.sqrt(2 / N))
    for lag in (1, 2, 5):
        assert abs(np.mean(eps[lag:] * eps[:-lag])) < 5 / np.sqrt(N)


def test_without_torque_noise_the_speed_needs_no_gain() -> None:
    K, lam0 = filter_gain(reference_model(), H, 0.0, 2.0)
    assert pytest.approx(np.zeros(5), abs=1e-12) == K
    assert lam0 == pytest.approx(4.0)


def test_only_the_ratio_of_the_noises_matters_to_the_gain() -> None:
    model = reference_model("angle")
    K, lam0 = filter_gain(model, H, 0.05, 1e-4)
    K10, lam010 = filter_gain(model, H, 0.5, 1e-3)
    assert pytest.approx(K, rel=1e-9) == K10
    assert lam010 == pytest.approx(100 * lam0)


@pytest.mark.parametrize(
    ("torque_noise", "output_noise"),
    [(-1.0, 1.0), (np.nan, 1.0), (np.inf, 1.0), (1.0, 0.0), (1.0, -1.0), (1.0, np.nan)],
)
def test_noises_that_make_no_sense(torque_noise: float, output_noise: float) -> None:
    with pytest.raises(
        ValueError, match=f"torque_noise = {torque_noise}, output_noise = {output_noise}: need"
    ):
        filter_gain(reference_model(), H, torque_noise, output_noise)


def test_angle_without_torque_noise_has_no_filter() -> None:
    with pytest.raises(
        ValueError, match=r"no stable Kalman filter for torque_noise = 0\.0 and output_noise = 0\.1"
    ):
        filter_gain(reference_model("angle"), H, 0.0, 0.1)


def test_time_constants_of_the_predictor() -> None:
    speed, angle = reference_model(), reference_model("angle")
    assert slowest_time_constant(speed, np.zeros(5), H) == pytest.approx(0.55, abs=0.01)
    assert slowest_time_constant(angle, np.zeros(6), H) == np.inf
    K, _ = filter_gain(angle, H, 0.01, NOISE["angle"])
    assert slowest_time_constant(angle, K, H) == pytest.approx(0.22, abs=0.01)
    assert slowest_time_constant(angle, -K, H) == np.inf


@pytest.mark.parametrize("torque_noise", [0.003, 0.01, 0.05])
def test_the_time_constant_is_how_an_error_of_the_state_dies_out(torque_noise: float) -> None:
    """Two predictors on one record from different first outputs: their difference swings and decays."""
    model = reference_model("angle")
    K, lam0 = filter_gain(model, H, torque_noise, NOISE["angle"])
    pinned = Settings.paper(H, K=tuple(K), lam0=lam0, P0=tuple(1e-60 * model.scale**2), settle_s=0.0)
    rec = experiment(1, output="angle")
    eps = []
    for first in (0.0, 1e3):
        y = rec.y.copy()
        y[0] += first
        eps.append(AxisMonitor(model, pinned).update_traced(SampleBlock(rec.t_us, rec.u, y))[1].eps)
    tau = slowest_time_constant(model, K, H) / H
    envelope = [np.nanmax(abs(eps[1] - eps[0])[round(k * tau) : round((k + 3) * tau)]) for k in (10, 20)]
    assert np.log(envelope[0] / envelope[1]) == pytest.approx(10, rel=0.15)


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_gains_after_missing_samples_are_those_of_the_covariance_recursion(output: Output) -> None:
    """From the steady state, without its corrections: 0, 2, 3 .. intervals, the one after one being the gain itself."""
    model = reference_model(output)
    noises = 0.3, NOISE[output]
    A, B, C = model.matrices()
    Ad, Bd = zero_order_hold(A, B[:, :1], H)
    K, lam0 = filter_gain(model, H, *noises)
    P = solve_discrete_lyapunov(
        Ad @ (np.eye(len(A)) - np.outer(K, C)),
        Bd @ Bd.T * noises[0] ** 2 + Ad @ np.outer(K, K) @ Ad.T * noises[1] ** 2,
    )
    assert (C @ P @ C.T)[0, 0] + noises[1] ** 2 == pytest.approx(lam0, rel=1e-6)
    P = P - np.outer(K, K) * lam0
    expected = []
    for _ in range(GAINS):
        expected.append((P @ C.T)[:, 0] / ((C @ P @ C.T)[0, 0] + noises[1] ** 2))
        P = Ad @ P @ Ad.T + Bd @ Bd.T * noises[0] ** 2
    assert expected[1] == pytest.approx(K, rel=1e-5, abs=1e-9 * abs(K).max())
    del expected[1]
    found = np.array(gains_after(model, H, *noises))
    assert found == pytest.approx(np.array(expected), rel=1e-4, abs=1e-7 * abs(K).max())
