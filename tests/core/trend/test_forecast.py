"""When a limit is reached, how often the truth lies in the interval, and the band that is drawn with it."""

import numpy as np
import pytest
from scipy.stats import norm

from monitor_core.trend.limit_forecast import forecast
from monitor_core.trend.trend import Mixture, Trend, trend_of
from tests.core.trend.courses_of_months import HOUR_US, SIZE, START_US, months

DAY_US = 24 * HOUR_US
PER_HOUR = 0.015 / 240
"""Half way from 0.06 to 0.09 in ten days."""


def trend(rng: np.random.Generator, per_hour: float = PER_HOUR) -> Trend:
    """Of a drift over ten days."""
    found = trend_of(months(rng, 240, lambda t: SIZE + per_hour * t, 0.0007, 0.001), SIZE, 3600.0)
    assert found is not None
    return found


def test_a_drift_reaches_its_limit_in_the_interval(seed: int) -> None:
    """The truth is 480 h; one interval may miss it, the median of several ends hardly."""
    rng = np.random.default_rng(seed)
    found = [forecast(trend(rng), 0.09, upper=True) for _ in range(9)]
    assert {f.state for f in found} <= {"ahead", "open"}
    truth = START_US + 480 * HOUR_US
    highs = [f.high_us or 10**18 for f in found]
    assert np.median([f.low_us for f in found]) < truth < np.median(highs)
    assert np.median(highs) < truth + 12 * DAY_US
    assert np.median([f.low_us for f in found]) > START_US + 300 * HOUR_US


def test_a_limit_below_and_one_on_the_other_side(seed: int) -> None:
    rng = np.random.default_rng(seed)
    down = forecast(trend(rng, -PER_HOUR), 0.03, upper=False)
    assert down.state in ("ahead", "open")
    away = forecast(trend(rng), 0.03, upper=False)
    assert (away.state, away.high_us) == ("far", None)


def test_beyond_a_limit_it_says_since_when(seed: int) -> None:
    found = forecast(trend(np.random.default_rng(seed)), 0.066, upper=True)
    assert found.state == "beyond"
    assert found.high_us is not None
    assert START_US + 30 * HOUR_US < found.low_us <= found.high_us < START_US + 180 * HOUR_US


@pytest.mark.parametrize("factor", [1e-3, -1.0])
def test_units_do_not_move_it(factor: float) -> None:
    entries = months(np.random.default_rng(5), 200, lambda t: SIZE + PER_HOUR * t, 0.0007, 0.001)
    scaled = [e._replace(mean=e.mean * factor, variance=e.variance * factor**2) for e in entries]
    a, b = trend_of(entries, SIZE, 3600.0), trend_of(scaled, SIZE * abs(factor), 3600.0)
    assert a is not None
    assert b is not None
    original, converted = forecast(a, 0.09, True), forecast(b, 0.09 * factor, factor > 0)
    assert converted.state == original.state
    assert converted.low_us == pytest.approx(original.low_us, abs=60e6)
    assert original.high_us is not None
    assert converted.high_us == pytest.approx(original.high_us, abs=600e6)


def share_below(m: Mixture, t: float, level: float) -> float:
    mean, sd = m.at_times(np.array([t]))
    return float(m.p @ norm.cdf((level - mean[0]) / sd[0]))


def test_the_interval_of_a_forecast_begins_where_one_trend_in_twenty_has_reached_the_limit(seed: int) -> None:
    drift = trend(np.random.default_rng(seed))
    found, m = forecast(drift, 1.4 * SIZE, upper=True), drift.mixture
    assert found.state in ("ahead", "open")
    assert 1 - share_below(m, (found.low_us - m.zero_us) / 1e6, 1.4 * SIZE) == pytest.approx(0.05, abs=2e-3)
