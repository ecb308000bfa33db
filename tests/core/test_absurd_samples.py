"""Absurd values and no motion at all, watched as the daemon does by default: counted, and nothing else happens."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.excitation.reference_experiment import Experiment, experiment
from monitor_core.monitoring import AxisMonitor, Observation
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.figures import steady_p
from tests.core.laws import part
from tests.core.supervised import MODEL, SUPERVISED

GATED = replace(SUPERVISED, outlier_limit=6.0)


@pytest.fixture(scope="module")
def settings() -> Settings:
    return replace(GATED, P0=steady_p(MODEL, GATED, range(10)))


def counted(monitor: AxisMonitor, before: dict[str, int]) -> dict[str, int]:
    now = monitor.status().counters
    return {name: now[name] - before[name] for name in now if now[name] != before[name]}


@pytest.mark.parametrize("huge", [1e300, -1e300, 1e160, -1e30, 1e6])
def test_an_absurd_output_is_an_outlier_and_changes_no_estimate(
    huge: float, settings: Settings, seed: int
) -> None:
    monitor, rec = AxisMonitor(MODEL, settings), experiment(seed)
    monitor.update(SampleBlock(*part(rec, 0, 1000)))
    st = monitor.batch.state
    kept = [field.copy() for field in (st.theta, st.P, st.g, st.lam0_running)]
    before = dict(monitor.status().counters)
    rec.y[1000] = huge
    monitor.update(SampleBlock(*part(rec, 1000, 1001)))
    assert counted(monitor, before) == {"outlier": 1}
    for old, new in zip(kept, (st.theta, st.P, st.g, st.lam0_running), strict=True):
        assert (old == new).all()
    assert np.isfinite(st.x).all()
    assert abs(st.x).max() < 100
    monitor.update(SampleBlock(*part(rec, 1001)))
    assert (abs(monitor.batch.state.theta[:, 0] / MODEL.theta0 - 1) < [0.3, 0.15, 0.9]).all()


@pytest.mark.parametrize("known", [True, False], ids=["P(0) known", "P(0) to be found"])
def test_an_axis_that_never_moves_learns_nothing_and_can_be_asked(
    known: bool, settings: Settings, seed: int
) -> None:
    """No torque, no speed, no noise; and then it moves as if nothing had been."""
    N = 3000
    monitor = AxisMonitor(MODEL, settings if known else replace(settings, P0=()))
    assert monitor.update(SampleBlock(5000 * np.arange(N), np.zeros(N), np.zeros(N))) == []
    status = monitor.status()
    assert (monitor.batch.state.theta[:, 0] == MODEL.theta0).all()
    assert status.counters["starved"] > 0.8 * N
    assert {p.observation for p in status.parameters} == {Observation.UNSEEN}
    other = AxisMonitor(MODEL, monitor.settings)
    other.from_arrays(monitor.to_arrays())
    rec = experiment(seed, samples=4000, fault_at=4000)
    later = Experiment(rec.t_us + 5000 * N, rec.u, rec.y)
    assert other.update(SampleBlock(*later)) == monitor.update(SampleBlock(*later))
    assert Observation.UNSEEN not in {p.observation for p in monitor.status().parameters}
    assert (abs(monitor.batch.state.theta[:, 0] / MODEL.theta0 - 1) < [0.3, 0.15, 0.9]).all()
