"""Nominal values that follow measured conditions, and gates: what is known moves along, or waits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.cases import CASES, Case, record
from tests.core.laws import SAMPLES, cases, fates, law, lively, seeds, shifts, state
from tests.core.oracle.system import held_over, inputs

PAPER = CASES[0]


def test_another_nominal_value_from_the_start_is_another_model(seed: int) -> None:
    shift = 0.03 * PAPER.model.theta0
    values = {**PAPER.model.nominal}
    for name, value in zip(PAPER.monitored, PAPER.model.theta0 + shift, strict=True):
        values[name.removeprefix("1/")] = 1 / value if name.startswith("1/") else value
    moved = replace(PAPER.model, nominal=values)
    rec = record(seed, PAPER, SAMPLES)
    here, there = AxisMonitor(PAPER.model, lively(PAPER)), AxisMonitor(moved, lively(PAPER))
    _, found = here.update_traced(SampleBlock(*rec, shift=np.tile(shift, (SAMPLES, 1))))
    _, expected = there.update_traced(SampleBlock(*rec))
    np.testing.assert_allclose(found.theta[1:], expected.theta[1:], rtol=1e-9)
    np.testing.assert_allclose(found.P[1:], expected.P[1:], rtol=1e-8)
    status = zip(here.status().parameters, there.status().parameters, strict=True)
    assert all(one.nominal == pytest.approx(other.nominal, rel=1e-12) for one, other in status)
    assert np.abs(expected.theta - moved.theta0).max() > 0, "nothing was learned"


def test_the_predictor_moves_with_its_conditions(seed: int) -> None:
    """Each interval with the nominal values at its end, as a transcription has it; nothing is learned meanwhile."""
    model, rec, shift = PAPER.model, record(seed, PAPER, SAMPLES), shifts(seed, PAPER, 0.2)
    s = lively(PAPER)
    monitor = AxisMonitor(model, s)
    monitor.update(SampleBlock(*rec, shift=shift, gate=np.zeros(SAMPLES, np.bool_)))
    x = model.drive.matrix("rest", model.nominal)[:, 0] * rec.y[0]
    for k in range(1, SAMPLES):
        A, B, _ = model.matrices(model.theta0 + shift[k])
        h = (rec.t_us[k] - rec.t_us[k - 1]) * 1e-6
        x = held_over(A, B @ inputs(model, s, rec.u[k - 1], rec.y[k - 1], x), x, h)
    np.testing.assert_allclose(monitor.batch.state.x[:, 0], x, rtol=1e-9)
    np.testing.assert_allclose(monitor.batch.state.theta[:, 0], model.theta0 + shift[-1], rtol=1e-13)


@law
@given(seed=seeds, case=cases, start=st.integers(0, SAMPLES), length=st.integers(0, SAMPLES))
def test_behind_a_closed_gate_nothing_is_learned(seed: int, case: Case, start: int, length: int) -> None:
    rec, gate = record(seed, case, SAMPLES, jitter=0.3), np.ones(SAMPLES, np.bool_)
    gate[start : start + length] = False
    monitor, open_ = (AxisMonitor(case.model, lively(case)) for _ in range(2))
    _, trace = monitor.update_traced(SampleBlock(*rec, gate=gate))
    open_.update(SampleBlock(*rec))
    learned = np.isfinite(trace.eps)
    assert not learned[~gate].any()
    for values in (trace.theta, trace.P, trace.g):
        closed = np.flatnonzero(~gate)
        closed = closed[closed > 0]
        np.testing.assert_array_equal(values[closed], values[closed - 1])
    here, there = fates(monitor), fates(open_)
    assert here.get("gated", 0) + np.count_nonzero(learned) == there["used"]
    assert sum(n for f, n in here.items() if f != "projected") == SAMPLES


@law
@given(seed=seeds, case=cases, start=st.integers(1, SAMPLES), length=st.integers(0, SAMPLES))
def test_unknown_conditions_close_the_gate(seed: int, case: Case, start: int, length: int) -> None:
    rec, shift, gate = record(seed, case, SAMPLES), shifts(seed, case), np.ones(SAMPLES, np.bool_)
    unknown, gate[start : start + length] = shift.copy(), False
    unknown[start : start + length] = np.nan
    held = shift.copy()
    held[start : start + length] = shift[start - 1]
    one, other = (AxisMonitor(case.model, lively(case)) for _ in range(2))
    assert one.update(SampleBlock(*rec, shift=unknown)) == other.update(
        SampleBlock(*rec, shift=held, gate=gate)
    )
    assert state(one) == state(other)
