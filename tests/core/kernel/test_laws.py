"""Laws of the engine, bit by bit: blocks, checkpoints, unusable samples and the time of day change no estimate.

And a fleet of axes of different drives, rates and settings does what its axes do one by one.
"""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.detection import Alarm, AlarmKey
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.kernel.state import COUNTERS
from monitor_core.monitoring import AlarmChange, AxisBatch, AxisMonitor, Fleet
from monitor_core.monitoring import axis_batch as batch_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case, as_columns, record
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
def test_blocks_may_end_anywhere_and_states_be_saved(seed: int, case: Case, way: Way, cuts: list[int]) -> None:
    block, s = conditioned(seed, case, with_pause(seed, case)), lively(case, way)
    at_once, going, saved = (AxisMonitor(case.model, s) for _ in range(3))
    changes = list[AlarmChange]()
    for start, stop in pairwise([0, *sorted(cuts), SAMPLES]):
        piece = block.select(slice(start, stop))
        found = going.update(piece)
        assert saved.update(piece) == found
        assert saved.open_alarms == going.open_alarms
        saved, changes = restored(saved), changes + found
    assert _latest(changes) == _latest(at_once.update(block))
    assert state(saved) == state(going) == state(at_once)


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
    original, shifted = (AxisMonitor(case.model, lively(case)) for _ in range(2))
    expected = original.update(SampleBlock(*rec))
    found = shifted.update(SampleBlock(*rec._replace(t_us=rec.t_us + shift)))
    assert state(shifted)[0] == state(original)[0]
    assert [change.alarm.raised_us - shift for change in found] == [c.alarm.raised_us for c in expected]


@pytest.mark.parametrize("case", CASES[::4], ids=lambda case: case.name)
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


LENGTH = 120
"""Samples of an axis of a fleet."""


def different(case: Case, rng: np.random.Generator) -> tuple[AxisModel, Settings]:
    """Nominal values, an interval and a way to be watched of its own."""
    values = {name: v * rng.uniform(0.9, 1.1) for name, v in case.model.nominal.items()}
    s = lively(case, WAYS[rng.integers(len(WAYS))] if rng.integers(2) else {})
    own = {
        "lam": rng.uniform(0.95, 0.99),
        "alpha1": rng.uniform(0.1, 0.5),
        "max_gap_s": rng.uniform(0.02, 0.05),
    }
    s = replace(s, interval_s=rng.choice((0.004, 0.005, 0.008)), delay_s=rng.uniform(0, 0.004), **own)  # type: ignore[arg-type]
    return replace(case.model, nominal=values, bounds={}), replace(s, run_on=bool(rng.integers(2)))


def fleet_of(chosen: list[Case], rng: np.random.Generator) -> Fleet:
    models, settings = zip(*(different(case, rng) for case in chosen), strict=True)
    return Fleet(models, settings)


@law
@given(
    seed=seeds,
    chosen=st.lists(st.sampled_from(CASES), min_size=1, max_size=4),
    again=st.integers(1, 3),
    lanes=st.integers(0, 12),
)
def test_a_fleet_equals_its_axes_one_by_one(seed: int, chosen: list[Case], again: int, lanes: int) -> None:
    rng = np.random.default_rng(seed)
    cases = [case for case in chosen for _ in range(again)]
    rng.shuffle(cases)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch_module, "FEWEST_LANES", 1 if lanes else 1000)
        patch.setattr(batch_module, "MAX_LANES", lanes)
        fleet = fleet_of(cases, rng)
        found: list[list[AlarmChange]] = [[] for _ in cases]
        pieces = []
        for a, case in enumerate(cases):
            block = conditioned(seed + a, case, with_pause(seed + a, case, LENGTH))
            i, j = sorted(rng.integers(0, LENGTH + 1, 2))
            p = [block.select(slice(*ends)) for ends in ((0, i), (i, j), (j, LENGTH))]
            # From then on the conditions of some stay what they were last.
            pieces.append([*p[:2], p[2]._replace(shift=None) if rng.integers(2) else p[2]])
        for turn in range(3):
            # Who has no samples in this turn may be left out.
            present = {a: p[turn] for a, p in enumerate(pieces) if p[turn].size or rng.integers(2)}
            for a, update in fleet.update(present).items():
                found[a] += update.changes
    for monitor, changes, blocks in zip(fleet.monitors, found, pieces, strict=True):
        alone = AxisMonitor(monitor.model, monitor.settings)
        assert changes == [change for block in blocks for change in alone.update(block)]
        assert state(monitor) == state(alone)


def test_a_trace_is_the_same_without_the_events(seed: int) -> None:
    case = CASES[0]
    rec = as_columns(record(seed, case, 400, true={**case.values, "kT": 1.3}))
    traced, quiet = (AxisBatch([case.model], [case.settings(alpha1=0.5, alpha2=0.5)]) for _ in range(2))
    events, expected = traced.run_traced(*rec)
    assert events
    for found, field in zip(quiet.trace(*rec), expected, strict=True):
        np.testing.assert_array_equal(found, field)
    for mine, other in zip(quiet.column(0), traced.column(0), strict=True):
        np.testing.assert_array_equal(mine, other)


def test_axes_of_equal_drive_and_parameters_share_a_batch() -> None:
    first, other = CASES[0], next(case for case in CASES if case.monitored != CASES[0].monitored)
    cases = [first, other, first, first]
    fleet = Fleet([case.model for case in cases], [lively(case) for case in cases])
    assert fleet.batch_sizes == [3, 1]
    assert [m.model for m in fleet.monitors] == [case.model for case in cases]
    assert fleet.update({}) == {}


def test_what_does_not_fit_is_refused_before_any_axis_moves(seed: int) -> None:
    fleet = fleet_of([CASES[0]] * 2, np.random.default_rng(seed))
    good = SampleBlock(*with_pause(seed, CASES[0], LENGTH))
    before = [state(m) for m in fleet.monitors]
    for blocks, message in (
        ({1: good._replace(u=good.u[1:])}, r"axis 1: u has the shape \(119,\): need \(120,\)"),
        (
            {1: good._replace(shift=np.zeros((LENGTH, 7)))},
            r"axis 1: shift has the shape \(120, 7\): need \(120, 3\)",
        ),
        ({1: good._replace(gate=np.ones(2, np.bool_))}, r"axis 1: gate has the shape \(2,\): need \(120,\)"),
        ({2: good}, r"blocks for the axes \[2\]: there are 2"),
    ):
        with pytest.raises(ValueError, match=message):
            fleet.update({0: good, **blocks})
    assert [state(m) for m in fleet.monitors] == before
    with pytest.raises(ValueError, match="0 models and 0 settings"):
        Fleet([], [])
