"""The history: roll-ups that are exact whatever comes when and ends the process; bounds of age and size; questions."""

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from service.store.history_query import Question, ask, pages
from service.store.history_rows import QUANTITIES
from service.store.history_store import (
    MOST_PRUNED,
    PERIODS_S,
    RESOLUTIONS,
    SHARE_PRUNED,
    Bounds,
    HistoryPoint,
    HistorySeries,
    HistoryStore,
    Resolution,
)
from tests.service.store.connections import Watched, connections

DAY_S, NOW_S = 86400, 1_760_000_000
AXIS = "demo.axis1"
SERIES = [
    HistorySeries(AXIS, "fm", "N m s/rad"),
    HistorySeries(AXIS, "kT", "1"),
    HistorySeries("demo.axis2", "fm", "N m s/rad"),
]
FOR_EVER = Bounds(dict.fromkeys(RESOLUTIONS, 1e12), 1e12)


@contextmanager
def opened(path: Path, bounds: Bounds = FOR_EVER) -> Iterator[HistoryStore]:
    store = HistoryStore(path, bounds)
    try:
        yield store
    finally:
        store.close()


@contextmanager
def fresh(bounds: Bounds = FOR_EVER) -> Iterator[HistoryStore]:
    """In a folder of its own: hypothesis runs a test many times."""
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder) / "history.sqlite", bounds) as store:
        yield store


def point(t: int, seed: int = 0, series: HistorySeries = SERIES[0]) -> HistoryPoint:
    """Values that a float of four bytes holds exactly."""
    values = np.random.default_rng([seed, t]).normal(size=len(QUANTITIES)).astype(np.float32)
    return HistoryPoint(series, t, values.tolist())


def rows(store: HistoryStore, table: Resolution) -> dict[tuple[HistorySeries, int], tuple[Any, ...]]:
    """Count, mean, least and largest by series and time."""
    found = {}
    with store.read() as view:
        for series in {s.axis: s for s in SERIES}.values():
            for number, name in view.series(series.axis, None).items():
                r = view.rows(table, number, 0, 1 << 40)
                for k, t in enumerate(r.t.tolist()):
                    found[name, t] = (int(r.n[k]), r.mean[k], r.low[k], r.high[k])
    return found


def assert_true(store: HistoryStore, points: Sequence[HistoryPoint]) -> None:
    """Each table holds the count, mean, least and largest of exactly these points."""
    for table, period in PERIODS_S.items():
        by_key: dict[tuple[HistorySeries, int], list[Sequence[float]]] = {}
        for p in points:
            by_key.setdefault((p.series, p.t // period * period), []).append(p.values)
        found = rows(store, table)
        assert found.keys() == by_key.keys(), table
        for key, values in by_key.items():
            n, mean, low, high = found[key]
            assert n == len(values)
            np.testing.assert_allclose(mean, np.mean(values, axis=0), rtol=1e-12, atol=1e-12)
            np.testing.assert_array_equal(low, np.min(values, axis=0))
            np.testing.assert_array_equal(high, np.max(values, axis=0))


TIMES = st.one_of(st.integers(NOW_S, NOW_S + 300), st.integers(NOW_S, NOW_S + 3 * DAY_S), st.integers(0, 2 * NOW_S))
"""Close together, so that they share rows, and far apart, with gaps; in any order, as after a clock was set back"""
POINTS = st.builds(point, TIMES, st.integers(0, 3), st.sampled_from(SERIES))


@settings(max_examples=25)
@given(st.lists(st.lists(POINTS, min_size=1, max_size=12), max_size=6))
def test_roll_ups_are_those_of_all_points_whatever_comes_when(batches: list[list[HistoryPoint]]) -> None:
    with fresh() as store:
        for batch in batches:
            store.add(batch)
        assert_true(store, [p for batch in batches for p in batch])


def test_a_number_that_is_not_finite_spoils_its_own_quantity_only() -> None:
    broken = [*point(NOW_S).values]
    broken[3], broken[5] = np.nan, np.inf
    with fresh() as store:
        store.add([point(NOW_S + 1)])
        store.add([HistoryPoint(SERIES[0], NOW_S, broken)])
        n, mean, low, high = rows(store, "day")[SERIES[0], NOW_S // DAY_S * DAY_S]
        assert n == 2
        assert np.isfinite(np.array([mean, low, high])).all(axis=0).tolist() == [
            k not in (3, 5) for k in range(len(QUANTITIES))
        ]
        assert (mean[5], high[5]) == (np.inf, np.inf)


# --- whatever ends the process ------------------------------------------------------------------------------


def copied(path: Path, target: Path) -> Path:
    """The file, as a process that is killed now leaves it."""
    target.mkdir()
    for suffix in ("", "-wal"):
        shutil.copy(f"{path}{suffix}", target / f"{path.name}{suffix}")
    return target / path.name


def test_killed_at_any_statement_a_point_is_everywhere_or_nowhere(tmp_path: Path) -> None:
    path = tmp_path / "history.sqlite"
    first = [point(NOW_S + 10 * k, series=s) for k in range(400) for s in SERIES]
    second = [point(NOW_S + 10 * k + 5, seed=1, series=s) for k in range(400) for s in SERIES]
    copies = list[Path]()
    with connections(Watched) as made, opened(path) as store:
        store.add(first)
        writer = made[0]
        writer.execute("PRAGMA cache_size=10")  # what is not committed gets into the file, too
        writer.before = lambda: copies.append(copied(path, tmp_path / f"{len(copies)}"))
        store.add(second)
        writer.before()
        writer.before = lambda: None
    assert len(copies) > 100
    sizes = {copy.with_name(f"{copy.name}-wal").stat().st_size for copy in copies[:-1]}
    assert len(sizes) > 5, "the file grew before the commit"
    before_after = list[int]()
    for copy in copies[:: max(1, len(copies) // 40)] + copies[-1:]:
        with opened(copy) as store:
            counts = {sum(row[0] for row in rows(store, table).values()) for table in RESOLUTIONS}
            assert counts in ({len(first)}, {len(first) + len(second)})
            before_after += counts
    assert before_after == sorted(before_after)
    with opened(copies[-1]) as store:
        assert_true(store, [*first, *second])


def test_what_cannot_be_committed_is_not_there_at_all(tmp_path: Path) -> None:
    with opened(tmp_path / "history.sqlite") as store:
        store.add([point(NOW_S)])
        with pytest.raises(TypeError):
            store.add([point(NOW_S + 1, series=SERIES[1]), HistoryPoint(SERIES[2], None, [0.0] * 7)])  # type: ignore[arg-type]
        store.add([point(NOW_S + 1, series=SERIES[2])])
        assert_true(store, [point(NOW_S), point(NOW_S + 1, series=SERIES[2])])


# --- bounds -------------------------------------------------------------------------------------------------


def test_each_resolution_is_kept_for_its_time(tmp_path: Path) -> None:
    ages: dict[Resolution, float] = {"raw": 600, "minute": 2 * 3600, "hour": DAY_S, "day": 3 * DAY_S}
    times = range(NOW_S - 5 * DAY_S, NOW_S, 200)
    with opened(tmp_path / "history.sqlite", Bounds(ages, 1e12)) as store:
        store.add([point(t, series=s) for t in times for s in SERIES[:2]])
        for _ in range(20):
            store.prune(NOW_S)
        for table, period in PERIODS_S.items():
            kept = {t for _, t in rows(store, table)}
            expected = {t // period * period for t in times}
            assert kept == {t for t in expected if t + period > NOW_S - ages[table]}
            assert kept


def test_a_clock_that_is_ahead_for_a_moment_costs_little(tmp_path: Path) -> None:
    with opened(tmp_path / "history.sqlite", Bounds({"raw": DAY_S}, 1e12)) as store:
        store.add([point(NOW_S + k) for k in range(3 * MOST_PRUNED)])
        store.prune(2 * NOW_S)
        assert len(rows(store, "raw")) == 2 * MOST_PRUNED


def test_all_series_have_their_turn(tmp_path: Path) -> None:
    series = [HistorySeries(AXIS, f"p{k}", "1") for k in range(3 * SHARE_PRUNED)]
    with opened(tmp_path / "history.sqlite", Bounds({"raw": DAY_S}, 1e12)) as store:
        store.prune(NOW_S)
        store.add([point(0, series=s) for s in series])
        for _ in range(SHARE_PRUNED):
            assert len(rows(store, "raw")) > 0
            store.prune(NOW_S)
        assert len(rows(store, "raw")) == 0


def test_the_file_stays_below_its_bound_and_the_oldest_of_the_largest_goes_first(tmp_path: Path) -> None:
    path, bound = tmp_path / "history.sqlite", 400_000
    with opened(path, Bounds(dict.fromkeys(RESOLUTIONS, 1e12), bound)) as store:
        for k in range(400):
            store.add([point(NOW_S + 600 * k + 10 * i, series=s) for i in range(60) for s in SERIES[:1]])
            store.prune(NOW_S + 600 * k)
            assert path.stat().st_size < 1.1 * bound
        raw, day = rows(store, "raw"), rows(store, "day")
        assert 0.5 * bound < path.stat().st_size
    newest = NOW_S + 600 * 399 + 590
    assert max(t for _, t in raw) == newest
    assert min(t for _, t in raw) > NOW_S + 600 * 100
    assert len(day) == newest // DAY_S - NOW_S // DAY_S + 1, "the days are small: they stay"


# --- questions ----------------------------------------------------------------------------------------------


SPANS = st.one_of(st.none(), st.integers(NOW_S - DAY_S, NOW_S + 500 * DAY_S))
SOME_TIMES = st.lists(
    st.one_of(st.integers(NOW_S, NOW_S + 3600), st.integers(NOW_S, NOW_S + 400 * DAY_S)),
    min_size=1, max_size=60,
)  # fmt: skip


@settings(max_examples=40)
@given(SOME_TIMES, SPANS, SPANS, st.integers(1, 40), st.sampled_from([0.5, 7.0, 10.0, 900.0]))
@example([1_760_000_000, 1_760_832_000], None, None, 1, 0.5)  # on both sides of a boundary of ten days
def test_the_answer_has_at_most_the_wanted_rows_and_they_are_true(
    times: list[int], since: int | None, until: int | None, most: int, interval_s: float
) -> None:
    found = [point(t, seed=k) for k, t in enumerate(times)]
    with fresh() as store:
        store.add(found)
        answer = ask(store, Question(AXIS, interval_s, "fm", since, until, most))
    step, period = answer.step_s, PERIODS_S[answer.resolution]
    assert len(answer.t) <= most
    assert answer.next_s is None
    (course,) = answer.courses
    assert (np.diff(answer.t) > 0).all()
    begin = min(times) if since is None else since
    end = 1 << 40 if until is None else -(-until // period) * period
    asked = {k: t for k, t in enumerate(times) if begin // step * step <= t < end}
    assert course.rows.n.sum() == len(asked)
    for m, t in enumerate(answer.t.tolist()):
        inside = [found[k].values for k, at in asked.items() if t <= at < t + step]
        assert course.rows.n[m] == len(inside)
        if inside:
            np.testing.assert_allclose(course.rows.mean[m], np.mean(inside, axis=0), rtol=1e-12, atol=1e-12)
            np.testing.assert_array_equal(course.rows.low[m], np.min(inside, axis=0))
            np.testing.assert_array_equal(course.rows.high[m], np.max(inside, axis=0))
        else:
            assert np.isnan(course.rows.mean[m]).all()
            assert course.rows.n[m - 1] > 0, "a gap has one row, at its beginning"


@pytest.mark.parametrize(
    ("length_s", "points", "expected"),
    [
        (3600, 600, ("raw", 10)),
        (5 * 3600, 600, ("raw", 30)),
        (DAY_S, 600, ("minute", 180)),
        (30 * DAY_S, 600, ("hour", 2 * 3600)),
        (365 * DAY_S, 600, ("day", DAY_S)),
        (365 * DAY_S, 5000, ("hour", 2 * 3600)),
        (365 * DAY_S, 100, ("day", 4 * DAY_S)),
    ],
)
def test_the_resolution_follows_from_the_range(
    tmp_path: Path, length_s: int, points: int, expected: tuple[str, int]
) -> None:
    with opened(tmp_path / "history.sqlite") as store:
        begin = NOW_S // DAY_S * DAY_S
        store.add([point(begin), point(begin + length_s - 10)])
        answer = ask(store, Question(AXIS, 10, None, begin, begin + length_s, points))
        assert (answer.resolution, answer.step_s) == expected


def test_where_the_fine_rows_are_gone_the_coarse_ones_answer(tmp_path: Path) -> None:
    times = range(NOW_S - 10 * DAY_S, NOW_S, 3600)
    ages: dict[Resolution, float] = {"raw": DAY_S, "minute": 3 * DAY_S}
    with opened(tmp_path / "history.sqlite", Bounds(ages, 1e12)) as store:
        store.add([point(t) for t in times])
        store.prune(NOW_S)

        def resolution(days: float, points: int = 5000) -> str:
            since_s = NOW_S - round(days * DAY_S)
            answer = ask(store, Question(AXIS, 10, None, since_s, since_s + 3600, points))
            assert sum(answer.courses[0].rows.n) >= 1
            return answer.resolution

        assert [resolution(days) for days in (0.5, 2, 5)] == ["raw", "minute", "hour"]
        (answer,) = pages(store, Question(AXIS, 10))
        assert answer.resolution == "hour"
        assert answer.courses[0].rows.n.sum() == len(times)


def test_all_rows_as_stored_come_in_parts_once(tmp_path: Path) -> None:
    dense, sparse = range(NOW_S, NOW_S + 1000, 10), range(NOW_S + 5, NOW_S + 100_000, 970)
    with opened(tmp_path / "history.sqlite") as store:
        store.add([*(point(t) for t in dense), *(point(t, series=SERIES[1]) for t in sparse)])
        for most in (1, 7, 300):
            since: int | None = None
            found: dict[str, list[int]] = {"fm": [], "kT": []}
            while True:
                answer = ask(store, Question(AXIS, 10, None, since, None, most, "raw"))
                assert len(answer.t) <= most
                for series, r in answer.courses:
                    found[series.parameter] += answer.t[r.n > 0].tolist()
                since = answer.next_s
                if since is None:
                    break
            assert found == {"fm": list(dense), "kT": list(sparse)}


def test_it_is_there_after_a_restart_and_rows_that_were_damaged_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "history.sqlite"
    with opened(path) as store:
        store.add([point(NOW_S), point(NOW_S + 10)])
    with opened(path) as store:
        assert_true(store, [point(NOW_S), point(NOW_S + 10)])
    with sqlite3.connect(path) as file:
        file.execute("UPDATE raw SET cells = x'00' WHERE t = ?", [NOW_S])
    file.close()
    with opened(path) as store:
        store.add([point(NOW_S, seed=5)])
        assert [t for _, t in rows(store, "raw")] == [NOW_S, NOW_S + 10]
        assert rows(store, "raw")[SERIES[0], NOW_S][0] == 1
