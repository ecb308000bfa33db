"""Alarms, the slow course and the limits in words: never a time without an interval."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.detection import Alarm, Cause, Reach
from monitor_core.trend.trend import trend_of
from service.texts.alarm_words import alarm_words, episode_words
from service.texts.trend_words import reach_words, trend_words
from tests.core.trend.courses_of_months import SIZE, months

DAY_US = 86_400_000_000
NOW_US = 1_772_366_400_000_000
UNIT = "N m s/rad"


def reach(state: str, low: float, high: float | None) -> Reach:
    ends = (NOW_US + round(low * DAY_US), None if high is None else NOW_US + round(high * DAY_US))
    return Reach("fm", UNIT, 0.09, True, state, *ends)


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (reach("ahead", 12.2, 19.8), "fm reaches 0.09 N m s/rad in 12 to 20 days"),
        (reach("ahead", -1.0, 0.6), "fm reaches 0.09 N m s/rad in 0 to 14 hours"),
        (reach("open", 12.2, None), "fm reaches 0.09 N m s/rad in 12 days or later, perhaps never"),
        (reach("far", 50.0, None), "fm = 0.09 N m s/rad is not in sight: not within 50 days"),
        (
            reach("beyond", -3.0, -2.0),
            "fm has been above 0.09 N m s/rad since a time between 2026-02-26 12:00 UTC and 2026-02-27 12:00 UTC",
        ),
    ],
)
def test_limits(what: Reach, words: str) -> None:
    assert reach_words(what, NOW_US) == words


@given(st.floats(0, 3000), st.floats(0, 3000))
def test_a_time_ahead_always_has_two_ends_in_order(low: float, more: float) -> None:
    words = reach_words(reach("ahead", low, low + more), NOW_US)
    units = "(seconds|minutes|hours|days|years)"
    found = re.fullmatch(rf"fm reaches 0\.09 N m s/rad in ([\d.]+) to ([\d.]+) {units}", words)
    assert found is not None
    assert float(found[1]) <= float(found[2])


def test_courses_and_their_shares_where_they_are_not_sure() -> None:
    rng = np.random.default_rng(1)
    courses = {
        r"fm is steady: 0\.0(6|59)\d* N m s/rad ± \S+": lambda t: SIZE + 0 * t,
        r"fm drifts up by \S+ N m s/rad ± \S+ per day": lambda t: SIZE + 1e-4 * t,
        r"fm fell at once by \S+ N m s/rad ± \S+, about 2025-10-\d\d \d\d:\d\d UTC": lambda t: SIZE - 0.02 * (t > 100),
    }
    for pattern, course in courses.items():
        trend = trend_of(months(rng, 200, course, 0.0005), SIZE, 3600.0)
        assert re.fullmatch(pattern, trend_words("fm", UNIT, trend)), trend_words("fm", UNIT, trend)
    assert trend_words("fm", UNIT, None) == "fm: too little data yet to detect a drift"
    trend = trend_of(months(np.random.default_rng(1), 200, lambda t: SIZE + 0 * t, 0.0005), SIZE, 3600.0)
    assert trend is not None
    unsure = trend._replace(probability={"steady": 0.3, "drift": 0.6, "step": 0.08, "both": 0.02})
    assert trend_words("fm", UNIT, unsure).startswith("fm: drift or steady or step, 62:30:8; ")


def test_an_alarm_about_a_limit() -> None:
    found = Alarm("fm", "up", NOW_US, NOW_US, NOW_US, None, 0.02, 0.001, 1, "named")
    forecast = replace(found, kind="forecast", reaches=(reach("ahead", 12.2, 19.8),))
    words = episode_words(forecast, 0.06, UNIT)
    now = "now fm is 0.02 N m s/rad (33 %, 31 to 36) above its nominal value"
    assert words == f"fm reaches 0.09 N m s/rad in 12 to 20 days; {now}"


def test_a_change_that_ended_before_it_was_named_is_not_waited_for() -> None:
    seen = Alarm("fc", "down", NOW_US, NOW_US, NOW_US, None, None, None, 1, "changed")
    start = "something has changed, at first sight fc; cause and size "
    assert episode_words(seen, 0.1, "N m") == f"{start}are not known yet"
    assert episode_words(seen.ended(NOW_US + 1), 0.1, "N m") == f"{start}did not become known"


def test_an_alarm_of_axes_that_show_the_same_payload() -> None:
    found = Alarm("kT", "down", NOW_US, NOW_US, NOW_US, None, -0.2, 0.01, 1, "named", (Cause("kT", 0.99, ("load",)),))
    alone = "kT is 0.2 (20 %, 18 to 22) below its nominal value; another payload would look the same"
    assert episode_words(found, 1.0, "1") == alone
    likelier = "changed at that time, too: another payload is likelier than a fault of each"
    assert episode_words(found, 1.0, "1", ("arm.2", "arm.3")) == f"{alone}; arm.2 and arm.3 {likelier}"


LATE = "the torque frame is 0.5 ms late: the torque acts that much after its sample"
EARLY = "the torque frame is 1.2 ms early: the torque acts that much before its sample"
USUAL = "the torque frame is {} than usual: the torque acts {} its sample"
MOVES = "the inertia that the axis moves is {} than at its commissioning: another payload, and no fault of its drive"
MOTOR = "; if it carries the same as then, kT is {}"
CARRIES = "the load on the axis is {} than at its commissioning: another payload, and no fault of its drive"


@pytest.mark.parametrize(
    ("alarm", "words"),
    [
        (("delay", 0.0005, 0.0, "s"), LATE),
        (("delay", -0.00123, 0.0, "s"), EARLY),
        (("delay", 0.0005, 0.001, "s"), USUAL.format("0.5 ms later", "1.5 ms after")),
        (("delay", -0.002, 0.001, "s"), USUAL.format("2 ms earlier", "1 ms before")),
        (("delay", -0.0005, 0.001, "s"), USUAL.format("0.5 ms earlier", "0.5 ms after")),
        (("delay", float("-inf"), 0.0, "s"), "the torque frame is early, by how much is not known"),
        (("load", 0.306, 1.0, "1"), CARRIES.format("31 % larger")),
        (("load", -0.14, 1.0, "1"), CARRIES.format("14 % smaller")),
        (("load", float("-inf"), 1.0, "1"), CARRIES.format("smaller")),
        (("inertia", 0.25, 1.0, "1"), MOVES.format("25 % larger") + MOTOR.format("20 % smaller")),
        (("inertia", -0.2, 1.0, "1"), MOVES.format("20 % smaller") + MOTOR.format("25 % larger")),
        (("inertia", float("-inf"), 1.0, "1"), MOVES.format("smaller") + MOTOR.format("larger")),
        (("fm", 0.018, 0.06, "N m s/rad"), "fm is 0.018 N m s/rad (30 %) above its nominal value"),
        (
            ("fm", 0.018, 0.06, "N m s/rad", 0.002),
            "fm is 0.018 N m s/rad (30 %, 25 to 35) above its nominal value",
        ),
        (("kT", -0.1, 1.0, "1"), "kT is 0.1 (10 %) below its nominal value"),
        (("kT", -0.1, 1.0, "1", 0.07), "kT is 0.1 (10 %, -1.5 to 22) below its nominal value"),
        (("kT", -0.1, 1.0, "1", 1.0), "kT is 0.1 (10 %) below its nominal value"),
        (("kT", -0.1, -1.0, "1", 1e-6), "kT is 0.1 (10 %) below its nominal value"),
        (("tau0", 0.25, 0.0, "N m"), "tau0 is 0.25 N m above its nominal value"),
        (("tau0", 0.25, 0.0, "N m", 0.02), "tau0 is 0.25 N m (0.22 to 0.28) above its nominal value"),
        (("fm", float("inf"), 0.06, "N m s/rad"), "fm is above its nominal value, by how much is not known"),
        (("output noise", float("inf"), 1.0, "1"), "the measured motion is noisier than it was"),
        (("output noise", 0.5, 1.0, "1"), "the measured motion is noisier than it was, by 50 %"),
        (
            ("torque scale", float("-inf"), 1.0, "1"),
            "the torque that acts is less than the measured one, by its scale",
        ),
        (("output scale", 0.2, 1.0, "1"), "the measured motion is 20 % more than the true one, by its scale"),
        (
            ("torque offset", 0.2, 0.0, "N m"),
            "the torque that acts is 0.2 N m more than the measured one, always",
        ),
    ],
)
def test_alarms(alarm: tuple[Any, ...], words: str) -> None:
    assert alarm_words(*alarm) == words
