"""Laws of the engine, bit by bit: blocks, checkpoints, unusable samples and the time of day change no estimate."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.detection import Alarm, AlarmKey
from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.kernel.state import COUNTERS
from monitor_core.monitoring import AlarmChange, AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.cases import CASES, Case, record
from tests.core.laws import (
    SAMPLES,
    WAYS,
    Way,
    cases,
    conditioned,
    fates,
    law,
    lively,
    restored,
    seeds,
    state,
    ways,
    with_pause,
)


@law
@given(seed=seeds, case=cases, way=ways, cuts=st.lists(st.integers(0, SAMPLES), max_size=4))
def test_blocks_may_end_anywhere_and_states_be_saved(
    seed: int, case: Case, way: Way, cuts: list[int]
) -> None:
    block, s = conditioned(seed, case, with_pause(seed, case)), lively(case, way)
    whole, going, saved = (AxisMonitor(case.model, s) for _ in range(3))
    changes = list[AlarmChange]()
    for start, stop in pairwise([0, *sorted(cuts), SAMPLES]):
        piece = block.select(slice(start, stop))
        found = going.update(piece)
        assert saved.update(piece) == found
        assert saved.open_alarms == going.open_alarms
        saved, changes = restored(saved), changes + found
    assert _latest(changes) == _latest(whole.update(block))
    assert state(saved) == state(going) == state(whole)


def _latest(changes: Iterable[AlarmChange]) -> dict[AlarmKey, Alarm]:
    """Each alarm in its latest form: of two blocks, an alarm may be raised in one and renamed in the other."""
    return {change.alarm.key: change.alarm for change in changes}


UNUSABLE = {
    "not_finite": st.sampled_from([np.nan, np.inf, -np.inf]),
    "not_increasing": st.sampled_from([0, 1, 5_000, 20_000]),  # us back in time
}


def with_unusable(rec: Experiment, at: int, reason: str, value: float, torque: bool) -> Experiment:
    """The record with one more sample, right behind sample ``at``."""
    t, u, y = rec.t_us[at], rec.u[at] + 1.0, rec.y[at] + 1.0
    if reason == "not_increasing":
        t -= int(value)
    elif torque:
        t, u = t + 1_000, value
    else:
        t, y = t + 1_000, value
    return Experiment(*(np.insert(f, at + 1, new) for f, new in zip(rec, (t, u, y), strict=True)))


@law
@given(seed=seeds, case=cases, data=st.data())
def test_unusable_samples_are_counted_and_change_nothing(seed: int, case: Case, data: st.DataObject) -> None:
    rec = record(seed, case, SAMPLES, jitter=0.3, gaps=1)
    clean, dirty = (AxisMonitor(case.model, lively(case)) for _ in range(2))
    expected = clean.update(SampleBlock(*rec))
    added = dict.fromkeys(UNUSABLE, 0)
    for at in sorted(data.draw(st.sets(st.integers(0, SAMPLES - 1), max_size=10)), reverse=True):
        reason = data.draw(st.sampled_from(sorted(UNUSABLE)))
        rec = with_unusable(rec, at, reason, data.draw(UNUSABLE[reason]), data.draw(st.booleans()))
        added[reason] += 1
    assert dirty.update(SampleBlock(*rec)) == expected
    assert state(dirty)[0] == state(clean)[0]
    before, after = (np.array(m.batch.state.counts[:, 0]) for m in (clean, dirty))
    counted = dict(zip(COUNTERS, after - before, strict=True))
    assert counted == dict.fromkeys(COUNTERS, 0) | added


@law
@given(seed=seeds, case=cases, shift=st.integers(-(2**60), 2**60))
def test_only_differences_of_time_count(seed: int, case: Case, shift: int) -> None:
    rec = record(seed, case, SAMPLES, jitter=0.3, gaps=1)
    here, there = (AxisMonitor(case.model, lively(case)) for _ in range(2))
    expected = here.update(SampleBlock(*rec))
    found = there.update(SampleBlock(*rec._replace(t_us=rec.t_us + shift)))
    assert state(there)[0] == state(here)[0]
    assert [change.alarm.raised_us - shift for change in found] == [c.alarm.raised_us for c in expected]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_laws_see_something_happen(case: Case, seed: int) -> None:
    """Crossings, updates and gaps do occur in such records: else the laws above would hold of nothing."""
    episodes = 0
    for k in range(5):
        monitor = AxisMonitor(case.model, lively(case))
        episodes += len(monitor.update(SampleBlock(*record(seed + k, case, SAMPLES, jitter=0.3, gaps=1))))
        found = fates(monitor)
        assert sum(found.values()) - found.get("projected", 0) == SAMPLES == monitor.status().samples
        assert found["gap"] >= 1
        assert found["used"] > SAMPLES / 2
    assert episodes > 3


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_the_ways_differ(way: Way, seed: int) -> None:
    """Else the laws would hold of one way only."""
    ends = []
    for of in ({}, way):
        total = 0.0
        for k, case in enumerate(CASES):
            monitor = AxisMonitor(case.model, lively(case, of))
            monitor.update(SampleBlock(*with_pause(seed + k, case)))
            total += float((monitor.batch.state.theta[:, 0] / case.model.scale).sum())
        ends.append(total)
    assert ends[0] != ends[1]
