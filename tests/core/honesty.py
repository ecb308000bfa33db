"""Reported standard deviations, beside the scatter of the estimates and the least that is possible."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.kalman import filter_gain, slowest_time_constant
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import NOISE
from monitor_core.modeling.standard_drives import INTERVAL_S, reference_model
from monitor_core.settings import Settings
from tests.core.figures import side_by_side
from tests.core.simulated import simulated, torques

SETTLED = 12
"""Memories until P and theta have forgotten their start."""


class Honesty(NamedTuple):
    """Of each parameter (p,), relative to its size: rms deviation, the reported one, the least possible one."""

    scatter: Floats
    reported: Floats
    least: Floats


def settings_for(output: Output, torque_noise: float, time_constants: float, *, joint: bool) -> Settings:
    """A memory of so many slowest time constants of the predictor; without torque noise it is the output error."""
    model = reference_model(output)
    K: tuple[float, ...] = ()
    lam0 = NOISE[output] ** 2
    if torque_noise:
        gain, lam0 = filter_gain(model, INTERVAL_S, torque_noise, NOISE[output])
        K = tuple(float(k) for k in gain)
    tau = slowest_time_constant(model, np.array(K or np.zeros(len(model.drive.states))), INTERVAL_S)
    lam = 1 - INTERVAL_S / (time_constants * tau)
    return Settings.paper(INTERVAL_S, lam=lam, lam0=lam0, K=K, settle_s=5 * tau, alpha2=1e9, joint_state=joint)


def honesty(output: Output, torque_noise: float, settings: Settings, seed: int, axes: int, memories: int) -> Honesty:
    """Axes with fresh noise and torque each, over so many memories behind the start."""
    model, rng, n = reference_model(output), np.random.default_rng(seed), round(settings.memory)
    # The seeding run alone takes ten memories.
    first = round(settings.settle_s / INTERVAL_S) + (10 + SETTLED) * n
    N = first + memories * n
    rec = simulated(rng, model.drive, torques(rng, N, axes), torque_noise, NOISE[output])
    late = slice(first, None, max(1, n // 8))
    # psi at the true parameters: of the same predictor with theta pinned (test_against_the_paper checks that psi).
    pinned = replace(settings, P0=tuple(1e-30 * model.scale**2), lam=1 - 1e-9, settle_s=0.0)
    trace, at_truth = (side_by_side(model, s, rec)[1] for s in (settings, pinned))
    deviation = trace.theta[late] - model.theta0[:, np.newaxis]
    reported = settings.lam0 * trace.P[late] / (1 + settings.lam)
    least = settings.lam0 * window_variance(at_truth.psi[1:], settings.lam, np.arange(N)[late] - 1)
    rms = (np.sqrt(np.mean(squares, axis=(0, 2))) / model.scale for squares in (deviation**2, reported, least))
    return Honesty(*rms)


def window_variance(psi: Floats, lam: float, times: NDArray[np.int64]) -> Floats:
    """diag R^-1 R2 R^-1 (times, p, W), of least squares with the weights lambda^(t - k), psi (N, p, W).

        R = sum lambda^(t-k) psi psi',    R2 = sum lambda^(2(t-k)) psi psi'

    Nothing that is without bias and weighs so scatters less: the Cramer-Rao bound is lambda_0 times this.
    """
    wanted, out = set(times.tolist()), []
    R = R2 = np.zeros((psi.shape[2], psi.shape[1], psi.shape[1]))
    for k, row in enumerate(psi):
        outer = np.einsum("iw,jw->wij", row, row)
        R, R2 = lam * R + outer, lam**2 * R2 + outer
        if k in wanted:
            inverse = np.linalg.inv(R)
            out.append(np.diagonal(inverse @ R2 @ inverse, axis1=1, axis2=2).T)
    return np.array(out)
