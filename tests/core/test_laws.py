"""Laws of the engine, bit by bit: blocks, neighbours, checkpoints and unusable samples change no estimate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.kernel.state import COUNTERS
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case, as_columns, record
from tests.core.laws import SAMPLES, cases, cuts, law, lively, part, seeds, state


@law
@given(seed=seeds, case=cases, cuts=cuts)
def test_blocks_may_end_anywhere(seed: int, case: Case, cuts: list[int]) -> None:
    rec = record(seed, case, SAMPLES, jitter=0.3, gaps=1)
    whole, parts = (AxisBatch([case.model], [lively(case)]) for _ in range(2))
    expected = whole.run(*as_columns(rec))
    edges = [0, *sorted(cuts), SAMPLES]
    found = [
        event for start, stop in pairwise(edges) for event in parts.run(*as_columns(part(rec, start, stop)))
    ]
    assert found == expected
    assert state(AxisMonitor.of_lane(parts, 0)) == state(AxisMonitor.of_lane(whole, 0))


@law
@given(seed=seeds, case=cases, cut=st.integers(0, SAMPLES))
def test_a_saved_monitor_goes_on_as_if_nothing_had_happened(seed: int, case: Case, cut: int) -> None:
    rec = record(seed, case, SAMPLES, jitter=0.3, gaps=1)
    whole, before, after = (AxisMonitor(case.model, lively(case)) for _ in range(3))
    whole.update(SampleBlock(*part(rec, 0, cut)))
    expected = whole.update(SampleBlock(*part(rec, cut)))
    before.update(SampleBlock(*part(rec, 0, cut)))
    after.from_arrays({name: array.copy() for name, array in before.to_arrays().items()})
    assert after.update(SampleBlock(*part(rec, cut))) == expected
    assert after.open_alarms == whole.open_alarms
    assert state(after) == state(whole)


def different_axes(rng: np.random.Generator, case: Case, W: int) -> list[tuple[AxisModel, Settings]]:
    axes = []
    for _ in range(W):
        values = {name: v * rng.uniform(0.9, 1.1) for name, v in case.model.nominal.items()}
        model = replace(case.model, nominal=values)
        s = replace(lively(case), lam=rng.uniform(0.95, 0.99), delay_s=rng.uniform(0, 0.005))
        axes.append((model, replace(s, alpha1=rng.uniform(0.1, 0.5), max_gap_s=rng.uniform(0.02, 0.05))))
    return axes


def side_by_side(records: list[Experiment], counts: list[int]) -> tuple[Experiment, NDArray[np.int64]]:
    """Samples of several axes as one block; behind the last sample of an axis stands nonsense."""
    N = max(counts)
    t_us, u, y = (np.full((N, len(counts)), filler) for filler in (-77, 1e300, -1e300))
    for a, (rec, n) in enumerate(zip(records, counts, strict=True)):
        t_us[:n, a], u[:n, a], y[:n, a] = part(rec, 0, n)
    return Experiment(t_us.astype(np.int64), u, y), np.array(counts)


@law
@given(seed=seeds, case=cases, W=st.integers(1, 10), lanes=st.integers(0, 12), data=st.data())
def test_an_axis_does_not_feel_its_neighbours(
    seed: int, case: Case, W: int, lanes: int, data: st.DataObject
) -> None:
    rng = np.random.default_rng(seed)
    axes = different_axes(rng, case, W)
    records = [record(seed + a, case, 60, jitter=0.3, gaps=1) for a in range(W)]
    counts = data.draw(st.lists(st.integers(0, 60), min_size=W, max_size=W))
    bank = AxisBatch([model for model, _ in axes], [s for _, s in axes])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bank_module, "FEWEST_LANES", 1 if lanes else 1000)
        patch.setattr(bank_module, "MOST_LANES", lanes)
        block, n = side_by_side(records, counts)
        events = bank.run(*block, n)
        block, n = side_by_side(
            [part(rec, n) for rec, n in zip(records, counts, strict=True)], [60 - n for n in counts]
        )
        events += bank.run(*block, n)
    for a, (model, s) in enumerate(axes):
        alone = AxisBatch([model], [s])
        expected = alone.run(*as_columns(records[a]))
        assert state(AxisMonitor.of_lane(bank, a)) == state(AxisMonitor.of_lane(alone, 0))
        assert [event for axis, event in events if axis == a] == [event for _, event in expected]


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
        u = value
    else:
        y = value
    t += 1_000 if reason == "not_finite" else 0
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
    here, there = (AxisBatch([case.model], [lively(case)]) for _ in range(2))
    expected = here.run(*as_columns(rec))
    found = there.run(*as_columns(rec._replace(t_us=rec.t_us + shift)))
    assert state(AxisMonitor.of_lane(there, 0))[0] == state(AxisMonitor.of_lane(here, 0))[0]
    assert [event.time_us - shift for _, event in found] == [event.time_us for _, event in expected]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_laws_see_something_happen(case: Case, seed: int) -> None:
    """Crossings, updates and gaps do occur in such records: else the laws above would hold of nothing."""
    episodes = 0
    for k in range(5):
        monitor = AxisMonitor(case.model, lively(case))
        episodes += len(monitor.update(SampleBlock(*record(seed + k, case, SAMPLES, jitter=0.3, gaps=1))))
        assert monitor.status().counters["gap"] >= 1
        assert monitor.status().counters["used"] > SAMPLES / 2
    assert episodes > 3
