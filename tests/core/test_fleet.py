"""A fleet of axes of different drives, rates and settings does what its axes do one by one, bit by bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AlarmChange, AxisMonitor, Fleet
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case, record

SAMPLES = 120
seeds = st.integers(0, 2**32 - 1)
cases = st.lists(st.sampled_from(CASES), min_size=1, max_size=6)
law = settings(deadline=None, max_examples=20)
Changes = list[AlarmChange]


def lively(case: Case, rng: np.random.Generator) -> tuple[AxisModel, Settings]:
    """Large steps and low thresholds, an interval of its own."""
    s = case.settings(relative_sd=0.05, alpha1=0.2, alpha2=0.2, settle_s=0.1, delay_s=0.0)
    s = replace(s, interval_s=rng.choice((0.004, 0.005, 0.008)), lam=rng.uniform(0.95, 0.99))
    return case.model, replace(s, run_on=bool(rng.integers(2)))


def samples(seed: int, case: Case, rng: np.random.Generator) -> SampleBlock:
    """A record with jitter and a gap; for some axes with conditions that move, are unknown, forbid to learn."""
    rec, p = record(seed, case, SAMPLES, jitter=0.3, gaps=1), len(case.monitored)
    shift = 0.02 * case.model.scale * rng.standard_normal((SAMPLES, p)) if rng.integers(2) else None
    if shift is not None:
        shift[rng.random(SAMPLES) < 0.1] = np.nan
    gate = rng.random(SAMPLES) < 0.9 if rng.integers(2) else None
    return SampleBlock(*rec, shift, gate)


def cut(block: SampleBlock, start: int, stop: int) -> SampleBlock:
    return SampleBlock(*(None if v is None else v[start:stop] for v in block))  # type: ignore[arg-type]


def alone(model: AxisModel, s: Settings, blocks: list[SampleBlock]) -> tuple[AxisMonitor, Changes]:
    monitor = AxisMonitor(model, s)
    return monitor, [change for block in blocks for change in monitor.update(block)]


def state(monitor: AxisMonitor) -> tuple[bytes, bytes]:
    """All bits but the sign of a zero, which a sum with zero forgets."""
    floats, ints = monitor.batch.column(monitor.lane)
    return (floats + 0.0).tobytes(), ints.tobytes()


@law
@given(seed=seeds, chosen=cases, again=st.integers(1, 3), lanes=st.booleans())
def test_a_fleet_equals_its_axes_one_by_one(seed: int, chosen: list[Case], again: int, lanes: bool) -> None:
    rng = np.random.default_rng(seed)
    cases_of_axes = [case for case in chosen for _ in range(again)]
    rng.shuffle(cases_of_axes)
    axes = [lively(case, rng) for case in cases_of_axes]
    whole = [samples(seed + a, case, rng) for a, case in enumerate(cases_of_axes)]
    cuts = [sorted(rng.integers(0, SAMPLES + 1, 2)) for _ in axes]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bank_module, "FEWEST_LANES", 1 if lanes else 1000)
        fleet = Fleet([model for model, _ in axes], [s for _, s in axes])
        found: list[Changes] = [[] for _ in axes]
        pieces = [
            [cut(b, 0, i), cut(b, i, j), cut(b, j, SAMPLES)] for b, (i, j) in zip(whole, cuts, strict=True)
        ]
        for p in pieces:  # from then on the conditions of some stay what they were last
            p[2] = p[2]._replace(shift=None) if rng.integers(2) else p[2]
        for turn in range(3):
            # Who has no samples in this turn may be left out.
            here = {a: p[turn] for a, p in enumerate(pieces) if len(p[turn].t_us) or rng.integers(2)}
            for a, update in fleet.update(here).items():
                found[a] += update.changes
    for a, (model, s) in enumerate(axes):
        monitor, expected = alone(model, s, pieces[a])
        assert found[a] == expected
        assert state(fleet.monitors[a]) == state(monitor)


def test_axes_of_equal_drive_and_parameters_share_a_bank() -> None:
    rng = np.random.default_rng(1)
    one, other = CASES[0], next(case for case in CASES if case.monitored != CASES[0].monitored)
    axes = [lively(case, rng) for case in (one, other, one, one)]
    fleet = Fleet([model for model, _ in axes], [replace(s, run_on=False) for _, s in axes])
    assert fleet.batch_sizes == [3, 1]
    assert [m.model for m in fleet.monitors] == [model for model, _ in axes]
    assert fleet.update({}) == {}


def test_what_does_not_fit_is_refused_before_any_axis_moves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axes = [lively(CASES[0], rng) for _ in range(2)]
    fleet = Fleet([model for model, _ in axes], [s for _, s in axes])
    good = samples(seed, CASES[0], rng)
    before = [state(m) for m in fleet.monitors]
    for block, message in (
        (good._replace(u=good.u[1:]), r"axis 1: u has the shape \(119,\): need \(120,\)"),
        (
            good._replace(shift=np.zeros((SAMPLES, 7))),
            r"axis 1: shift has the shape \(120, 7\): need \(120, 3\)",
        ),
        (good._replace(gate=np.ones(2, np.bool_)), r"axis 1: gate has the shape \(2,\): need \(120,\)"),
    ):
        with pytest.raises(ValueError, match=message):
            fleet.update({0: good, 1: block})
    with pytest.raises(ValueError, match=r"blocks for the axes \[2\]: there are 2"):
        fleet.update({0: good, 2: good})
    assert [state(m) for m in fleet.monitors] == before
    with pytest.raises(ValueError, match="0 models and 0 settings"):
        Fleet([], [])
