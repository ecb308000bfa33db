"""The multi-model detector: each predicts as the recursion does at its parameters; blocks, saving, gates, outliers."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import TORQUE_SCALE, TORQUE_STUCK
from monitor_core.detection.multimodel import hypothesis_bank
from monitor_core.detection.multimodel.candidates import candidate_cause
from monitor_core.detection.multimodel.hypothesis import Distortion, Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.lanes import lanes_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import split_name
from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.kernel.outliers import AFTER, JOLT_S
from monitor_core.kernel.predictors import FARTHEST, SHORTEST, Predictors
from monitor_core.kernel.tables import GAINS, Tables
from monitor_core.monitoring import AxisBatch
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import BY_NAME, CASES, Case, as_columns, record
from tests.core.laws import SAMPLES, conditioned, seeds

law = settings(deadline=None, max_examples=8)
NEVER_USUAL = 10**9
"""A SHORTEST that no interval has."""


def held(model: AxisModel, s: Settings, rec: Experiment) -> Floats:
    """Innovations (N,) of the recursion whose theta does not move."""
    certain = tuple(1e-30 * model.scale**2)
    bank = AxisBatch([model], [replace(s, P0=certain, lam=1 - 1e-12)])
    _, trace = bank.run_traced(*as_columns(rec))
    return np.asarray(trace.eps[:, 0])


def predicted(model: AxisModel, s: Settings, hypothesis: Hypothesis, rec: Experiment) -> Floats:
    _, trace = HypothesisBank(model, s, [hypothesis]).run_traced(SampleBlock(*rec))
    return np.asarray(trace.eps[:, 0])


def changes(case: Case, rng: np.random.Generator) -> Hypothesis:
    factors = {name: float(rng.uniform(0.7, 1.4)) for name in rng.choice(list(case.values), 3) if name != "delay"}
    return Hypothesis("some", factors=factors)


@law
@given(seed=seeds, case=st.sampled_from(CASES), jitter=st.sampled_from([0.0, 0.3]))
def test_a_hypothesis_predicts_as_the_recursion_at_its_parameters(seed: int, case: Case, jitter: float) -> None:
    rng = np.random.default_rng(seed)
    hypothesis = changes(case, rng)
    rec = record(seed, case, SAMPLES, jitter=jitter, gaps=1)
    s = case.settings(settle_s=0.0)
    nominal = {name: v * hypothesis.factors.get(name, 1.0) for name, v in case.model.nominal.items()}
    alone = replace(case.model, nominal=nominal, bounds={})
    expected, found = held(alone, s, rec), predicted(case.model, s, hypothesis, rec)
    both = np.isfinite(expected)
    assert both.sum() > SAMPLES / 2
    np.testing.assert_allclose(found[both], expected[both], rtol=1e-6, atol=1e-7 * np.abs(rec.y).max())


@law
@given(seed=seeds, case=st.sampled_from(CASES), jitter=st.sampled_from([0.0, 0.3]))
def test_a_distorted_signal_is_that_of_the_recursion_with_the_signal_put_right(
    seed: int, case: Case, jitter: float
) -> None:
    rng = np.random.default_rng(seed)
    rec, s = record(seed, case, SAMPLES, jitter=jitter, gaps=1), case.settings(settle_s=0.0)
    torque, output = (Distortion(float(rng.uniform(-2, -0.5)), float(rng.normal())) for _ in range(2))
    hypothesis = Hypothesis("some", torque=torque, output=output)
    right = Experiment(rec.t_us, torque.scale * rec.u + torque.offset, (rec.y - output.offset) / output.scale)
    expected, found = output.scale * held(case.model, s, right), predicted(case.model, s, hypothesis, rec)
    both = np.isfinite(expected)
    size = abs(output.scale) * np.abs(right.y).max()
    np.testing.assert_allclose(found[both], expected[both], rtol=1e-6, atol=1e-7 * size)


@law
@given(seed=seeds, case=st.sampled_from(CASES), jitter=st.sampled_from([0.0, 0.3]), share=st.floats(-1.0, 1.0))
@example(seed=0, case=BY_NAME["speed-output-error-late"], jitter=0.0, share=-1.0)
@example(seed=0, case=BY_NAME["speed-output-error-late"], jitter=0.0, share=-0.4)
def test_a_torque_that_acts_late_or_early(seed: int, case: Case, jitter: float, share: float) -> None:
    """Early by d is late by an interval less d of the torque of the next sample, at equal intervals."""
    if "delay" in case.values or (jitter and share < 0):
        return
    s = case.settings(settle_s=0.0, delay_s=0.0)
    rec = record(seed, case, SAMPLES, jitter=jitter)
    rec.u[:3] = 0.0  # both start alike
    early = share < 0
    late = replace(s, delay_s=(share + early) * s.interval_s)
    expected = held(case.model, late, Experiment(rec.t_us, np.append(rec.u[1:], 0.0) if early else rec.u, rec.y))
    found = predicted(case.model, s, Hypothesis("delay", delay_s=share * s.interval_s), rec)
    np.testing.assert_allclose(found[2:-1], expected[2:-1], rtol=1e-6, atol=1e-7 * np.abs(rec.y).max())


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
@pytest.mark.parametrize("interval_us", [-1, 0, 1])
def test_the_usual_intervals_give_what_any_interval_gives(
    case: Case, interval_us: int, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Discretised in advance or propagated as in the recursion: the same, also with delays of both signs."""
    rec = record(seed, case, SAMPLES)
    s = case.settings(settle_s=0.0, outlier_limit=0.0)
    if s.K:  # gains that grow
        s = replace(s, K_after=tuple(tuple(share * k for k in s.K) for share in (0.5, *range(2, GAINS))))
    nominal_us = round(s.interval_s * 1e6)
    rec.t_us[:] = rec.t_us[0] + np.arange(SAMPLES) * (nominal_us + interval_us)
    delays = [Hypothesis("delay", delay_s=share * s.interval_s) for share in (-0.4, 0.4)]
    some = [*few(case.name), *delays, Hypothesis("output", output=Distortion(-0.7, 0.1))]

    def innovations() -> Floats:
        _, trace = HypothesisBank(case.model, s, some).run_traced(SampleBlock(*rec))
        return np.asarray(trace.eps)

    def lanes_without_usual_intervals(*arguments: Any) -> tuple[Tables, Predictors]:
        tables, predictors = lanes_of(*arguments)
        predictors.axis[SHORTEST] = NEVER_USUAL
        return tables, predictors

    found = innovations()
    monkeypatch.setattr(hypothesis_bank, "lanes_of", lanes_without_usual_intervals)
    expected = innovations()
    moved = np.isfinite(expected).all(axis=1)
    assert moved.sum() == SAMPLES - 1
    np.testing.assert_allclose(found[moved], expected[moved], rtol=1e-9, atol=1e-9 * np.abs(expected[moved]).max())
    assert not np.array_equal(found[moved], expected[moved])  # it is the other way


def lively(case: Case, h: float = 3.0) -> HypothesisBank:
    """Low thresholds, a short memory: much happens in few samples."""
    s = case.settings(lam=0.9, settle_s=0.05, outlier_limit=6.0)
    return HypothesisBank(case.model, s, few(case.name), h=h)


@cache
def few(name: str) -> tuple[Hypothesis, ...]:
    model, s = BY_NAME[name].model, BY_NAME[name].settings()
    causes = (*model.monitored, TORQUE_SCALE)
    some = [candidate_cause(model, s, cause).hypothesis(size) for cause in causes for size in (-0.2, 0.2)]
    return (*some, Hypothesis("output stuck", frozen=True), candidate_cause(model, s, TORQUE_STUCK).hypothesis(1.0))


def state(bank: HypothesisBank) -> list[bytes]:
    return [(array + 0).tobytes() for array in bank.to_arrays().values()]


@law
@given(
    seed=seeds,
    case=st.sampled_from(CASES),
    cuts=st.lists(st.integers(0, SAMPLES), max_size=4),
    saved=st.booleans(),
)
def test_blocks_may_end_anywhere_and_a_saved_bank_goes_on(seed: int, case: Case, cuts: list[int], saved: bool) -> None:
    """Also where nominal values follow conditions, which at times are unknown, and behind gates."""
    rec = record(seed, case, SAMPLES, jitter=0.3 * (seed % 2), gaps=1, true=drawn(case, seed))
    block = conditioned(seed, case, rec)
    at_once, parts = lively(case), lively(case)
    expected, found = at_once.run(block), []
    for start, stop in pairwise([0, *sorted(cuts), SAMPLES]):
        found += parts.run(block.select(slice(start, stop)))
        if saved:
            again = lively(case)
            again.from_arrays({name: array.copy() for name, array in parts.to_arrays().items()})
            parts = again
    assert repr(found) == repr(expected)
    assert state(parts) == state(at_once)


def drawn(case: Case, seed: int) -> dict[str, float]:
    """Values of the plant, which a monitor may have to find changed."""
    rng = np.random.default_rng(seed)
    monitored = [split_name(name)[0] for name in case.model.monitored]
    return {name: v * (rng.uniform(0.6, 1.6) if name in monitored else 1.0) for name, v in case.values.items()}


def test_a_state_that_does_not_fit_is_refused() -> None:
    bank, other = (lively(case) for case in (CASES[0], CASES[5]))
    with pytest.raises(ValueError, match="does not fit"):
        bank.from_arrays(other.to_arrays())
    arrays = bank.to_arrays() | {"standing": np.array([[99.0, 0.1]])}
    with pytest.raises(ValueError, match="these hypotheses do not have"):
        bank.from_arrays(arrays)
    with pytest.raises(KeyError):
        bank.from_arrays({})


@pytest.mark.parametrize("h", [0.0, -1.0, np.ones(3)])
def test_thresholds_that_do_not_fit_are_refused(h: float | Floats) -> None:
    case = CASES[0]
    with pytest.raises(ValueError, match=r"h > 0|broadcast"):
        HypothesisBank(case.model, case.settings(), [Hypothesis("some")] * 2, h=h)


@pytest.mark.parametrize("share", [0.0, 1.1])
def test_a_share_of_the_evidence_that_cannot_be_is_refused(share: float) -> None:
    case = CASES[0]
    with pytest.raises(ValueError, match="evidence_share"):
        HypothesisBank(case.model, case.settings(), [Hypothesis("some")], evidence_share=share)


def test_a_closed_gate_tests_nothing_nor_do_unknown_conditions(seed: int) -> None:
    case = CASES[0]
    rec, gate = record(seed, case, SAMPLES), np.arange(SAMPLES) < SAMPLES // 2
    unknown = np.where(gate[:, np.newaxis], 0.0, np.full(len(case.monitored), np.nan))
    for conditions in ({"gate": gate}, {"shift": unknown}):
        _, trace = lively(case, np.inf).run_traced(SampleBlock(*rec, **conditions))
        assert np.isfinite(trace.llr[SAMPLES // 2 - 5]).any()
        assert np.isnan(trace.llr[gate.argmin() :]).all()
        assert np.isfinite(trace.eps[gate.argmin() :]).all()


def test_a_lone_outlier_is_no_evidence(seed: int) -> None:
    case = CASES[0]
    rec, bank = record(seed, case, SAMPLES), lively(case, np.inf)
    rec.y[100] += 1000.0
    _, trace = bank.run_traced(SampleBlock(*rec))
    assert np.isnan(trace.llr[100]).all()
    assert np.isfinite(trace.llr[101, :-2]).all()


def test_a_jolt_is_no_evidence_until_it_is_over(seed: int) -> None:
    """The output jumps for twenty samples; the credit of the first 2500 is enough for these and those after them."""
    case = CASES[0]
    rec, bank = record(seed, case, 3000), lively(case, np.inf)
    waits = round(AFTER * JOLT_S / bank.settings.interval_s)
    rec.y[2500:2520] += 1000.0
    _, trace = bank.run_traced(SampleBlock(*rec))
    assert np.isfinite(trace.llr[2480:2500, :-2]).all()
    assert np.isnan(trace.llr[2500 : 2520 + waits]).all()
    assert np.isfinite(trace.llr[2650:2700, :-2]).any()


def test_an_outlier_may_be_the_first_sample(seed: int) -> None:
    """As if the bank had started with the fourth sample, which is the third that disagrees with the first."""
    case = CASES[0]
    rec, late = record(seed, case, SAMPLES), lively(case, np.inf)
    rec.y[0] += 100.0
    _, found = lively(case, np.inf).run_traced(SampleBlock(*rec))
    _, expected = late.run_traced(SampleBlock(rec.t_us[3:], rec.u[3:], rec.y[3:]))
    np.testing.assert_array_equal(found.eps[4:], expected.eps[1:])


def test_a_predictor_that_swings_up_costs_no_other_its_samples(seed: int) -> None:
    """It has a gain of its own that does not fit this axis: it restarts again and again, and does not alarm."""
    case = BY_NAME["speed-skew"]
    s, other = case.settings(), Hypothesis("other", factors={"Jm": 1.3})
    wild = Hypothesis("wild", K=tuple(-30.0 * np.array(s.gain(len(case.model.drive.states)))))
    rec = record(seed, case, 2000)
    alone, beside = (HypothesisBank(case.model, s, hypotheses) for hypotheses in ([other], [other, wild]))
    (_, expected), (_, found) = (bank.run_traced(SampleBlock(*rec)) for bank in (alone, beside))
    most = FARTHEST * np.sqrt(s.lam0)
    started_anew = (abs(found.eps[1:-1, 1]) > 1e-3 * most) & (abs(found.eps[2:, 1]) < 1e-6 * most)
    assert started_anew.sum() > 3
    assert np.nanmax(abs(found.eps[:, 1])) <= most
    for field in ("eps", "llr", "g"):
        np.testing.assert_array_equal(getattr(found, field)[:, 0], getattr(expected, field)[:, 0])
    assert found.g[:, 1].max() < 20.0
