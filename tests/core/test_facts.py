"""What a monitor says about its axis, against the design's formulas."""

from dataclasses import replace
from math import sqrt

import pytest

from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Threshold
from tests.core.alarm_versions import alarm_versions
from tests.core.cases import BY_NAME, record


@pytest.mark.parametrize(
    "own", [(), (Threshold(0.7, 0.9), Threshold(0.5, 2.0, 0.1), Threshold(1.0, 3.0, 0.2))], ids=["one", "own"]
)
def test_numbers_of_a_parameter(own: tuple[Threshold, ...], seed: int) -> None:
    case = BY_NAME["speed-zero-nominals"]
    settings = replace(case.settings(alpha1=0.7, alpha2=0.9, lam=0.97), thresholds=own)
    monitor = AxisMonitor(case.model, settings)
    monitor.update(SampleBlock(*record(seed, case, 400)))
    st = monitor.batch.state
    for i, p in enumerate(monitor.status().parameters):
        P_ii, size, of = float(st.P[i, i, 0]), case.model.scale[i], own[i] if own else Threshold(0.7, 0.9)
        assert (p.name, p.nominal, p.estimate) == (case.monitored[i], case.model.theta0[i], st.theta[i, 0])
        assert p.p_diagonal == P_ii
        assert p.standard_deviation == pytest.approx(sqrt(settings.lam0 * P_ii / 1.97))
        assert p.nu == pytest.approx(of.alpha1 * sqrt(settings.lam0 * P_ii) + of.allowance * size)
        assert p.h == pytest.approx(of.alpha2 * size)
        assert (p.g_up, p.g_down) == tuple(st.g[:, i, 0])
    assert monitor.status().time_us == 399 * 5000


def test_an_alarm_tells_its_size_with_standard_deviation(seed: int) -> None:
    case = BY_NAME["paper"]
    settings = case.settings(alpha1=0.5, alpha2=0.5)
    monitor = AxisMonitor(case.model, settings)
    rec = record(seed, case, 1500, true={**case.values, "kT": 1.3})
    episodes, trace = alarm_versions(monitor, SampleBlock(*rec))
    before, checked = 0.0, 0
    for e in episodes:
        # A crossing of another parameter leaves the size; the one at the naming is that of all evidence (test_naming).
        if e.ended_us is None and e.stage == "changed" and e.size != before:
            before, checked = e.size, checked + 1
            k, i = e.updated_us // 5000, case.monitored.index(e.parameter)
            assert e.size == pytest.approx(trace.theta[k, i] - case.model.theta0[i])
            assert e.size_sd == pytest.approx(sqrt(settings.lam0 * trace.P[k, i] / 1.995))
    assert checked
    assert "kT" in {e.parameter for e in episodes}
