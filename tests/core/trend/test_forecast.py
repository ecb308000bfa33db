"""When a limit is reached, and how often the truth lies in the interval."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.trend.limit_forecast import Forecast, forecast
from monitor_core.trend.trend import trend_of
from tests.core.trend.courses_of_months import HOUR_US, SIZE, START_US, months

DAY_US = 24 * HOUR_US
PER_HOUR = 0.015 / 240
"""Half way from 0.06 to 0.09 in ten days."""


def told(rng: np.random.Generator, limit: float, upper: bool, per_hour: float, hours: int = 240) -> Forecast:
    trend = trend_of(months(rng, hours, lambda t: SIZE + per_hour * t, 0.0007, 0.001), SIZE, 3600.0)
    assert trend is not None
    return forecast(trend, limit, upper)


def test_a_drift_reaches_its_limit_in_the_interval(seed: int) -> None:
    """The truth is 480 h; one interval may miss it, the median of several ends hardly."""
    rng = np.random.default_rng(seed)
    found = [told(rng, 0.09, True, PER_HOUR) for _ in range(9)]
    assert {f.state for f in found} <= {"ahead", "open"}
    truth = START_US + 480 * HOUR_US
    highs = [f.high_us or 10**18 for f in found]
    assert np.median([f.low_us for f in found]) < truth < np.median(highs)
    assert np.median(highs) < truth + 12 * DAY_US
    assert np.median([f.low_us for f in found]) > START_US + 300 * HOUR_US


def test_a_limit_below_and_one_on_the_other_side(seed: int) -> None:
    rng = np.random.default_rng(seed)
    down = told(rng, 0.03, False, -PER_HOUR)
    assert down.state in ("ahead", "open")
    away = told(rng, 0.03, False, PER_HOUR)
    assert (away.state, away.high_us) == ("far", None)


def test_beyond_a_limit_it_says_since_when(seed: int) -> None:
    found = told(np.random.default_rng(seed), 0.066, True, PER_HOUR)
    assert found.state == "beyond"
    assert found.high_us is not None
    assert START_US + 30 * HOUR_US < found.low_us <= found.high_us < START_US + 180 * HOUR_US
    assert found.by > 0.95


def test_what_is_steady_is_never_foretold_to_the_day(seed: int) -> None:
    """Nothing is in sight, or the interval is open and begins late (of 300, in none otherwise)."""
    rng = np.random.default_rng(seed)
    found = [told(rng, 0.09, True, 0.0) for _ in range(5)]
    assert sum(f.high_us is None for f in found) >= 4
    assert np.median([f.low_us for f in found]) > START_US + 11 * DAY_US


@pytest.mark.parametrize("factor", [1e-3, -1.0])
def test_units_do_not_move_it(factor: float) -> None:
    entries = months(np.random.default_rng(5), 200, lambda t: SIZE + PER_HOUR * t, 0.0007, 0.001)
    scaled = [e._replace(mean=e.mean * factor, variance=e.variance * factor**2) for e in entries]
    a, b = trend_of(entries, SIZE, 3600.0), trend_of(scaled, SIZE * abs(factor), 3600.0)
    assert a is not None
    assert b is not None
    one, other = forecast(a, 0.09, True), forecast(b, 0.09 * factor, factor > 0)
    assert other.state == one.state
    assert other.low_us == pytest.approx(one.low_us, abs=60e6)
    assert one.high_us is not None
    assert other.high_us == pytest.approx(one.high_us, abs=600e6)
