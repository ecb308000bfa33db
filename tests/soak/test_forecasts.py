"""How often the truth lies in the 90 % interval of a forecast, over many histories with autocorrelated scatter."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.trend.limit_forecast import Forecast, forecast
from monitor_core.trend.trend import trend_of
from tests.core.trend.courses_of_months import HOUR_US, SIZE, START_US, months

pytestmark = pytest.mark.soak

HISTORIES = 600
LIMIT = 0.09


class Scatter(NamedTuple):
    """Of an hour's mean: white, lasting, and for how many hours that lasts."""

    white: float
    lasting: float
    for_h: float


Course = Callable[[np.random.Generator, int, float], tuple[Callable[[Floats], Floats], float]]
"""By the hours of a history, and those from its end to the limit: the course, and the hour at which it reaches it."""


def begins_late(
    rng: np.random.Generator, hours: int, ahead_h: float
) -> tuple[Callable[[Floats], Floats], float]:
    """Steady, then a drift that reaches the limit ``ahead_h`` after the end."""
    since = rng.uniform(0.2, 0.6) * hours
    slope = (LIMIT - SIZE) / (hours - since + ahead_h)
    return lambda t: SIZE + slope * np.maximum(t - since, 0.0), hours + ahead_h


def drifts(_: np.random.Generator, hours: int, ahead_h: float) -> tuple[Callable[[Floats], Floats], float]:
    """A drift from the beginning."""
    return lambda t: SIZE + (LIMIT - SIZE) * t / (hours + ahead_h), hours + ahead_h


def told(rng: np.random.Generator, scatter: Scatter, course: Course) -> bool:
    """Five to thirty days, and the limit 0.3 to 2 times as far ahead: whether the interval holds the truth."""
    hours = round(np.exp(rng.uniform(np.log(125), np.log(720))))
    of, truth_h = course(rng, hours, rng.uniform(0.3, 2.0) * hours)
    trend = trend_of(months(rng, hours, of, *scatter), SIZE, 3600.0)
    assert trend is not None
    return holds(forecast(trend, LIMIT, True), START_US + round(truth_h * HOUR_US))


def holds(f: Forecast, truth_us: int) -> bool:
    return f.low_us <= truth_us and (f.high_us is None or truth_us <= f.high_us)


@pytest.mark.parametrize(
    ("scatter", "course"),
    [
        (Scatter(0.0007, 0.001, 5.0), drifts),
        (Scatter(0.0005, 0.0012, 24.0), drifts),
        (Scatter(0.0003, 0.0012, 48.0), drifts),
        (Scatter(0.0007, 0.001, 5.0), begins_late),
    ],
    ids=["5 h", "24 h", "48 h", "begins late"],
)
def test_the_interval_holds_the_truth_in_nine_of_ten(scatter: Scatter, course: Course, seed: int) -> None:
    """Measured, 600 each: 0.963, 0.943, 0.920, 0.962.  Where the scatter is white it is wider than it needs to be."""
    rng = np.random.default_rng(seed)
    share = np.mean([told(rng, scatter, course) for _ in range(HISTORIES)])
    print(f"{scatter}: {share:.3f}")
    assert 0.86 < share < 0.995


def test_what_is_healthy_is_hardly_ever_foretold_to_be_near(seed: int) -> None:
    """A limit of a quarter more, in fourteen days, with a drift that is held for sure."""
    rng, near = np.random.default_rng(seed), 0
    for _ in range(300):
        hours = round(np.exp(rng.uniform(np.log(125), np.log(720))))
        trend = trend_of(months(rng, hours, lambda t: SIZE + 0 * t, 0.0005, 0.0012, 24.0), SIZE, 3600.0)
        assert trend is not None
        f = forecast(trend, 1.25 * SIZE, True)
        sure = trend.probability["drift"] + trend.probability["both"] >= 0.9
        near += sure and f.state != "far" and f.low_us < trend.time_us + 14 * 24 * HOUR_US
    print(f"near: {near} of 300")
    assert near <= 9
