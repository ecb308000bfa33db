"""Inputs held over an interval and K from the noise levels, and derivatives: by scipy, the monitor, differences."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm_frechet

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.kalman import held_disturbance, prediction_variance
from monitor_core.drive.structure import DISTURBANCE_TIME, Drive, Output
from monitor_core.excitation.reference_experiment import NOISE
from monitor_core.identification.predictor.held_drive import LinearDrive, Structure, hold, hold_late
from monitor_core.identification.predictor.noise import Levels, gain
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass

FREE = ("Jm", "1/Ja", "kg", "da", "r", "fc")
VALUES = {**REFERENCE_VALUES, "fc": 0.0, "tau0": -0.1}
DRIVES = [three_mass("speed"), three_mass("angle"), three_mass("angle").with_disturbance()]


def at(drive: Drive, free: tuple[str, ...] = FREE, given: dict[str, float] = VALUES) -> LinearDrive:
    complete = {**given, "Td": 0.7}
    kept = {p.name: complete[p.name] for p in drive.parameters}
    return Structure(drive, free, AxisModel(drive, kept, ()).balance()).at(kept)


@pytest.mark.parametrize("drive", DRIVES, ids=lambda d: f"{d.output}-{len(d.states)}")
def test_matrices_and_slopes_by_the_complex_step(drive: Drive) -> None:
    complete = {p.name: {**VALUES, "Td": 0.7}[p.name] for p in drive.parameters}
    d = AxisModel(drive, complete, ()).balance()
    linear = at(drive)
    unit: dict[str, Any] = {
        "A": d / d[:, None],
        "B": 1 / d[:, None],
        "C": d[None],
        "rest": 1 / d[:, None],
        "ratio": 1.0,
    }
    for which, value, slopes in zip(("A", "B", "C", "rest", "ratio"), linear[:5], linear[5:], strict=True):
        matrix = drive.matrix(which, complete) * unit[which]  # type: ignore[arg-type]
        np.testing.assert_allclose(value, matrix.reshape(value.shape), rtol=1e-14)
        for i, name in enumerate(FREE):
            moved: dict[str, complex] = dict(complete)
            base = name.removeprefix("1/")
            moved[base] = complete[base] + 1e-30j if base == name else 1 / (1 / complete[base] + 1e-30j)
            slope = np.imag(drive.matrix(which, moved)) / 1e-30 * unit[which]  # type: ignore[arg-type]
            np.testing.assert_allclose(slopes[..., i], slope.reshape(value.shape), rtol=1e-12, atol=0)


@pytest.mark.parametrize("drive", DRIVES, ids=lambda d: f"{d.output}-{len(d.states)}")
@pytest.mark.parametrize("interval_s", [1e-4, 0.005, 0.05, 0.7])
def test_exponentials_and_their_derivatives_are_those_of_scipy(drive: Drive, interval_s: float) -> None:
    linear = at(drive)
    n, m = linear.B.shape
    X, dX = hold(linear, np.array([0.001, interval_s]))
    Ad, Bd = zero_order_hold(linear.A, linear.B, interval_s)
    np.testing.assert_allclose(X[1], np.hstack([Ad, Bd]), rtol=0, atol=1e-12 * abs(X[1]).max())
    F = np.zeros((n + m, n + m))
    F[:n, :n], F[:n, n:] = linear.A, linear.B
    for i in range(len(FREE)):
        E = np.zeros_like(F)
        E[:n, :n], E[:n, n:] = linear.dA[..., i], linear.dB[..., i]
        L = np.real(expm_frechet(F * interval_s, E * interval_s)[1])[:n]
        np.testing.assert_allclose(dX[1, i], L, rtol=0, atol=1e-11 * abs(L).max())


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-5, 0.05), st.floats(1e-5, 0.05))
def test_two_intervals_are_one(first: float, second: float) -> None:
    linear = at(DRIVES[0])
    n = len(linear.A)
    X, _ = hold(linear, np.array([first, second, first + second]))
    A1, A2 = X[0, :, :n], X[1, :, :n]
    np.testing.assert_allclose(A2 @ A1, X[2, :, :n], atol=1e-12 * abs(X[2]).max())
    np.testing.assert_allclose(A2 @ X[0, :, n:] + X[1, :, n:], X[2, :, n:], atol=1e-12 * abs(X[2]).max())


@pytest.mark.parametrize("delay_s", [0.0, 0.0013, 0.0049])
def test_delayed_torque_is_two_pieces(delay_s: float) -> None:
    """By a plain product of the two pieces; the derivative by central differences."""
    drive = three_mass("angle")
    linear, torque, h = at(drive), np.array([k == TORQUE for k in drive.inputs]), 0.005
    n, m = linear.B.shape
    X, dX = hold_late(linear, torque, np.array([h]), delay_s)
    A1, B1 = zero_order_hold(linear.A, linear.B, delay_s)
    A2, B2 = zero_order_hold(linear.A, linear.B, h - delay_s)
    rng = np.random.default_rng(0)
    x, u, before = rng.standard_normal(n), rng.standard_normal(m), 1.7
    first = A1 @ x + B1 @ np.where(torque, before, u)
    expected = A2 @ first + B2 @ u
    got = X[0] @ np.concatenate([x, u, [before]])
    np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-13 * abs(expected).max())
    step = 1e-5
    ends = [
        hold_late(linear, torque, np.array([h]), abs(delay_s) + s).X[0]
        for s in ((0, step, 2 * step) if delay_s == 0 else (-step, 0, step))
    ]
    slope = (4 * ends[1] - 3 * ends[0] - ends[2]) / (2 * step) if delay_s == 0 else (ends[2] - ends[0]) / (2 * step)
    np.testing.assert_allclose(dX[0, -1], slope, atol=1e-5 * abs(slope).max())


def test_a_delay_beyond_the_interval_ends_with_it() -> None:
    drive = three_mass("speed")
    linear, torque = at(drive), np.array([k == TORQUE for k in drive.inputs])
    X, dX = hold_late(linear, torque, np.array([0.002, 0.005]), 0.003)
    n, m = linear.B.shape
    assert (X[0, :, n : n + m][:, torque] == 0).all()
    assert (dX[0, -1] == 0).all()
    assert (dX[1, -1] != 0).any()


# --- K from the noise levels, its derivatives, and the disturbance as a state of the drive ----------------------------


H = 0.005
NOISY = ("Jm", "1/Ja", "kg", "r", DISTURBANCE_TIME)
DISTURBED = {**REFERENCE_VALUES, DISTURBANCE_TIME: 0.3}


def gain_at(output: Output, theta: Floats, torque: float, slow: float) -> tuple[Floats, Floats, float, Floats]:
    """K and dK in the drive's states."""
    drive = three_mass(output).with_disturbance()
    values = dict(DISTURBED)
    for name, value in zip(NOISY, theta, strict=True):
        base = name.removeprefix("1/")
        values[base] = value if base == name else 1 / value
    d = AxisModel(drive, DISTURBED, ()).balance()
    linear = Structure(drive, NOISY, d).at(values)
    found = gain(
        linear,
        np.array([kind == TORQUE for kind in drive.inputs]),
        Levels(torque, slow, values[DISTURBANCE_TIME], H, float(d[-1])),
        ("torque", "slow"),
        NOISY.index(DISTURBANCE_TIME),
    )
    return found.K * d, found.dK * d[:, None], found.S, d


THETA = np.array([DISTURBED[n] if n in DISTURBED else 1 / DISTURBED[n.removeprefix("1/")] for n in NOISY])


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("torque", [0.01, 0.3])
@pytest.mark.parametrize("slow", [0.02, 1.0])
def test_gain_is_that_of_the_kalman_filter(output: Output, torque: float, slow: float) -> None:
    """Of the drive with white noise on its torque, and white noise that drives the disturbance."""
    model = AxisModel(three_mass(output).with_disturbance(), DISTURBED, ())
    A, B, C = model.matrices()
    d, sd, n = model.balance(), NOISE[output], len(model.drive.states)
    driven = slow * held_disturbance(H, DISTURBED[DISTURBANCE_TIME]) * np.eye(n)[:, -1:]
    enters = np.hstack([torque * B[:, model.drive.of_torque], driven]) / sd
    Ad, G = zero_order_hold(A / d[:, None] * d, enters / d[:, None], H)
    c = C[0] * d
    P = prediction_variance(Ad, c, G @ G.T)
    K = d * (P @ c) / (c @ P @ c + 1)
    found, _, S, _ = gain_at(output, THETA, torque / sd, slow / sd)
    np.testing.assert_allclose(found, K, rtol=1e-6, atol=1e-9 * abs(K).max())
    assert pytest.approx(c @ P @ c + 1, rel=1e-9) == S


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_derivatives_of_the_gain(output: Output) -> None:
    sd = NOISE[output]
    at = np.concatenate([THETA, [0.1 / sd, 0.5 / sd]])

    def K(numbers: Floats) -> Floats:
        return gain_at(output, numbers[:-2], numbers[-2], numbers[-1])[0]

    _, dK, _, _ = gain_at(output, THETA, at[-2], at[-1])
    for i, value in enumerate(at):
        h = 1e-4 * value * np.eye(len(at))[i]
        slope = (8 * (K(at + h) - K(at - h)) - K(at + 2 * h) + K(at - 2 * h)) / (12 * h[i])
        size = abs(slope).max(initial=1e-300)
        np.testing.assert_allclose(dK[:, i] / size, slope / size, atol=3e-6, rtol=1e-3)
        assert size * value > 1e-6 * abs(K(at)).max()
