"""The band of a slow course, against its mixture and against the forecast that is drawn with it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from monitor_core.trend.limit_forecast import forecast, quantiles
from monitor_core.trend.trend import Mixture, Trend, trend_of
from tests.core.trend.courses_of_months import SIZE, months

PER_HOUR = 0.015 / 240


@pytest.fixture(scope="module")
def trend(seed: int) -> Trend:
    """A drift that ten days have made sure."""
    rng = np.random.default_rng(seed)
    found = trend_of(months(rng, 240, lambda t: SIZE + PER_HOUR * t, 0.0007, 0.001), SIZE, 3600.0)
    assert found is not None
    return found


def share_below(m: Mixture, t: float, level: float) -> float:
    mean, sd = m.at_times(np.array([t]))
    return float(m.p @ norm.cdf((level - mean[0]) / sd[0]))


def test_each_line_has_its_share_of_the_courses_below_it(trend: Trend) -> None:
    m = trend.mixture
    t = np.array([m.begin, 0.5 * (m.begin + m.end), m.end, m.end + 86400 * 3])
    for p, line in zip((0.05, 0.5, 0.95), quantiles(m, t, (0.05, 0.5, 0.95)), strict=True):
        assert [share_below(m, *at) for at in zip(t.tolist(), line.tolist(), strict=True)] == pytest.approx(
            [p] * 4, abs=2e-4
        )


def test_the_interval_of_a_forecast_is_between_where_the_edges_reach_the_limit(trend: Trend) -> None:
    limit = 1.4 * SIZE
    found, m = forecast(trend, limit, upper=True), trend.mixture
    assert found.state in ("ahead", "open")
    at = (found.low_us - m.zero_us) / 1e6
    (upper,) = quantiles(m, np.array([at]), (0.95,))
    reached = float(upper[0]) - trend.level
    assert reached == pytest.approx(limit - trend.level, rel=0.02)
