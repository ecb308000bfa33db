"""The bounded year of a parameter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.trend.entries import HistoryEntry
from monitor_core.trend.slow_history import DAY, DAYS, HOURS, SlowHistory

HOUR_S = 2.0
STEP_US = 500_000
RHO = 0.05


def fed(slow: SlowHistory, readings: int, start_us: int = 0, step_us: int = STEP_US, value: float = 1.0) -> int:
    """Half a second of operation each; returns the time of the next."""
    for k in range(readings):
        slow.take(start_us + k * step_us, value + 1e-3 * k, 0.01, 0.5, RHO)
    return start_us + readings * step_us


def test_an_hour_of_operation_is_an_entry() -> None:
    slow = SlowHistory(HOUR_S)
    fed(slow, 9)
    first, second = slow.entries
    assert (first.start_us, first.middle_us, first.end_us) == (0, 750_000, 1_500_000)
    assert (first.mean, first.operating_s) == pytest.approx((1.0015, 2.0))
    pairs = (RHO ** np.abs(np.subtract.outer(range(4), range(4)))).sum() / 16
    assert first.variance == pytest.approx(0.01 * pairs)
    assert second.start_us == 2_000_000


def test_idle_time_is_no_operation_but_an_entry_spans_no_more_than_a_day() -> None:
    slow = SlowHistory(HOUR_S)
    later = fed(slow, 2)
    later = fed(slow, 2, later + 10_000_000)  # ten seconds, five hours, of rest
    assert [e.operating_s for e in slow.entries] == [2.0]
    fed(slow, 1, later)
    fed(slow, 4, later + round(DAY * HOUR_S * 1e6) + 1_000_000)
    assert [e.operating_s for e in slow.entries] == [2.0, 0.5, 2.0]


def test_a_year_has_a_bound_and_keeps_its_information() -> None:
    slow = SlowHistory(HOUR_S)
    now, k = 0, 0
    for k in range(10_500):  # hours of one reading each
        slow.take(now, float(k), 0.01, HOUR_S, RHO)
        now += 2_000_000
    entries = slow.entries
    assert HOURS + 300 < len(entries) <= HOURS + DAYS + 1
    assert [e.mean for e in entries[-HOURS:]] == [float(k - i) for i in range(HOURS - 1, -1, -1)]
    full_days = [e for e in entries[:-HOURS] if e.operating_s == DAY * HOUR_S]
    assert len(full_days) >= 300
    assert {round(e.variance / 0.01 * DAY, 9) for e in full_days} == {1.0}
    assert now - entries[0].start_us <= 400 * DAY * HOUR_S * 1e6 + DAY * HOUR_S * 1e6


@given(st.lists(st.integers(1, 5_000_000), min_size=1, max_size=120), st.integers(0, 119), st.integers(0, 2**50))
def test_what_was_saved_goes_on_and_times_may_be_shifted(steps: list[int], cut: int, shift: int) -> None:
    times = np.cumsum(steps)
    uninterrupted, first, shifted = SlowHistory(HOUR_S), SlowHistory(HOUR_S), SlowHistory(HOUR_S)
    for k, t in enumerate(times):
        if k == cut:
            saved = SlowHistory(HOUR_S)
            saved.restore(first.closed_to_array(), first.open_to_array())
            first = saved
        for slow in (uninterrupted, first):
            slow.take(int(t), np.sin(k), 0.01, 0.5, RHO)
        shifted.take(int(t) + shift, np.sin(k), 0.01, 0.5, RHO)
    assert first.entries == uninterrupted.entries
    np.testing.assert_array_equal(first.open_to_array(), uninterrupted.open_to_array())
    assert [_moved(e, shift) for e in uninterrupted.entries] == list(shifted.entries)


def _moved(e: HistoryEntry, by: int) -> HistoryEntry:
    return e._replace(start_us=e.start_us + by, middle_us=e.middle_us + by, end_us=e.end_us + by)


def test_a_clock_set_back_a_little_is_waited_for_and_far_back_forgets_the_future() -> None:
    slow = SlowHistory(HOUR_S)
    now = fed(slow, 8)
    fed(slow, 3, now - 2_000_000)  # an hour back: nothing is known twice
    assert [e.start_us for e in slow.entries] == [0, 2_000_000]
    fed(slow, 8, now + 10**12)  # the clock stood years ahead
    assert len(slow.entries) == 2  # all that is older than a year is gone
    fed(slow, 8, now)
    assert [e.start_us for e in slow.entries] == [now, now + 2_000_000]


@pytest.mark.parametrize("damage", ["hours", "nan", "counts", "shape"])
def test_damage_is_refused(damage: str) -> None:
    slow = SlowHistory(HOUR_S)
    fed(slow, 30)
    closed = slow.closed_to_array()
    if damage == "hours":
        closed[0, 3] = 3600.0
    elif damage == "nan":
        closed[2, 1] = np.nan
    elif damage == "counts":
        closed[0, 2] += 1
    else:
        closed = closed[:, :5]
    with pytest.raises(ValueError, match=r"histor|entries"):
        SlowHistory(HOUR_S).restore(closed, slow.open_to_array())
    kept = SlowHistory(HOUR_S)
    kept.restore(slow.closed_to_array(), np.array([1.0, np.nan]))
    assert kept.entries == slow.entries
