"""Means of autocorrelated estimates, merged and thinned."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.trend.entries import HistoryEntry, as_rows, from_rows, inflation, merged, thinned
from tests.core.trend.courses_of_months import START_US, months


@pytest.mark.parametrize("rho", [0.0, 0.05, 0.5, 0.95])
@pytest.mark.parametrize("n", [1, 2, 7, 100])
def test_the_variance_of_a_mean_is_the_sum_over_all_pairs(n: int, rho: float) -> None:
    k = np.arange(n)
    pairs = (rho ** np.abs(k[:, None] - k)).sum() / n**2 if rho else 1 / n
    assert inflation(n, rho) / n == pytest.approx(pairs, rel=1e-12)


def test_merged_entries_count_by_their_information() -> None:
    a, b = HistoryEntry(0, 10, 5, 1.0, 0.01, 3.0), HistoryEntry(10, 30, 20, 3.0, 0.03, 4.0)
    found = merged([a, b])
    assert (found.start_us, found.end_us, found.operating_s) == (0, 30, 7.0)
    assert (found.mean, found.variance) == pytest.approx((1.5, 0.0075))
    assert found.middle_us == round(5 + 0.25 * 15)


@given(st.integers(1, 300), st.integers(1, 60))
def test_thinned_entries_keep_time_and_information(hours: int, most: int) -> None:
    entries = months(np.random.default_rng(1), hours, lambda t: 0.06 + 0 * t)
    few = thinned(entries, most)
    assert len(few) <= most
    assert (few[0].start_us, few[-1].end_us) == (entries[0].start_us, entries[-1].end_us)
    assert sum(1 / e.variance for e in few) == pytest.approx(sum(1 / e.variance for e in entries))
    assert sum(e.operating_s for e in few) == pytest.approx(3600.0 * hours)


def test_rows_are_exact_and_damage_is_seen() -> None:
    entries = months(np.random.default_rng(2), 20, lambda t: 0.06 + 0 * t, start_us=START_US + 1)
    rows = as_rows(entries)
    assert from_rows(rows) == entries
    for damage in (np.nan, -1.0):
        bad = rows.copy()
        bad[3, 4] = damage  # the variance
        with pytest.raises(ValueError, match="history"):
            from_rows(bad)
    with pytest.raises(ValueError, match="order"):
        from_rows(rows[::-1])
    assert from_rows(as_rows([])) == []
