"""How samples with two outputs are cut, and what runs beside them, changes nothing."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.monitoring.fleet import Block, Fleet
from monitor_core.settings import Second
from tests.core.both.axes import CASES, PAPER, Case, lively, part, samples
from tests.core.laws import law, seeds, state


@law
@given(seed=seeds, case=st.sampled_from(CASES), cuts=st.lists(st.integers(0, 120), max_size=4))
def test_blocks_may_end_anywhere_and_a_saved_one_goes_on(seed: int, case: Case, cuts: list[int]) -> None:
    rec = samples(seed, case, 120)
    whole, pieces = (AxisMonitor.alone(case.model, lively(case)) for _ in range(2))
    expected = whole.run(*rec[:3], y2=rec.y2)
    found = []
    for start, stop in pairwise([0, *sorted(cuts), 120]):
        piece = part(rec, start, stop)
        found += pieces.run(*piece[:3], y2=piece.y2)
        saved, pieces = pieces.to_arrays(), AxisMonitor.alone(case.model, lively(case))
        pieces.from_arrays({name: array.copy() for name, array in saved.items()})
    assert found == expected
    assert state(pieces) == state(whole)


@law
@given(seed=seeds, case=st.sampled_from(CASES), lanes=st.integers(0, 12), number=st.integers(1, 4))
def test_an_axis_does_not_feel_its_neighbours(seed: int, case: Case, lanes: int, number: int) -> None:
    """One of them has no speed at all, one has the angle alone as output: each is as if it was by itself."""
    rng = np.random.default_rng(seed)
    records = [samples(seed + a, case, 60) for a in range(number)]
    blocks = {a: Block(r.t_us, r.u, r.y, y2=None if a == 1 else r.y2) for a, r in enumerate(records)}
    settings = [lively(case, lam=float(rng.uniform(0.95, 0.99))) for _ in records]
    alone = replace(settings[0], second=None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bank_module, "FEWEST_LANES", 1 if lanes else 1000)
        patch.setattr(bank_module, "MOST_LANES", lanes)
        single = AxisModel(case.drive, case.values, case.monitored)
        fleet = Fleet([case.model] * number + [single], [*settings, alone])
        assert fleet.bank_sizes == [number, 1]
        fleet.run({**blocks, number: blocks[0]._replace(y2=None)})
    for a, s in enumerate(settings):
        monitor, block = AxisMonitor.alone(case.model, s), blocks[a]
        monitor.run(block.t_us, block.u, block.y, y2=block.y2)
        assert state(fleet.monitors[a]) == state(monitor)
    monitor = AxisMonitor.alone(single, alone)
    monitor.run(*records[0][:3])
    assert state(fleet.monitors[number]) == state(monitor)


def test_a_speed_with_its_gain_zero_and_next_to_no_weight_changes_nothing(seed: int) -> None:
    """What is left is the angle by itself: the sequential form begins with the very same update."""
    case = CASES[1]
    rec = samples(seed, case, 500)
    s = case.settings()
    assert s.second is not None
    nothing = replace(s, second=Second((0.0,) * 6, 1e30, alone=s.K, alone_after=s.K_after))
    single = AxisModel(case.drive, case.values, case.monitored)
    both = AxisMonitor.alone(case.model, nothing).run_traced(*rec[:3], y2=rec.y2)[1]
    angle = AxisMonitor.alone(single, replace(s, second=None)).run_traced(*rec[:3])[1]
    np.testing.assert_allclose(both.theta, angle.theta, rtol=1e-9)


def test_states_of_other_outputs_are_not_mixed_up() -> None:
    case = CASES[0]
    model, s = case.model, case.settings()
    assert s.second is not None
    keys = {
        AxisMonitor.alone(model, s).key,
        AxisMonitor.alone(model, replace(s, second=replace(s.second, lam0=1.0))).key,
        AxisMonitor.alone(AxisModel(case.drive, case.values, PAPER), replace(s, second=None)).key,
    }
    assert len(keys) == 3
