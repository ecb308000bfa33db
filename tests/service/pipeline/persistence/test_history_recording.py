"""Points of the history: which are taken, and what becomes of them while the disk does not take them."""

import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisMonitor, AxisStatus, NotTested, Observation, Status
from monitor_core.settings import Settings
from service.pipeline.persistence import history_recording
from service.pipeline.persistence.history_recording import FULL, RETRY_S, HistoryRecording
from service.store import database
from service.store.database import StoreError
from service.store.history_query import Question, ask
from service.store.history_store import RESOLUTIONS, Bounds, HistoryStore
from tests.end_to_end.processes import wait_for
from tests.service.store.connections import connections

AXIS, NOW_S = "cell.axis1", 1_760_000_000
BOUNDS = Bounds(dict.fromkeys(RESOLUTIONS, 1e12), 1e12)
_STATUS = AxisMonitor(reference_model(), Settings.paper(interval_s=0.005)).status()
TRACKING = tuple(
    replace(p, status=Status.TRACKING, not_tested=None, observation=Observation.WEAK, estimate=p.nominal * 1.5)
    for p in _STATUS.parameters
)
NUMBER = len(TRACKING)


def at(t_s: float, **changes: Any) -> AxisStatus:
    """A status with all parameters tracked, or with these changes of the first."""
    first = replace(TRACKING[0], **changes)
    return replace(_STATUS, time_us=NOW_S * 1_000_000 + round(t_s * 1e6), parameters=(first, *TRACKING[1:]))


class Bench:
    """A recording whose clock moves by hand."""

    def __init__(
        self,
        path: Path,
        interval_s: float = 10.0,
        most: int = 1000,
        opened: Callable[[Path, Bounds], HistoryStore] = HistoryStore,
    ) -> None:
        self.path, self.clock = path, 0.0
        self.recording = HistoryRecording(
            lambda: opened(path, BOUNDS), interval_s, lambda: self.clock, lambda: NOW_S, most
        )

    def take(self, status: AxisStatus, paused: bool = False) -> None:
        if self.recording.is_due(AXIS, status.time_us):
            self.recording.take(AXIS, status, paused)

    def write(self) -> None:
        """After the time of a retry."""
        self.clock += RETRY_S
        self.recording.write()

    def times(self, parameter: str | None = None) -> list[int]:
        """When there are points, after now."""
        assert self.recording.store is not None
        wanted = parameter or TRACKING[0].name
        answer = ask(self.recording.store, Question(AXIS, 1.0, wanted, points=5000, resolution="raw"))
        return [t - NOW_S for c in answer.courses for t in answer.t[c.rows.n > 0].tolist()]

    connection: sqlite3.Connection
    """Of the file that was there at first, its writer."""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 0.02)
    bench = Bench(tmp_path / "history.sqlite")
    with connections() as opened:
        bench.recording.write()
    bench.connection = opened[0]
    yield bench
    bench.recording.stop()


# --- which points are taken ---------------------------------------------------------------------------------


def test_the_first_status_of_each_interval_is_a_point(bench: Bench) -> None:
    for t_s in (-0.1, 0, 0.1, 9.9, 10.2, 11, 55, 55.1):
        bench.take(at(t_s))
    bench.take(replace(_STATUS, time_us=None))
    bench.write()
    assert bench.times() == [-10, 0, 10, 50]
    bench.take(at(12))  # the clock was set back: there is no gap of that length
    bench.take(at(21))
    bench.write()
    assert bench.times() == [-10, 0, 10, 20, 50]


@pytest.mark.parametrize("paused", [True, False])
def test_an_interval_that_begins_without_estimates_has_the_first_that_follow(bench: Bench, paused: bool) -> None:
    """A short run would else have none at all."""
    none = at(1) if paused else replace(_STATUS, time_us=at(1).time_us)
    bench.take(none, paused)
    bench.take(at(3))
    bench.write()
    assert bench.times() == [0]


def test_a_point_is_due_once_in_each_interval_and_is_looked_for_now_and_then(bench: Bench) -> None:
    def is_due(t_s: float) -> bool:
        return bench.recording.is_due(AXIS, at(t_s).time_us)

    assert not bench.recording.is_due(AXIS, None)
    assert is_due(1)
    bench.take(at(1, status=Status.SEEDING), paused=True)
    assert [is_due(t_s) for t_s in (1, 1.4, 1.5, 9)] == [False, False, True, True]
    bench.take(at(2))
    assert [is_due(t_s) for t_s in (2.6, 9.9, 10, 1.9, -0.1)] == [False, False, True, False, True]


def test_a_point_has_all_quantities(bench: Bench) -> None:
    bench.take(at(0, nominal=2.0, estimate=2.5, standard_deviation=0.25, g_up=3.0, g_down=4.0, h=5.0))
    bench.write()
    assert bench.recording.store is not None
    answer = ask(bench.recording.store, Question(AXIS, 10.0, TRACKING[0].name))
    assert answer.courses[0].rows.mean.tolist() == [[2.5, 0.5, 0.25, 3.0, 4.0, 5.0, 0.5]]
    assert answer.courses[0].series.unit == TRACKING[0].unit


@pytest.mark.parametrize(
    "changes",
    [
        {"status": Status.SEEDING},
        {"status": Status.SETTLING},
        {"status": Status.WAITING},
        {"status": Status.INVALID},
        {"not_tested": NotTested.CONDITIONS},
        {"estimate": float("nan")},
        {},
    ],
)
def test_learning_and_what_is_invalid_is_a_gap_of_this_parameter_and_a_pause_of_all(
    bench: Bench, changes: dict[str, object]
) -> None:
    bench.take(at(0))
    bench.take(at(10, **changes), paused=not changes)
    bench.take(at(20, not_tested=NotTested.NOT_OBSERVED))
    bench.write()
    assert bench.times() == [0, 20]
    assert bench.times(TRACKING[1].name) == ([0, 10, 20] if changes else [0, 20])


# --- the disk does not take them ----------------------------------------------------------------------------


@contextmanager
def locked(bench: Bench) -> Iterator[None]:
    with closing(sqlite3.connect(bench.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield


@contextmanager
def read_only(bench: Bench) -> Iterator[None]:
    bench.connection.execute("PRAGMA query_only=1")
    yield
    bench.connection.execute("PRAGMA query_only=0")


@contextmanager
def full(bench: Bench) -> Iterator[None]:
    bench.connection.execute("PRAGMA max_page_count=1")  # no more than it has
    yield
    bench.connection.execute("PRAGMA max_page_count=1000000")


@pytest.mark.parametrize(
    ("trouble", "why"),
    [(locked, "locked"), (read_only, "readonly"), (full, "full")],
    ids=["locked", "read-only", "full"],
)
def test_points_wait_in_memory_and_are_written_later(bench: Bench, trouble: Callable[[Bench], Any], why: str) -> None:
    bench.take(at(0))
    bench.write()
    with trouble(bench):
        for k in range(1, 60):
            bench.take(at(10 * k))
            bench.write()
        state = bench.recording.state()
        assert state.problem is not None
        assert why in state.problem
        assert state.dropped == {FULL: 0}
        written = len(bench.times())  # a full disk takes some, which find room in the pages that are there
        assert state.waiting == (60 - written) * NUMBER >= 20 * NUMBER
        bench.take(at(600))
    bench.recording.write()
    assert len(bench.times()) == written, "no second try so soon"
    bench.write()
    assert bench.recording.state() == (0, {FULL: 0}, None, ())
    assert bench.times() == [10 * k for k in range(61)]


def test_what_is_too_much_for_the_memory_is_dropped_and_counted_the_oldest_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 0.02)
    bench = Bench(tmp_path / "history.sqlite", most=10 * NUMBER)
    bench.write()
    with locked(bench):
        for k in range(25):
            bench.take(at(10 * k))
            bench.write()
        state = bench.recording.state()
        assert (state.waiting, state.dropped) == (10 * NUMBER, {FULL: 15 * NUMBER})
    bench.write()
    assert bench.times() == [10 * k for k in range(15, 25)]
    bench.recording.stop()


def test_a_file_that_becomes_damaged_is_set_aside_and_a_new_one_takes_what_waits(bench: Bench) -> None:
    for k in range(500):
        bench.take(at(10 * k))
    bench.write()
    bench.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    damaged = bytearray(bench.path.read_bytes())
    damaged[4096:] = bytes(len(damaged) - 4096)
    bench.path.write_bytes(damaged)
    bench.connection.execute("PRAGMA shrink_memory")
    bench.take(at(6000))
    bench.write()
    assert "malformed" in str(bench.recording.state().problem)
    assert bench.recording.state().waiting == NUMBER
    bench.take(at(6010))
    bench.write()
    state = bench.recording.state()
    assert (state.waiting, state.problem) == (0, None)
    (message,) = state.messages
    assert "is damaged" in message
    assert "a new file has been started" in message
    assert bench.times() == [6000, 6010]
    assert len(list(bench.path.parent.glob("history.sqlite.damaged-*Z"))) == 1


def test_a_file_that_cannot_be_opened_is_tried_again(tmp_path: Path) -> None:
    tries: list[int] = []

    def opened(path: Path, bounds: Bounds) -> HistoryStore:
        tries.append(1)
        if len(tries) < 3:
            raise StoreError("history.sqlite.lock: No space left on device")
        return HistoryStore(path, bounds)

    bench = Bench(tmp_path / "history.sqlite", opened=opened)
    for k in range(3):
        bench.take(at(10 * k))
        bench.write()
        assert (bench.recording.store is not None) == (k == 2)
    assert bench.times() == [0, 10, 20]
    bench.recording.stop()


def test_what_waits_is_written_when_somebody_wants_to_read_it_once_in_an_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history_recording, "FRESH_S", 60.0)
    bench = Bench(tmp_path / "history.sqlite", interval_s=100.0)
    bench.take(at(0))
    bench.recording.freshen()  # nobody writes yet
    bench.recording.start()
    wait_for(lambda: bench.recording.store is not None and bench.times() == [0])
    bench.take(at(100))
    bench.recording.freshen()  # it was written a moment ago
    assert bench.times() == [0]
    bench.clock += 100.0
    bench.recording.freshen()
    assert bench.times() == [0, 100]
    bench.recording.stop()


def test_the_thread_writes_what_waits_when_it_is_stopped(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "history.sqlite", interval_s=100.0)
    bench.recording.start()
    bench.take(at(0))
    bench.recording.stop()
    assert "history" not in {thread.name for thread in threading.enumerate()}
    again = Bench(tmp_path / "history.sqlite")
    again.write()
    assert again.times() == [0]
    again.recording.stop()
