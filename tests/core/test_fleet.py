"""A fleet of axes of different drives, rates and settings does what its axes do one by one, bit by bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AlarmChange, AxisMonitor, Fleet
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case
from tests.core.laws import WAYS, conditioned, law, lively, seeds, state, with_pause

SAMPLES = 120


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


def fleet_of(cases: list[Case], rng: np.random.Generator) -> Fleet:
    models, settings = zip(*(different(case, rng) for case in cases), strict=True)
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
        patch.setattr(bank_module, "FEWEST_LANES", 1 if lanes else 1000)
        patch.setattr(bank_module, "MOST_LANES", lanes)
        fleet = fleet_of(cases, rng)
        found: list[list[AlarmChange]] = [[] for _ in cases]
        pieces = []
        for a, case in enumerate(cases):
            block = conditioned(seed + a, case, with_pause(seed + a, case, SAMPLES))
            i, j = sorted(rng.integers(0, SAMPLES + 1, 2))
            p = [block.select(slice(*ends)) for ends in ((0, i), (i, j), (j, SAMPLES))]
            # From then on the conditions of some stay what they were last.
            pieces.append([*p[:2], p[2]._replace(shift=None) if rng.integers(2) else p[2]])
        for turn in range(3):
            # Who has no samples in this turn may be left out.
            here = {a: p[turn] for a, p in enumerate(pieces) if p[turn].size or rng.integers(2)}
            for a, update in fleet.update(here).items():
                found[a] += update.changes
    for monitor, changes, blocks in zip(fleet.monitors, found, pieces, strict=True):
        alone = AxisMonitor(monitor.model, monitor.settings)
        assert changes == [change for block in blocks for change in alone.update(block)]
        assert state(monitor) == state(alone)


def test_axes_of_equal_drive_and_parameters_share_a_bank() -> None:
    one, other = CASES[0], next(case for case in CASES if case.monitored != CASES[0].monitored)
    cases = [one, other, one, one]
    fleet = Fleet([case.model for case in cases], [lively(case) for case in cases])
    assert fleet.batch_sizes == [3, 1]
    assert [m.model for m in fleet.monitors] == [case.model for case in cases]
    assert fleet.update({}) == {}


def test_what_does_not_fit_is_refused_before_any_axis_moves(seed: int) -> None:
    fleet = fleet_of([CASES[0]] * 2, np.random.default_rng(seed))
    good = SampleBlock(*with_pause(seed, CASES[0], SAMPLES))
    before = [state(m) for m in fleet.monitors]
    for blocks, message in (
        ({1: good._replace(u=good.u[1:])}, r"axis 1: u has the shape \(119,\): need \(120,\)"),
        (
            {1: good._replace(shift=np.zeros((SAMPLES, 7)))},
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
