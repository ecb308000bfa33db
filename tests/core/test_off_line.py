"""What the recursion is where the problem is easy: least squares, and the off-line fit at the end of a record."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation.reference_experiment import NOISE, experiment
from monitor_core.identification.greybox import Problem, fit
from monitor_core.identification.records import Record as Measured
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

LINEAR = ("kT", "tau0")
"""The prediction is linear in these, with a gain or without."""
VALUES = {**REFERENCE_VALUES, "tau0": 0.1}
FOREVER = 1 - 1e-12


def linear(lam: float, torque_noise: float) -> tuple[AxisModel, Settings]:
    model = AxisModel(three_mass("speed"), VALUES, LINEAR)
    K = filter_gain(model, INTERVAL_S, torque_noise, NOISE["speed"])[0] if torque_noise else ()
    start = tuple((0.3 * model.scale) ** 2)
    return model, Settings.paper(
        INTERVAL_S, lam=lam, K=tuple(K), P0=start, settle_s=0.0, alpha2=1e9, joint_state=True
    )


def least_squares(psi: Floats, eps: Floats, settings: Settings) -> Floats:
    """theta - theta0 (p,) of least squares with weights lambda^(N - k), and P(0) as what was known before."""
    lam, N = settings.lam, len(eps)
    weights = lam ** np.arange(N - 1, -1, -1.0)
    # An update divides P(0) by lambda before the next sample: it counts lambda^N.
    R = lam**N * np.diag(1 / np.array(settings.P0)) + psi.T @ (weights[:, np.newaxis] * psi)
    return np.asarray(np.linalg.solve(R, psi.T @ (weights * eps)))


@pytest.mark.parametrize("lam", [FOREVER, 0.995, 0.98])
@pytest.mark.parametrize("torque_noise", [0.0, 0.3], ids=["output error", "innovations"])
def test_a_linear_regression_gives_recursive_least_squares(
    torque_noise: float, lam: float, seed: int
) -> None:
    """Every estimate is that of weighted least squares in closed form, of psi and eps at nominal."""
    model, settings = linear(lam, torque_noise)
    rec = experiment(seed, {"kT": 1.2}, samples=400, fault_at=0)
    pinned = replace(settings, P0=tuple(1e-30 * model.scale**2))
    _, at_nominal = AxisMonitor(model, pinned).update_traced(SampleBlock(*rec))
    _, trace = AxisMonitor(model, settings).update_traced(SampleBlock(*rec))
    for n in (3, 50, 399):
        psi, eps = at_nominal.psi[1 : n + 1], at_nominal.eps[1 : n + 1]
        expected = model.theta0 + least_squares(psi, eps, settings)
        assert trace.theta[n] == pytest.approx(expected, rel=1e-8)
    assert abs(trace.theta[399, 0] / 1.2 - 1) < 0.2  # something was estimated


@pytest.mark.parametrize(("joint", "within"), [(True, 1.0), (False, 2.0)])
def test_without_forgetting_the_end_is_the_off_line_estimate(joint: bool, within: float, seed: int) -> None:
    """Three parameters, 3 % wrong at the start, after a minute: within the off-line standard deviation.

    It was 0.16 of it in the mean, 0.3 where the state does not move with theta.
    """
    names = ("Jm", "Ja", "fm")
    rec = experiment(seed, samples=12_000, fault_at=12_000)
    off_line = fit(
        Problem(three_mass("speed"), REFERENCE_VALUES, names, predictor="output-error"),
        [Measured(np.asarray(rec.t_us * 1e-6, float), rec.u, rec.y, "speed")],
    )
    model = AxisModel(three_mass("speed"), {**REFERENCE_VALUES}, names)
    settings = Settings.paper(
        INTERVAL_S,
        lam=FOREVER,
        P0=tuple((0.05 * model.scale) ** 2),
        settle_s=3.0,
        alpha2=1e9,
        joint_state=joint,
    )
    monitor = AxisMonitor(model, settings)
    monitor.batch.state.theta[:, monitor.lane] = model.theta0 * [1.03, 0.97, 1.03]
    monitor.update(SampleBlock(*rec))
    apart = (monitor.batch.state.theta[:, 0] - off_line.theta) / off_line.sd
    print(f"from the off-line estimate by {apart} of its standard deviations {off_line.sd / model.theta0}")
    assert (abs(apart) < within).all()
