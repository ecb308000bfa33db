"""What a monitor says about its axis, against the design's formulas."""

from math import sqrt

import pytest

from monitor_core.monitor import AxisMonitor
from tests.core.cases import BY_NAME, record


def test_numbers_of_a_parameter(seed: int) -> None:
    case = BY_NAME["speed-zero-nominals"]
    settings = case.settings(alpha1=0.7, alpha2=0.9, lam=0.97)
    monitor = AxisMonitor.alone(case.model, settings)
    monitor.run(*record(seed, case, 400))
    st = monitor.bank.state
    for i, p in enumerate(monitor.facts().parameters):
        P_ii = float(st.P[i, i, 0])
        assert (p.name, p.nominal, p.estimate) == (case.monitored[i], case.model.theta0[i], st.theta[i, 0])
        assert p.p_diagonal == P_ii
        assert p.standard_deviation == pytest.approx(sqrt(settings.lam0 * P_ii / 1.97))
        assert p.nu == pytest.approx(0.7 * sqrt(settings.lam0 * P_ii))
        assert p.h == pytest.approx(0.9 * case.model.scale[i])
        assert (p.g_up, p.g_down) == tuple(st.g[:, i, 0])
    assert monitor.facts().time_us == 399 * 5000


def test_an_alarm_tells_its_size_with_standard_deviation(seed: int) -> None:
    case = BY_NAME["paper"]
    settings = case.settings(alpha1=0.5, alpha2=0.5)
    monitor = AxisMonitor.alone(case.model, settings)
    rec = record(seed, case, 600, true={**case.values, "kT": 1.3})
    episodes, trace = monitor.run_traced(*rec)
    for e in episodes:
        if e.ended_us is None:
            k, i = e.updated_us // 5000, case.monitored.index(e.parameter)
            assert e.size == pytest.approx(trace.theta[k, i] - case.model.theta0[i])
            assert e.size_sd == pytest.approx(sqrt(settings.lam0 * trace.P[k, i] / 1.995))
    assert "kT" in {e.parameter for e in episodes}
