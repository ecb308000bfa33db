"""Angle and speed, taken one after the other, are one filter with two outputs: of textbooks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.kalman import filter_gain, gains_of_both, slowest_time_constant
from monitor_core.drive.stability import _radii, stable_limits
from monitor_core.monitoring.axis_monitor import AxisMonitor
from tests.core.both.axes import ANGLE, CASES, SPEED, TORQUE, Samples, part, samples
from tests.core.cases import H
from tests.core.oracle.paper import Paper


def textbook(model: AxisModel, rec: Samples, torque: float, R: NDArray[np.float64]) -> NDArray[np.float64]:
    """One-step predictions (N, 2) of the Kalman filter with both outputs at once, its covariance run to the end."""
    A, B, _ = model.matrices()
    C = np.vstack([model.drive.matrix("C", model.nominal), model.drive.matrix("C2", model.nominal)])
    Ad, Bd = zero_order_hold(A, B, H)
    b = Bd[:, [0]]
    P = np.eye(len(A))
    for _ in range(4000):
        P = Ad @ (P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P)) @ Ad.T + torque**2 * b @ b.T
    K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    x, out = np.zeros(len(A)), []
    for u, y, y2 in zip(rec.u, rec.y, rec.y2, strict=True):
        out.append(C @ x)
        x = Ad @ (x + K @ (np.array([y, y2]) - C @ x)) + b[:, 0] * u
    return np.array(out)


def test_one_after_the_other_is_both_at_once(seed: int) -> None:
    """With theta pinned the predictions are those of the textbook's filter, once the beginning is forgotten."""
    case = CASES[0]
    rec = samples(seed, case, 2000, missing=0.0, jitter=0.0)
    expected = textbook(case.model, rec, TORQUE, np.diag([ANGLE**2, SPEED**2]))
    s = case.settings(settle_s=0.0, P0=tuple(1e-40 * case.model.scale**2))
    _, trace = AxisMonitor.alone(case.model, s).run_traced(*rec[:3], y2=rec.y2)
    predicted = rec.y[1000:] - trace.eps[1000:]
    np.testing.assert_allclose(predicted, expected[1000:, 0], atol=1e-6 * np.ptp(rec.y))
    alone = AxisMonitor.alone(case.model, s).run_traced(*rec[:3])[1]
    assert np.abs(rec.y[1000:] - alone.eps[1000:] - expected[1000:, 0]).max() > 1e-4 * np.ptp(rec.y)


def test_both_at_once_in_theta_too(seed: int) -> None:
    """P^-1 adds up psi psi' / variance of both, and theta is the least-squares estimate: one step from a known P."""
    case = CASES[0]
    rec = samples(seed, case, 400, missing=0.0, jitter=0.0)
    s = case.settings(settle_s=1.9, lam=0.9)
    before, after = (AxisMonitor.alone(case.model, s) for _ in range(2))
    before.run(*part(rec, 0, 399)[:3], y2=rec.y2[:399])
    _, trace = after.run_traced(*rec[:3], y2=rec.y2)
    paper = Paper(case.model, s)
    paper.run(*part(rec, 0, 399))
    # The joint prediction of the last sample, by the transcription's propagation.
    paper._propagate(H, paper.torque)
    C = np.vstack([case.model.drive.matrix(which, case.model.values(paper.theta)) for which in ("C", "C2")])
    e, Psi = np.array([rec.y[-1], rec.y2[-1]]) - C @ paper.x, C @ paper.z.T
    assert s.second is not None
    c = C[1] @ np.array(s.K)
    Lam = np.array([[1.0, c], [c, c * c + s.second.lam0 / s.lam0]])  # innovation covariance over lambda_0
    P = before.bank.state.P[:, :, 0]
    R = 0.9 * np.linalg.inv(P) + Psi.T @ np.linalg.solve(Lam, Psi)
    step = np.linalg.solve(R, Psi.T @ np.linalg.solve(Lam, e))
    np.testing.assert_allclose(after.bank.state.P[:, :, 0], np.linalg.inv(R), rtol=1e-6)
    np.testing.assert_allclose(trace.theta[-1] - trace.theta[-2], step, rtol=1e-6, atol=1e-12)


def test_gains_are_those_of_the_joint_riccati_equation() -> None:
    """(I - K2 C2)(I - K1 C1) leaves what the joint gain leaves; K2 after the first is its second column."""
    model = CASES[0].model
    g = gains_of_both(model, H, TORQUE, ANGLE, SPEED)
    assert g.second is not None
    A, B, C1 = model.matrices()
    C2, R = model.drive.matrix("C2", model.nominal), np.diag([ANGLE**2, SPEED**2])
    C = np.vstack([C1, C2])
    Ad, Bd = zero_order_hold(A, B[:, [0]], H)
    P = np.eye(6)
    for _ in range(6000):
        P = Ad @ (P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P)) @ Ad.T + TORQUE**2 * Bd @ Bd.T
    joint = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    K1, K2, size = np.array(g.K), np.array(g.second.K), abs(joint).max()
    np.testing.assert_allclose(K2, joint[:, 1], rtol=1e-5, atol=1e-9 * size)
    np.testing.assert_allclose(K1 - K2 * (C2 @ K1), joint[:, 0], rtol=1e-5, atol=1e-9 * size)
    S = C @ P @ C.T + R
    assert g.lam0 == pytest.approx(S[0, 0], rel=1e-7)
    assert g.lam0 * g.second.lam0 == pytest.approx(np.linalg.det(S), rel=1e-7)
    after = Ad @ P @ Ad.T + TORQUE**2 * Bd @ Bd.T  # a sample was missing
    first = after @ C1[0] / (C1 @ after @ C1.T + R[0, 0])
    np.testing.assert_allclose(g.K_after[1], first[0], rtol=1e-5, atol=1e-9 * size)
    left = P - joint @ C @ P  # after no time at all both have been used once
    np.testing.assert_allclose(
        g.K_after[0], left @ C1[0] / (C1[0] @ left @ C1[0] + R[0, 0]), rtol=1e-5, atol=1e-9 * size
    )
    alone, _ = filter_gain(model, H, TORQUE, ANGLE)
    assert g.second.alone == tuple(alone)
    slowest = slowest_time_constant(model, np.vstack([K1, K2]), H)
    radius = np.abs(np.linalg.eigvals((np.eye(6) - joint @ C) @ Ad)).max()
    assert slowest == pytest.approx(-H / np.log(radius), rel=1e-6)
    radii = _radii(model, model.theta0[np.newaxis], np.vstack([K1, K2]), H)
    assert radii[0] == pytest.approx(radius, rel=1e-6)


def test_bounds_are_where_the_filter_of_both_is_stable() -> None:
    model, s = CASES[0].model, CASES[0].settings()
    limits = stable_limits(model, s.filter(6), H)
    assert (limits[0] < model.theta0).all()
    assert (limits[1] > model.theta0).all()
    for i, side in ((i, side) for i in range(3) for side in (0, 1)):
        theta = model.theta0.copy()
        theta[i] = limits[side, i]
        values = model.values(theta)
        moved = AxisModel(model.drive, values, ())
        assert slowest_time_constant(moved, s.filter(6), H) < np.inf
