"""What a calibration says about the false-alarm rate."""

import math

import pytest

from monitor_core.calibration.result import DetectorResult

YEAR_S = 31557600.0


@pytest.mark.parametrize(
    ("between_s", "words"),
    [
        ((10800.0, 5400.0, 36000.0), "in 3 hours, with 90 % certainty between one in 1.5 hours and one in 10 hours"),
        ((7200.0, 3600.0, 99 * YEAR_S), "between one in an hour and one in 99 years"),
        ((7200.0, 3600.0, 2.6e9 * YEAR_S), "between one in an hour and one in more than 100 years"),
        ((1e4 * YEAR_S, 3600.0, math.inf), "one false alarm in more than 100 years, with 90 % certainty"),
    ],
)
def test_a_rate_that_no_record_supports_is_not_stated(between_s: tuple[float, float, float], words: str) -> None:
    assert words in DetectorResult("cusum", between_s, (), 60.0).promise
