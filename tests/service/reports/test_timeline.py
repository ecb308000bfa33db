"""The line of times that a replay is drawn on; times and reasons in words."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.kernel.state import COUNTERS
from service.ingest.assemble import REASONS as DROPPED
from service.ingest.bus_samples import FRAME_REASONS
from service.ingest.unwrap import AMBIGUOUS
from service.reports.replay_result import REASONS, dated, duration, time_unit
from service.reports.timeline import PAUSE_S, Timeline, Times

S = 1_000_000
steps = st.lists(
    st.sampled_from([5_000, 5_000, 4_321, 700_000, 59 * S, 61 * S, 3600 * S, -1, -5 * S]), max_size=30
)


def line(t: Times, cuts: list[int]) -> tuple[Timeline, Times]:
    """Of samples that came in blocks."""
    timeline = Timeline()
    edges = [0, *sorted(c % (len(t) + 1) for c in cuts), len(t)]
    return timeline, np.concatenate([timeline.take(t[a:b]) for a, b in pairwise(edges)])


@given(steps=steps, cuts=st.lists(st.integers(0, 30), max_size=4), start=st.integers(0, 10**15))
def test_it_goes_on_whatever_the_times_do(steps: list[int], cuts: list[int], start: int) -> None:
    t = start + np.cumsum(np.array([0, *steps], np.int64))
    timeline, where = line(t, cuts)
    known = [0 <= step <= PAUSE_S * 1e6 for step in steps]
    assert where[0] == 0
    assert (np.diff(where) == [step if k else 0 for step, k in zip(steps, known, strict=True)]).all()
    assert timeline.end_us == where[-1]
    assert timeline.start_us == start
    assert timeline.pauses == known.count(False)
    whole, other = line(t, [])
    assert (where == other).all()
    assert timeline.stretches == whole.stretches
    for at, time in zip(where.tolist(), t.tolist(), strict=True):
        last = max(w for w, other in zip(where.tolist(), t.tolist(), strict=True) if other == time)
        found = timeline.find(time)
        assert found is not None
        assert found * 1e6 >= last - 0.5 >= at - 0.5  # the latest place of that time


def test_times_that_were_not_are_nowhere() -> None:
    timeline, _ = line(np.array([0, S, 100 * S, 101 * S]), [])
    assert [timeline.find(t) for t in (None, -1, S // 2, 50 * S, 100 * S, 102 * S)] == [
        *(None, None, 0.5),
        *(None, 1.0, None),
    ]
    assert [round(one.pause_s) for one in timeline.stretches] == [0, 99]
    assert Timeline().find(0) is None


def test_only_so_many_stretches_are_known() -> None:
    timeline, where = line(np.arange(10_000) * 100 * S, [1234])
    assert (timeline.pauses, len(timeline.stretches), where[-1]) == (9_999, 4096, 0)


def test_every_reason_has_words() -> None:
    assert {*COUNTERS, *DROPPED, *FRAME_REASONS, AMBIGUOUS} <= REASONS.keys()


@pytest.mark.parametrize(
    ("s", "words"),
    [(0.0, "0 s"), (9.92, "9.9 s"), (-90.0, "90 s"), (300.0, "5 min"), (18_000.0, "5 h"), (8e5, "9.3 d")],
)
def test_durations(s: float, words: str) -> None:
    assert duration(s) == words


def test_times_in_the_unit_of_the_record() -> None:
    assert [time_unit(s).name for s in (1, 600, 601, 86_400, 1e6)] == ["s", "s", "min", "h", "d"]
    assert [time_unit(9000).written(s) for s in (90.0, None)] == ["1.50 min", ""]
    assert [dated(t) for t in (None, 5_000_000, 1_760_000_000_123_456)] == ["", "", "2025-10-09 08:53:20.1"]
