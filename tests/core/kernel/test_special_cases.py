"""Gaps, settling, time stamps, predictors that run away: theta stays what it was, and a counter says why.

And what a monitor says about its axis, against the design's formulas.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.detection import Alarm
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation.reference_experiment import Experiment, experiment
from monitor_core.kernel.state import NEVER
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisMonitor, NotTested, Status
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings, Threshold
from tests.core.cases import BY_NAME, CASES, Case, record
from tests.core.laws import restored
from tests.core.simulated import simulated, torques

SPEED = reference_model()


def alone(case: Case) -> AxisMonitor:
    """No alarm gets in the way."""
    return AxisMonitor(case.model, case.settings(alpha2=1e9))


def run(monitor: AxisMonitor, rec: Experiment, start: int, stop: int | None = None, later_us: int = 0) -> None:
    piece = slice(start, stop)
    monitor.update(SampleBlock(rec.t_us[piece] + later_us, rec.u[piece], rec.y[piece]))


@pytest.mark.parametrize("jump_us", [51_000, 10**12, -1_000_000_000], ids=["just", "days", "back"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_gap_starts_the_predictor_anew_and_keeps_the_rest(case: Case, jump_us: int, seed: int) -> None:
    rec = record(seed, case, 400)
    monitor = alone(case)
    run(monitor, rec, 0, 300)
    st = monitor.batch.state
    theta, P, g = st.theta.copy(), st.P.copy(), st.g.copy()
    assert (theta[:, 0] != case.model.theta0).all()
    later = jump_us - 5000 if jump_us > 0 else jump_us
    run(monitor, rec, 300, 301, later)
    assert (st.x[:, 0] == case.model.drive.matrix("rest", case.model.nominal)[:, 0] * rec.y[300]).all()
    assert (st.z == 0).all()
    run(monitor, rec, 301, 360, later)  # settling takes 0.3 s
    assert (st.theta == theta).all()
    assert (st.P == P).all()
    assert (st.g == g).all()
    assert monitor.status().parameters[0].status is Status.SETTLING
    assert monitor.status().counters["gap"] == 1
    run(monitor, rec, 360, 361, later)
    assert (st.theta != theta).all()
    assert monitor.status().parameters[0].status is Status.TRACKING


def test_the_longest_interval_is_not_a_gap() -> None:
    rec = experiment(1)
    monitor = AxisMonitor(SPEED, Settings.paper(0.005, max_gap_s=0.05))
    monitor.update(SampleBlock(np.array([0, 50_000, 100_001]), rec.u[:3], rec.y[:3]))
    assert monitor.status().counters["gap"] == 1


def test_an_angle_far_from_zero_is_no_trouble(seed: int) -> None:
    """After a gap the angle may have any value: the estimates are those of the same motion around zero."""
    case = BY_NAME["angle-paper"]
    rec = record(seed, case, 600)
    near, far = (alone(case) for _ in range(2))
    run(near, rec, 0)
    run(far, rec._replace(y=rec.y + 2.0**12), 0)
    difference = far.batch.state.theta / near.batch.state.theta - 1
    assert abs(difference).max() < 1e-8


def unstable(settle_s: float) -> AxisMonitor:
    """Friction far below zero: the state overflows within seconds.  theta is as good as pinned."""
    monitor = AxisMonitor(SPEED, Settings.paper(0.005, P0=tuple(1e-40 * SPEED.scale**2), settle_s=settle_s))
    monitor.batch.state.theta[:, monitor.lane] = SPEED.theta0 * [1, 1, -100]
    return monitor


def test_a_predictor_that_runs_away_is_started_anew(seed: int) -> None:
    """Its state can be saved right then, and its facts be told at any time."""
    monitor, rec = unstable(settle_s=4.0), experiment(seed)
    for k in range(1000):
        run(monitor, rec, k, k + 1)
        if monitor.status().counters["diverged"] and monitor.batch.state.t[0] == NEVER:
            assert restored(monitor).status() == monitor.status()
    assert monitor.status().counters["diverged"] >= 1
    assert (monitor.batch.state.theta[:, 0] == SPEED.theta0 * [1, 1, -100]).all()
    monitor.batch.state.theta[:, monitor.lane] = SPEED.theta0
    run(monitor, rec, 1000, later_us=10**6)
    assert np.isfinite(monitor.batch.state.x).all()
    assert abs(monitor.batch.state.x[2, 0]) < 50
    assert 0.5 < monitor.status().innovation_variance < 2
    assert monitor.status().parameters[0].status is Status.TRACKING
    early = unstable(settle_s=0.1)
    for k in range(2000):
        run(early, rec, k, k + 1)
        assert all(p.standard_deviation >= 0 for p in early.status().parameters)


@pytest.mark.parametrize("huge", [1e30, 1e160, 1e300])
def test_one_absurd_value_leaves_everything_finite(huge: float, seed: int) -> None:
    monitor = AxisMonitor(SPEED, Settings.paper(0.005, P0=tuple((0.01 * SPEED.scale) ** 2), settle_s=0.1))
    rec = experiment(seed)
    rec.y[1000] = huge
    run(monitor, rec, 0)
    status = monitor.status()
    assert np.isfinite(status.innovation_variance)
    assert all(np.isfinite([p.standard_deviation, p.g_up, p.g_down]).all() for p in status.parameters)
    assert np.isfinite(monitor.batch.state.theta).all()
    restored(monitor)


def lossy(seed: int, lost: int, lost_s: float) -> tuple[AxisMonitor, list[Alarm]]:
    """The reference drive with a precise encoder; every 7.5 s so many samples in a row are lost."""
    model, rng, N = reference_model("angle"), np.random.default_rng(seed), 8000
    t_us, u, y = simulated(rng, model.drive, torques(rng, N, 1)[:, 0], 0.05, 1e-4)
    K, lam0 = filter_gain(model, 0.005, 0.05, 1e-4)
    settings = Settings.paper(0.005, K=tuple(K), lam0=lam0, settle_s=4.5, lost_s=lost_s)
    monitor = AxisMonitor(model, settings)
    keep = np.arange(N) % 1500 >= lost
    return monitor, [c.alarm for c in monitor.update(SampleBlock(t_us[keep], u[keep], y[keep]))]


@pytest.mark.parametrize("lost", [1, 2, 5, 9])
def test_lost_samples_raise_no_alarm(lost: int, seed: int) -> None:
    """Nine in a row, with the torque guessed, are off by hundreds of standard deviations."""
    monitor, episodes = lossy(seed, lost, 0.45)
    assert episodes == []
    assert (abs(monitor.batch.state.theta[:, 0] / monitor.model.theta0 - 1) < [0.02, 0.02, 0.2]).all()
    assert monitor.status().counters["used"] > 1000
    assert lost < 9 or lossy(seed, lost, 0.0)[1], "without waiting it would be a fault"


def test_what_its_bounds_hold_is_invalid(seed: int) -> None:
    """A torque constant half as large again, and bounds that allow a tenth: no number, and the others have theirs."""
    model = replace(reference_model("speed"), bounds={"kT": (0.9, 1.1)})
    settings = Settings.paper(0.005, P0=(1e-2, 1e-6, 1e-4), settle_s=0.0, information_floor=0.05, min_excitation=0.05)
    monitor = AxisMonitor(model, settings)
    rec, held = experiment(seed, {"kT": 1.5}, samples=2000), list[bool]()
    run(monitor, rec, 0, 1400)
    for start in range(1400, 2000, 20):
        run(monitor, rec, start, start + 20)
        kT, *others = monitor.status().parameters
        held.append(math.isnan(kT.estimate))
        assert kT.status in (Status.INVALID, Status.ALARM, Status.TRACKING)
    assert np.mean(held) > 0.5  # 0.8 to 1 of 60 seeds
    assert monitor.status().counters["projected"] > 100
    assert all(np.isfinite(p.estimate) for p in others)


def test_errors_far_beyond_the_model_are_invalid(seed: int) -> None:
    """Noise of twenty times what is expected, for ten memories of lambda_0."""
    settings = Settings.paper(0.005, lam=0.98, lam0=1.0, P0=(1e-4, 1e-8, 1e-6), settle_s=0.0, joint_state=True)
    monitor = AxisMonitor(reference_model("speed"), settings)
    t, u, y = experiment(seed, samples=4000)
    monitor.update(SampleBlock(t[:2000], u[:2000], y[:2000]))
    assert {p.status for p in monitor.status().parameters} <= {Status.TRACKING, Status.ALARM}
    noise = 20 * np.random.default_rng(seed).standard_normal(2000)
    monitor.update(SampleBlock(t[2000:], u[2000:], y[2000:] + noise))
    assert {p.status for p in monitor.status().parameters} <= {Status.INVALID, Status.ALARM}
    assert all(np.isnan(p.estimate) for p in monitor.status().parameters)


def test_nominal_values_that_a_record_could_not_tell_apart_are_not_tested(seed: int) -> None:
    settings = Settings.paper(0.005, P0=(1e-4, 1e-8, 1e-6), settle_s=0.0)
    identifiable = AxisMonitor(reference_model("speed"), settings)
    unidentifiable = AxisMonitor(reference_model("speed"), replace(settings, unidentifiable=(("fm", "fc"),)))
    rec = experiment(seed, {"kT": 1.3}, samples=3000)
    assert identifiable.update(SampleBlock(*rec))
    assert unidentifiable.update(SampleBlock(*rec)) == []
    assert not unidentifiable.batch.state.g.any()
    names = unidentifiable.model.monitored
    assert unidentifiable.status().untested_so_far() == {NotTested.UNIDENTIFIABLE: names}
    np.testing.assert_array_equal(unidentifiable.batch.state.theta, identifiable.batch.state.theta)
    assert unidentifiable.status().confounded == (
        "fm and fc cannot be distinguished by the record of their nominal values: nothing is tested. Identify the axis"
        " with a record of several speeds and accelerations, or with `axiswatch identify --fix fc`, which holds it at"
        " its value in the configuration",
    )


@pytest.mark.parametrize(
    "own", [(), (Threshold(0.7, 0.9), Threshold(0.5, 2.0, 0.1), Threshold(1.0, 3.0, 0.2))], ids=["one", "own"]
)
def test_numbers_of_a_parameter(own: tuple[Threshold, ...], seed: int) -> None:
    case = BY_NAME["speed-zero-nominals"]
    settings = replace(case.settings(alpha1=0.7, alpha2=0.9, lam=0.97), thresholds=own)
    monitor = AxisMonitor(case.model, settings)
    monitor.update(SampleBlock(*record(seed, case, 400)))
    st, status = monitor.batch.state, monitor.status()
    assert np.array(status.covariance) == pytest.approx(settings.lam0 * st.P[..., 0] / 1.97)
    for i, p in enumerate(status.parameters):
        P_ii, size = float(st.P[i, i, 0]), case.model.scale[i]
        threshold = own[i] if own else Threshold(0.7, 0.9)
        assert (p.name, p.nominal, p.estimate) == (case.monitored[i], case.model.theta0[i], st.theta[i, 0])
        assert p.p_diagonal == P_ii
        assert p.standard_deviation == pytest.approx(math.sqrt(settings.lam0 * P_ii / 1.97))
        assert p.nu == pytest.approx(threshold.alpha1 * math.sqrt(settings.lam0 * P_ii) + threshold.allowance * size)
        assert p.h == pytest.approx(threshold.alpha2 * size)
        assert (p.g_up, p.g_down) == tuple(st.g[:, i, 0])
    assert monitor.status().time_us == 399 * 5000
