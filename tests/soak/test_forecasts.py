"""How often the truth lies in the 90 % interval of a forecast, over many histories with autocorrelated scatter."""

from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.trend.limit_forecast import forecast
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


def holds(rng: np.random.Generator, scatter: Scatter, late: bool) -> bool:
    """Whether the interval holds the truth: after five to thirty days, the limit 0.3 to 2 times as far ahead.

    A drift from the beginning; or ``late``, after a steady part.
    """
    hours = round(np.exp(rng.uniform(np.log(125), np.log(720))))
    truth_h = hours * (1 + rng.uniform(0.3, 2.0))
    since = rng.uniform(0.2, 0.6) * hours if late else 0.0
    slope = (LIMIT - SIZE) / (truth_h - since)
    trend = trend_of(months(rng, hours, lambda t: SIZE + slope * np.maximum(t - since, 0.0), *scatter), SIZE, 3600.0)
    assert trend is not None
    f, truth_us = forecast(trend, LIMIT, True), START_US + round(truth_h * HOUR_US)
    return f.low_us <= truth_us and (f.high_us is None or truth_us <= f.high_us)


@pytest.mark.parametrize(
    ("scatter", "late"),
    [
        (Scatter(0.0007, 0.001, 5.0), False),
        (Scatter(0.0005, 0.0012, 24.0), False),
        (Scatter(0.0003, 0.0012, 48.0), False),
        (Scatter(0.0007, 0.001, 5.0), True),
    ],
    ids=["5 h", "24 h", "48 h", "begins late"],
)
def test_the_interval_holds_the_truth_in_nine_of_ten(scatter: Scatter, late: bool, seed: int) -> None:
    """Measured, 600 each: 0.963, 0.943, 0.920, 0.962.  Where the scatter is white it is wider than it needs to be."""
    rng = np.random.default_rng(seed)
    share = np.mean([holds(rng, scatter, late) for _ in range(HISTORIES)])
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
