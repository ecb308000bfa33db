"""Damaged tables: every torn row is refused, no sound one, whatever the torn ones hold."""

from itertools import combinations

import numpy as np
import pytest

from monitor_core.arrays import Floats
from service.ingest.tables.torn_rows import ahead, torn

C = 8


def smooth(rng: np.random.Generator, count: int) -> Floats:
    """Columns (count, C) of different level and size that wander, as angles, speeds and currents do."""
    turns = np.cumsum(rng.standard_normal((count, C)), axis=0) * 0.02 + 0.01 * rng.standard_normal((count, C))
    return np.asarray(rng.uniform(3, 5, C) * np.arange(1, C + 1) + turns)


def damaged(rng: np.random.Generator, rows: Floats, first: int, length: int) -> np.ndarray:
    """Which rows are broken for all to see; all of the stretch, in ``rows``, hold what belongs elsewhere."""
    for k in range(first, first + length):
        shift = int(rng.integers(1, C))
        cells = np.roll(rows[k], shift)
        cells[: int(rng.integers(0, 3))] = 0.0
        rows[k] = cells
    broken = np.zeros(len(rows), np.bool_)
    broken[first : first + length] = rng.random(length) < 0.5
    broken[first + int(rng.integers(0, length))] = True
    rows[broken, int(rng.integers(0, C))] = 1e200
    return broken


@pytest.mark.parametrize("at", ["start", "middle", "end"])
def test_damage_is_refused_as_far_as_it_goes(at: str, seed: int) -> None:
    """Of stretches up to 25 rows long, half of which hold nothing absurd."""
    rng = np.random.default_rng(seed)
    for _ in range(30):
        rows, length = smooth(rng, 400), int(rng.integers(1, 26))
        first = {"start": 0, "middle": int(rng.integers(50, 300)), "end": 400 - length}[at]
        broken = damaged(rng, rows, first, length)
        stretch = np.zeros(400, np.bool_)
        stretch[first : first + length] = True
        assert np.array_equal(torn(rows, broken) | broken, stretch)


def test_what_is_no_sign_of_damage(seed: int) -> None:
    # Whatever the steps: only damage makes its neighbours suspect.
    # A column that stands at another value for five rows, long before.
    rng = np.random.default_rng(seed)
    rows, broken = smooth(rng, 100), np.arange(100) == 40
    rows[[39, 41, 60], [2, 3, 4]] = np.nan
    rows[:, 7] = np.nan
    assert not torn(rows, broken).any()
    rows = np.random.default_rng(seed).standard_cauchy((200, C))
    assert not torn(rows, np.zeros(200, np.bool_)).any()
    rows = smooth(np.random.default_rng(seed), 300)
    rows[50:55, 2] += 1e3
    assert not torn(rows, np.arange(300) == 200).any()


def test_sound_rows_between_two_broken_ones_stay(seed: int) -> None:
    """Up to nine of them, where nothing was torn: each broken row costs itself."""
    rng = np.random.default_rng(seed)
    for between in range(1, 10):
        rows, broken = smooth(rng, 200), np.zeros(200, np.bool_)
        broken[[90, 91 + between]] = True
        rows[broken, 3] = -1e66
        assert not torn(rows, broken).any()


@pytest.mark.parametrize("at", [3, 196])
def test_a_few_sound_rows_at_an_end_stay(at: int, seed: int) -> None:
    rows = smooth(np.random.default_rng(seed), 200)
    assert not torn(rows, np.arange(200) == at).any()


def test_rows_that_agree_with_each_other_only_are_refused(seed: int) -> None:
    """Seven, all with cells shifted by one; a row of the right size, but far from any sound one."""
    rng = np.random.default_rng(seed)
    rows, broken, expected = smooth(rng, 60), np.zeros(60, np.bool_), np.zeros(60, np.bool_)
    rows[30:37], broken[[29, 37]], expected[30:37] = np.roll(rows[30:37], 1, axis=1), True, True
    assert np.array_equal(torn(rows, broken), expected)
    rows, broken, expected = smooth(rng, 100), np.zeros(100, np.bool_), np.arange(100) == 50
    broken[35:66] = True
    broken[50] = False
    rows[50] = rows[34]
    assert np.array_equal(torn(rows, broken), expected)


@pytest.mark.parametrize("count", [1, 2, 15])
def test_in_too_few_rows_only_broken_ones_are_refused(count: int) -> None:
    """How far the columns step is not known."""
    rows, broken = np.arange(float(count))[:, None] ** 3, np.arange(count) % 9 == 1
    assert not torn(rows, broken).any()


def test_times_that_run_ahead_do_not_make_the_others_late(seed: int) -> None:
    """Ten wrong times, anywhere ahead: exactly their rows; a time that lies behind is another matter."""
    rng = np.random.default_rng(seed)
    for _ in range(20):
        times = np.cumsum(rng.uniform(0.5, 1.5, 300))
        wrong = np.sort(rng.choice(290, 10, replace=False))
        times[wrong] += rng.uniform(5.0, 1e6, 10)
        times[295] = times[293]
        assert np.flatnonzero(ahead(times, np.ones(300, np.bool_))).tolist() == wrong.tolist()


def test_times_as_they_should_be_or_merely_late(seed: int) -> None:
    """Repeated ones and a few that come too late: the reader counts those itself."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.5, 1.5, 100))
    usable = np.ones(100, np.bool_)
    assert not ahead(times, usable).any()
    times[50], times[70] = times[49], times[30]
    assert not ahead(times, usable).any()
    times[20] = np.nan
    times[40] = 1e9
    usable[[20, 40]] = False
    assert not ahead(times, usable).any()
    assert not ahead(np.zeros(0), np.zeros(0, np.bool_)).any()
    either = np.array([0, 1, 2, 3, 2.5, 3.5])  # which of two comes first is believed
    assert not ahead(either, np.ones(6, np.bool_)).any()


def test_as_many_rows_as_possible_are_believed(seed: int) -> None:
    """Against all subsets of short tables: no rising subset is larger than what is left."""
    rng = np.random.default_rng(seed)
    for _ in range(40):
        times = rng.permutation(9).astype(float)
        left = times[~ahead(times, np.ones(9, np.bool_))]
        believed = np.count_nonzero(left == np.maximum.accumulate(left))
        largest = max(k for k in range(1, 10) for some in combinations(times, k) if (np.diff(some) > 0).all())
        assert believed == largest
