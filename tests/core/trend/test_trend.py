"""Steady, drift or step, with known truth."""

import numpy as np
import pytest

from monitor_core.trend.entries import HistoryEntry
from monitor_core.trend.trend import FEWEST, Trend, trend_of
from tests.core.trend.courses_of_months import HOUR_US, SIZE, START_US, months

HOUR_S = 3600.0


def known(entries: list[HistoryEntry], size: float = SIZE, hour_s: float = HOUR_S) -> Trend:
    found = trend_of(entries, size, hour_s)
    assert found is not None
    return found


def test_a_drift_is_found_with_its_slope(seed: int) -> None:
    """0.012 in ten days, eight times what lasts for a day."""
    rng = np.random.default_rng(seed)
    slope = 0.012 / (240 * 3600)
    trend = known(months(rng, 240, lambda t: SIZE + slope * 3600 * t, 0.0007, 0.001))
    assert trend.probability["drift"] + trend.probability["both"] > 0.9
    assert abs(trend.slope - slope) < 6 * trend.slope_sd
    assert 0.02 < trend.slope_sd / slope < 0.5
    assert abs(trend.level - (SIZE + 0.012)) < 6 * trend.level_sd
    assert trend.level_sd > 0.0005 / np.sqrt(240)  # never less than what P says


def test_a_step_is_found_with_its_time_and_size(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = known(months(rng, 300, lambda t: SIZE + 0.01 * (t > 200), 0.0007, 0.001))
    assert found.probability["step"] > 0.5
    assert found.probability["steady"] < 0.01
    assert abs(found.change_us - (START_US + 200 * HOUR_US)) < 12 * HOUR_US
    assert abs(found.change - 0.01) < 6 * found.change_sd
    assert abs(found.slope) < 6 * found.slope_sd


def test_what_wanders_is_not_called_a_drift(seed: int) -> None:
    """Of 20 healthy histories; a drift is said with nine to one in none of 500 (measured)."""
    rng = np.random.default_rng(seed)
    trends = [known(months(rng, 200, lambda t: SIZE + 0 * t, 0.0007, 0.001)) for _ in range(20)]
    sure = [t for t in trends if t.probability["drift"] + t.probability["both"] > 0.9]
    assert len(sure) <= 2
    assert np.median([t.probability["steady"] for t in trends]) > 0.6


def test_too_little_says_nothing() -> None:
    rng = np.random.default_rng(1)
    entries = months(rng, 300, lambda t: SIZE + 0 * t)
    assert trend_of([], SIZE, HOUR_S) is None
    assert trend_of(entries[: FEWEST - 1], SIZE, HOUR_S) is None
    assert trend_of(entries[:110], SIZE, HOUR_S) is None  # hours enough, days not
    assert trend_of(entries[:130], SIZE, HOUR_S) is not None


@pytest.mark.parametrize("factor", [1e-6, -1.0, 1e5])
def test_units_scale(factor: float) -> None:
    rng = np.random.default_rng(3)
    entries = months(rng, 150, lambda t: SIZE + 5e-5 * t, 0.0007, 0.001)
    scaled = [e._replace(mean=e.mean * factor, variance=e.variance * factor**2) for e in entries]
    a, b = known(entries), known(scaled, SIZE * abs(factor))
    assert b.probability == pytest.approx(a.probability, rel=1e-4, abs=1e-9)
    for name in ("level", "slope", "change"):
        assert getattr(b, name) == pytest.approx(factor * getattr(a, name), rel=1e-5)
    for name in ("level_sd", "slope_sd", "change_sd", "scatter"):
        assert getattr(b, name) == pytest.approx(abs(factor) * getattr(a, name), rel=1e-5)


def test_time_may_be_shifted_and_stretched() -> None:
    rng = np.random.default_rng(4)
    entries = months(rng, 150, lambda t: SIZE + 5e-5 * t, 0.0007, 0.001)
    a = known(entries)
    day_us = 86_400_000_000
    times = ("start_us", "middle_us", "end_us")
    shifted = [e._replace(**{n: getattr(e, n) + day_us for n in times}) for e in entries]
    b = known(shifted)
    assert (b.time_us, b.change_us) == (a.time_us + 86_400_000_000, a.change_us + 86_400_000_000)
    assert (b.slope, b.level, b.probability) == (a.slope, a.level, a.probability)
    quick = [e._replace(operating_s=2.0, **{n: (getattr(e, n) - START_US) // 1800 for n in times}) for e in entries]
    c = known(quick, SIZE, 2.0)
    assert c.slope == pytest.approx(1800 * a.slope, rel=1e-6)
    assert c.probability == pytest.approx(a.probability, rel=1e-6, abs=1e-9)
