"""A month of six axes, fast-forwarded into the history: its size, its bounds, and the time of questions about it."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import pytest

from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisMonitor, AxisStatus, Observation, Status
from monitor_core.settings import Settings
from service.pipeline.persistence.history_recording import POINTS_AT_ONCE, HistoryRecording
from service.store.history_query import Question, ask
from service.store.history_store import PERIODS_S, Bounds, HistoryPoint, HistorySeries, HistoryStore, Resolution
from service.web.history_json import history_json

pytestmark = pytest.mark.soak

DAY_S, NOW_S, INTERVAL_S = 86400, 1_760_000_000, 10
AXES = [f"cell.axis{k}" for k in range(1, 7)]
AGES: dict[Resolution, float] = {
    "raw": 7 * DAY_S,
    "minute": 60 * DAY_S,
    "hour": 730 * DAY_S,
    "day": 3650 * DAY_S,
}
PARAMETERS = AxisMonitor(reference_model(), Settings.paper(interval_s=0.005)).status()


def statuses(days: float, seed: int) -> Iterator[AxisStatus]:
    """One each 10 s; at night the axes stand still."""
    random = np.random.default_rng(seed)
    for t in range(NOW_S, NOW_S + round(days * DAY_S), INTERVAL_S):
        if t % DAY_S >= DAY_S / 4:
            noise = random.normal(size=3).tolist()
            found = tuple(
                replace(
                    p, status=Status.TRACKING, not_tested=None, observation=Observation.OBSERVED,
                    estimate=p.nominal * (1 + 0.01 * e), g_up=abs(e),
                )
                for p, e in zip(PARAMETERS.parameters, noise, strict=True)
            )  # fmt: skip
            yield replace(PARAMETERS, time_us=t * 1_000_000, parameters=found)


def sizes(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"


def timed(store: HistoryStore, since_s: int, until_s: int, points: int) -> float:
    """Processor time of a question of all parameters with its JSON, the longest of five [s]."""
    longest = 0.0
    for _ in range(5):
        begin = process_time()
        answer = ask(store, Question(AXES[2], INTERVAL_S, None, since_s, until_s, points))
        text = history_json(AXES[2], answer, {})
        longest = max(longest, process_time() - begin)
    print(f"{points} points of {(until_s - since_s) / DAY_S:g} days: {longest * 1e3:.0f} ms from {answer.resolution},"
          f" {len(answer.t)} rows, {len(text) / 1e3:.0f} kB")  # fmt: skip
    return longest


def test_thirty_days_are_written_kept_as_configured_and_read_at_once(tmp_path: Path, seed: int) -> None:
    path, now_s, taken = tmp_path / "history.sqlite", [0.0], 0
    recording = HistoryRecording(
        lambda: HistoryStore(path, Bounds(AGES, 1e9)), INTERVAL_S, lambda: now_s[0], lambda: now_s[0]
    )
    begin = perf_counter()
    for k, status in enumerate(statuses(30, seed)):
        assert status.time_us is not None
        now_s[0] = status.time_us * 1e-6
        for axis in AXES:
            recording.take(axis, status, paused=False)
        taken += len(AXES) * len(status.parameters)
        if k % POINTS_AT_ONCE == POINTS_AT_ONCE - 1:
            recording.write()
    recording.write()
    print(f"{taken} points in {perf_counter() - begin:.0f} s, {sizes(path)}")
    store, end_s = recording.store, NOW_S + 30 * DAY_S
    assert store is not None
    assert recording.state().dropped == {"memory full": 0}
    assert path.stat().st_size < 200e6
    hours = ask(store, Question(AXES[0], INTERVAL_S, resolution="hour", points=5000))
    assert sum(int(c.rows.n.sum()) for c in hours.courses) == taken // len(AXES)
    raw = ask(store, Question(AXES[0], INTERVAL_S, resolution="raw", points=1))
    assert raw.t[0] > end_s - 7.2 * DAY_S
    for days in (1, 7, 30):
        for points in (600, 5000):
            assert timed(store, end_s - days * DAY_S, end_s, points) < (0.2 if points == 600 else 1.0)
    recording.stop()


def test_a_year_of_hours_and_days_is_read_at_once(tmp_path: Path) -> None:
    """A point each five minutes for a year: as many hours and days, with more than one point, as in a real year."""
    path = tmp_path / "history.sqlite"
    store = HistoryStore(path, Bounds({**AGES, "raw": 0.0}, 1e9))
    series = [HistorySeries(AXES[2], f"p{k}", "1") for k in range(3)]
    for begin in range(NOW_S, NOW_S + 365 * DAY_S, DAY_S):
        store.add([HistoryPoint(s, t, [t % 97] * 7) for t in range(begin, begin + DAY_S, 300) for s in series])
        store.prune(begin)
    print(f"a year: {sizes(path)}")
    for points in (600, 5000):
        assert timed(store, NOW_S, NOW_S + 365 * DAY_S, points) < (0.2 if points == 600 else 1.0)
    store.close()


def test_six_axes_stay_far_below_the_bound_for_a_year(tmp_path: Path) -> None:
    """Prints the bytes of a parameter and a day in docs/operation.md."""
    store = HistoryStore(tmp_path / "history.sqlite", Bounds(AGES, 1e9))
    series = [HistorySeries(axis, p, "1") for axis in AXES for p in ("kT", "1/Ja", "fm")]
    for begin in range(NOW_S, NOW_S + 2 * DAY_S, 60):  # as they come: a minute of all at once
        store.add([HistoryPoint(s, t, [t % 97] * 7) for t in range(begin, begin + 60, INTERVAL_S) for s in series])
    per_day = {}
    with closing(sqlite3.connect(tmp_path / "history.sqlite")) as connection:
        for table, period_s in PERIODS_S.items():
            pages = "SELECT sum(pgsize) FROM dbstat WHERE name = ?"
            (size,) = connection.execute(pages, [table]).fetchone()
            (number,) = connection.execute(f"SELECT count(*) FROM {table}").fetchone()
            per_day[table] = size / number * DAY_S / max(period_s, INTERVAL_S)
    year = len(series) * sum(per_day[table] * min(365, age_s / DAY_S) for table, age_s in AGES.items())
    print({table: f"{size:.0f} bytes a day" for table, size in per_day.items()}, f"a year: {year / 1e6:.0f} MB")
    assert year < 0.5e9
    store.close()
