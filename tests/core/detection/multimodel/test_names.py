"""The multi-model detector on the reference experiment: when it alarms, and which cause, size and onset it names."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from monitor_core.arrays import Floats
from monitor_core.calibration.multimodel_healthy import healthy_evidence
from monitor_core.detection.alarm import (
    INERTIA,
    OUTPUT_NOISE,
    OUTPUT_SCALE,
    OUTPUT_SIGN,
    OUTPUT_STUCK,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    TORQUE_SIGN,
    TORQUE_STUCK,
)
from monitor_core.detection.multimodel.candidates import candidate_cause
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.isolability import default_hypotheses
from monitor_core.detection.multimodel.multimodel_detector import least_delay
from monitor_core.detection.multimodel.naming import (
    CauseEnded,
    CauseIdentified,
    CausePosterior,
    ChangeDetected,
    Event,
    SizeCorrected,
)
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.drive.structure import DELAY
from monitor_core.excitation.reference_experiment import FAULT_AT, Experiment, experiment, faulty
from monitor_core.kernel import hypotheses as kernel
from monitor_core.kernel.likelihood import HELD_BACK, SINCE_DETECTION, SURE, G
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, reference_model, three_mass
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core import lasting_changes
from tests.core.figures import settings_of
from tests.core.hypothesis_figures import DAY, bank_of, delays, limit_s, model_of, settings_for
from tests.core.simulated import changing_output
from tests.shares import soaked

H_FOR_A_DAY = 17.6
"""One false alarm of the reference experiment's bank a day; make bench measures it."""
BY_LUCK = 1e-6
SEEDS = 40
SOON_S = 5.0
"""The predictors settle in 2.8 s; a size is corrected after 6 s more."""


@pytest.fixture(scope="module")
def bank(seed: int) -> HypothesisBank:
    return bank_of("speed", H_FOR_A_DAY, seed)


def events_of(
    bank: HypothesisBank, seeds: range, fault: Mapping[str, float], samples: int
) -> Iterator[tuple[Experiment, list[Event]]]:
    """Records of the reference experiment with a fault, each with what a bank that begins anew says."""
    for k in seeds:
        bank.reset()
        rec = experiment(k, fault, samples=samples)
        yield rec, bank.run(SampleBlock(*rec))


# Shares of 3000 seeds each: named right 0.99 at least, missed 0.02 at most; the median is 1.1 to 1.3 times the limit.
@pytest.mark.parametrize(
    ("name", "missed", "factor"),
    soaked(
        [(*rest, factor) for rest in (("kT", 1e-3), ("1/Ja", 1e-3), ("fm", 0.02)) for factor in (1.2, 0.8)],
        ("kT", 1e-3, 1.2),
        ("1/Ja", 1e-3, 0.8),
        ("fm", 0.02, 1.2),
    ),
)
def test_faults_are_found_near_the_limit_and_named_right(
    name: str, missed: float, factor: float, bank: HypothesisBank, seed: int
) -> None:
    fault = {name: factor}
    found = delays(bank, fault, range(seed + 3000, seed + 3000 + SEEDS))
    limit = limit_s(fault, range(seed, seed + 100), DAY)
    print(f"{fault}: limit {limit:.2f} s, {found}")
    assert binom.sf(SEEDS * (1 - found.right_named) - 1.5, SEEDS, 0.01) > BY_LUCK
    assert binom.sf(SEEDS * found.missed - 0.5, SEEDS, missed) > BY_LUCK
    assert found.early <= 1
    # Of 40 delays that scatter by two thirds of their median the median scatters by a seventh.
    assert np.median(found.alarm) < 2.0 * limit


def test_another_payload_is_named_where_no_inertia_is_monitored(seed: int) -> None:
    """Of an axis that bears no weight; without that cause it would be called a scale of the output, or kT."""
    model = model_of(("kT", "fm"), {})
    bank = HypothesisBank(model, settings_for(model, seed), h=H_FOR_A_DAY)
    named = list[CauseIdentified]()
    for _, events in events_of(bank, range(seed, seed + 10), {"1/Ja": 1 / 1.3}, 1600):
        named += [event for event in events if isinstance(event, CauseIdentified)][:1]
    print([(event.shares[0].cause, event.shares[0].size, event.shares[0].size_sd) for event in named])
    assert [event.shares[0].cause for event in named].count(INERTIA) >= 9
    sizes = [math.expm1(event.shares[0].size) for event in named]
    assert np.median(sizes) == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize(
    ("name", "factor", "off"),
    soaked(
        [("1/Ja", 1.25, 0.08), ("1/Ja", 0.8, 0.08), ("kT", 1.2, 0.25), ("fm", 1.5, 0.25)],
        ("1/Ja", 1.25, 0.08),
    ),
)
def test_the_corrected_size_is_that_of_the_change(
    name: str, factor: float, off: float, bank: HypothesisBank, seed: int
) -> None:
    """The mean of ten, off by more in 1 of 10 000; by a parabola over wide steps 1/Ja +25 % would be 14 % too large."""
    sizes = list[float]()
    for _, events in events_of(bank, range(seed, seed + 10), {name: factor}, FAULT_AT + 3600):
        corrected = [event.share for event in events if isinstance(event, SizeCorrected)]
        sizes += [math.expm1(share.size) for share in corrected[-1:] if share.cause == name]
    print(f"{name} {factor - 1:+.0%}: {np.round(sizes, 3).tolist()}, mean {np.mean(sizes):+.1%}")
    assert len(sizes) >= 9
    assert np.mean(sizes) == pytest.approx(factor - 1, rel=off)


def test_the_first_size_is_that_of_the_evidence_since_the_onset(bank: HypothesisBank, seed: int) -> None:
    """The samples since the detection are too few where the cause is named soon."""
    for k in range(seed, seed + 3):
        bank.reset()
        block = SampleBlock(*experiment(k, {"kT": 1.3}, samples=FAULT_AT + 600))
        for first in range(block.size):
            events = bank.run(block.select(slice(first, first + 1)))
            if named := [event for event in events if isinstance(event, CauseIdentified)]:
                break
        evidence = bank.memory.sums[[G, HELD_BACK], 1 : len(bank.hypotheses) + 1].sum(axis=0)
        expected = CausePosterior(bank.hypotheses).shares(evidence)[0]
        assert named[0].time_us - named[0].since_us < bank.settings.memory * bank.settings.interval_s * 1e6
        assert (named[0].shares[0].cause, named[0].shares[0].size) == (expected.cause, expected.size)


@pytest.mark.parametrize(("then", "ended"), [({}, True), ({"kT": 1.3, "1/Ja": 1.5}, False)])
def test_what_changes_while_a_size_is_corrected_is_not_taken_for_its_error(
    then: Mapping[str, float], ended: bool, bank: HypothesisBank, seed: int
) -> None:
    """kT +30 % is over again, or 1/Ja changes, too; that is detected as soon as the predictors have settled."""
    bank.reset()
    healthy, fault = experiment(seed, samples=6000, fault_at=5999), {"kT": 1.3}
    drive, rng = three_mass("speed"), np.random.default_rng(seed)
    values, x, events = faulty(REFERENCE_VALUES, {}), None, list[Event]()
    changed_us, k = 0, 0
    while k < 6000:
        corrects = bank.memory.integers[kernel.PHASE, 0] == kernel.CORRECTING
        step = 1 if corrects else 20
        if k == FAULT_AT:
            values = faulty(REFERENCE_VALUES, fault)
        if corrects and not changed_us:
            values, changed_us = faulty(REFERENCE_VALUES, then), int(healthy.t_us[k])
        u = healthy.u[k : k + step]
        y, x = simulate_linear(drive, values, u[:, np.newaxis], INTERVAL_S, x)
        new = bank.run(SampleBlock(healthy.t_us[k : k + step], u, y[:, 0] + rng.standard_normal(len(u))))
        if corrects and any(isinstance(event, ChangeDetected) for event in new):
            # What was before is no evidence of the next size.
            assert not bank.memory.sums[SINCE_DETECTION].any()
            assert new[0].time_us - changed_us < 1e6 * SOON_S
        events, k = [*events, *new], k + step
    print([(type(e).__name__, e.time_us * 1e-6) for e in events])
    corrected = [event.share for event in events if isinstance(event, SizeCorrected)]
    over = [event.cause for event in events if isinstance(event, CauseEnded)]
    second = [e.shares[0].cause for e in events if isinstance(e, CauseIdentified)][-1]
    assert sum(isinstance(event, ChangeDetected) for event in events) == 2
    assert ("kT" in over) == ended
    assert ended or second == "1/Ja"
    assert all(abs(math.expm1(share.size) - 0.3) < 0.1 for share in corrected if share.cause == "kT")


def test_the_onset_and_its_latest_time_are_read_off_the_evidence(bank: HypothesisBank, seed: int) -> None:
    """g of the likeliest hypothesis was last 0 at the onset, and last below SURE at the end of its interval."""
    bank.reset()
    rec = experiment(seed, {"kT": 1.2}, samples=1600)
    events, trace = bank.run_traced(SampleBlock(*rec))
    change = next(event for event in events if isinstance(event, ChangeDetected))
    g = trace.g[: int(np.searchsorted(rec[0], change.time_us)) + 1]
    own = g[:, int(g[-1].argmax())]
    latest = [int(rec[0][np.flatnonzero(own <= least)[-1]]) for least in (0.0, SURE)]
    assert [change.onset.onset_us, change.onset.onset_high_us] == latest
    assert latest[0] < latest[1] < change.time_us


def test_no_name_is_given_while_the_state_is_that_of_before(bank: HypothesisBank, seed: int) -> None:
    """However sure one seems: kT half as large again would be another cause, at once, in 3 of 40; it is in 1 of 400."""
    slowest = round(1e6 * slowest_time_constant(bank.model, bank.settings.gain(5), INTERVAL_S))
    wrong = []
    for _, events in events_of(bank, range(seed, seed + 12), {"kT": 1.5}, 2000):
        changed, named = (next(e for e in events if isinstance(e, kind)) for kind in (ChangeDetected, CauseIdentified))
        assert isinstance(named, CauseIdentified)
        assert named.time_us - changed.time_us >= slowest
        assert named.certain
        wrong += [named.shares[0].cause] if named.shares[0].cause != "kT" else []
    assert len(wrong) <= 1, wrong


def test_what_no_size_fits_well_is_not_called_noise(bank: HypothesisBank, seed: int) -> None:
    """Between two sizes, and far beyond what is clipped: it looks like a lost torque for some memories, in 9 of 100."""
    names = [first_name(bank, experiment(k, {"kT": 2.0}, samples=2400)) for k in range(seed, seed + 60)]
    wrong = [name for name in names if name != "kT"]
    print(f"named wrong {wrong} of {len(names)}")
    assert len(wrong) <= 2  # 2 of 600 are


def first_name(bank: HypothesisBank, rec: Experiment) -> str:
    """The cause that is named first; what comes later is not run."""
    bank.reset()
    for k in range(0, len(rec.y), 100):
        events = bank.run(SampleBlock(rec.t_us[k : k + 100], rec.u[k : k + 100], rec.y[k : k + 100]))
        for event in events:
            if isinstance(event, CauseIdentified):
                return event.shares[0].cause
    raise AssertionError("nothing was named")


def test_no_detector_is_faster_than_the_limit(seed: int) -> None:
    """The figures of the literature for this experiment, 0.39, 0.29 s, by sums of other records."""
    assert limit_s({"kT": 1.2}, range(seed, seed + 200), DAY) == pytest.approx(0.40, abs=0.03)
    assert limit_s({"1/Ja": 1.2}, range(seed, seed + 200), DAY) == pytest.approx(0.29, abs=0.03)
    ones, zeros = np.ones((50, 2)), np.zeros((50, 2))
    assert least_delay(zeros, ones, 0.5, math.exp(9.5)) == 10
    assert least_delay(zeros, ones, 0.5, math.exp(99.0)) == math.inf


@pytest.mark.soak
def test_onset_and_size_are_within_their_intervals(bank: HypothesisBank, seed: int) -> None:
    """Stated: 90 of 100 onsets at least; a size within two of its standard deviations 95."""
    inside, sizes = [], []
    for rec, events in events_of(bank, range(seed, seed + SEEDS), {"kT": 1.2}, 1900):
        named = [e for e in events if isinstance(e, CauseIdentified)]
        if not named:
            continue
        onset, share = named[-1].onset, named[-1].shares[0]
        true_us = rec.t_us[FAULT_AT]
        assert onset.onset_low_us is not None
        assert onset.onset_high_us is not None
        inside.append(onset.onset_low_us <= true_us <= onset.onset_high_us + 5000)
        sizes.append((share.size - math.log(1.2)) / share.size_sd)
    print(f"onset in its interval {np.mean(inside):.3f}, size: mean {np.mean(sizes):.2f}, sd {np.std(sizes):.2f}")
    assert len(inside) > 0.9 * SEEDS
    assert binom.cdf(sum(inside), len(inside), 0.9) > BY_LUCK
    assert np.mean(np.abs(sizes) < 4) > 0.85


def torque(change: Callable[[Floats], Floats]) -> Callable[[Experiment], Experiment]:
    """The measured torque from the fault on."""
    return lambda rec: rec._replace(u=np.append(rec.u[:FAULT_AT], change(rec.u)[FAULT_AT:]))


def output(change: Callable[[Floats], Floats]) -> Callable[[Experiment], Experiment]:
    """The measured output from the fault on."""
    return lambda rec: rec._replace(y=np.append(rec.y[:FAULT_AT], change(rec.y)[FAULT_AT:]))


SENSOR_FAULTS = {
    TORQUE_STUCK: torque(lambda u: np.full_like(u, u[FAULT_AT])),
    OUTPUT_STUCK: output(lambda y: np.full_like(y, y[FAULT_AT])),
    TORQUE_SIGN: torque(lambda u: -u),
    "kT": torque(lambda u: u / 1.3),
    DELAY: torque(lambda u: np.append(u[1:], 0.0)),
    f"{DELAY} back": torque(lambda u: np.append(0.0, u[:-1])),
    TORQUE_OFFSET: torque(lambda u: u - 0.15),
    OUTPUT_NOISE: output(lambda y: y + np.random.default_rng(1).normal(0, 2, len(y))),
}


@pytest.mark.parametrize("fault", SENSOR_FAULTS)
def test_faults_of_sensors_are_named(fault: str, bank: HypothesisBank, seed: int) -> None:
    names = []
    for k in range(seed, seed + 3):
        bank.reset()
        rec = SENSOR_FAULTS[fault](experiment(k, samples=2500))
        named = [e for e in bank.run(SampleBlock(*rec)) if isinstance(e, CauseIdentified)]
        names.append(named[-1].shares[0].cause if named else "")
    print(f"{fault}: {names}")
    assert sum(name == fault.removesuffix(" back") for name in names) >= 2


def test_causes_that_make_the_same_data_are_said_to() -> None:
    found = default_hypotheses(reference_model(), Settings.paper(INTERVAL_S))
    alike = {hypothesis.cause: hypothesis.alike for hypothesis in found}
    assert set(alike["kT"]) == {TORQUE_SCALE, OUTPUT_SCALE}
    assert alike[TORQUE_SIGN] == (OUTPUT_SIGN,)
    assert alike["1/Ja"] == alike["fm"] == ()
    assert not {TORQUE_SCALE, OUTPUT_SCALE, OUTPUT_SIGN} & set(alike)


def test_a_second_change_is_seen_and_the_end_of_both(bank: HypothesisBank, seed: int) -> None:
    """kT from 5 s, 1/Ja, too, from 60 s, all well from 120 s; the naming of each is right in 99 of 100."""
    right = 0
    for k in range(seed, seed + 3):
        bank.reset()
        rec = two_faults(k)
        events = bank.run(SampleBlock(*rec))
        at = [(e.time_us * 1e-6, e.shares[0].cause) for e in events if isinstance(e, CauseIdentified)]
        over = [e.cause for e in events if isinstance(e, CauseEnded)]
        print(at, over)
        first = any(t < 15 and name == "kT" for t, name in at)
        second = any(60 < t < 70 and name == "1/Ja" for t, name in at)
        right += first and second and not bank.active_faults
    assert right >= 1


def two_faults(seed: int) -> Experiment:
    """The reference axis, whose parameters change three times."""
    healthy = experiment(seed, samples=36000, fault_at=35000)
    values = [
        REFERENCE_VALUES,
        faulty(REFERENCE_VALUES, {"kT": 1.2}),
        faulty(REFERENCE_VALUES, {"kT": 1.2, "1/Ja": 1.2}),
        REFERENCE_VALUES,
    ]
    parts = zip(values, np.split(healthy.u, (1000, 12000, 24000)), strict=True)
    noise = np.random.default_rng(seed).standard_normal(36000)
    return Experiment(healthy.t_us, healthy.u, changing_output(three_mass("speed"), parts) + noise)


def test_a_nominal_value_that_may_be_off_turns_no_change_into_a_larger_one(seed: int) -> None:
    """What is allowed for small sizes, as nominal values follow a model, speaks against none once it changed."""
    model, plain = reference_model(), settings_of("speed", seed)
    off = 0.2 * model.scale[model.monitored.index("1/Ja")]
    bank = HypothesisBank(model, plain)
    rec = experiment(seed, samples=4000, fault_at=3999)
    shift = np.zeros((4000, len(model.monitored)))
    shift[:, model.monitored.index("1/Ja")] = off
    allowance = np.max(
        [healthy_evidence(bank, [SampleBlock(*rec, shift=s)]).allowance for s in (shift, 0.0 * shift, -shift)],
        axis=0,
    )
    error = tuple(0.1 * (name == "1/Ja") for name in model.monitored)
    bank = HypothesisBank(model, replace(plain, model_error=error), h=H_FOR_A_DAY, allowance=allowance)
    for k in range(seed, seed + 3):
        bank.reset()
        events = bank.run(SampleBlock(*experiment(k, {"1/Ja": 1.3}, samples=FAULT_AT + 1000)))
        (first, *_, last) = [event.shares[0] for event in events if isinstance(event, CauseIdentified)]
        assert first.cause == last.cause == "1/Ja"
        assert last.size == pytest.approx(math.log(1.3), abs=0.05)


def test_what_a_change_leaves_unexplained_is_no_evidence_of_a_second_one(seed: int) -> None:
    """Beside an axis that is so nominally: a share of the evidence for the change, that of a size 5 % off."""
    model, settings, size = reference_model(), settings_of("speed", seed), math.log(1.1)
    found = [
        candidate_cause(model, settings, "kT").hypothesis(size),
        candidate_cause(model, settings, "fm").hypothesis(0.2),
    ]
    rec = experiment(seed, {"kT": 1.1}, samples=6000, fault_at=0)
    healthy, stands = (HypothesisBank(model, settings, found) for _ in range(2))
    stands.adopt({"kT": size}, None)
    nominally = HypothesisBank(replace(model, nominal={**model.nominal, "kT": 1.1}), settings, found)
    of_change, left, plain = (bank.run_traced(SampleBlock(*rec))[1].llr[1000:] for bank in (healthy, stands, nominally))
    lost = np.mean(plain[:, 1] - left[:, 1])
    assert lost == pytest.approx(0.05**2 * np.mean(of_change[:, 0]), rel=0.2)


def test_a_healthy_axis_is_quiet_and_what_does_not_last_is_over(seed: int) -> None:
    """At h = 8 there are false alarms, one in a quarter of a minute; none of them may stand for ever."""
    bank = bank_of("speed", 8.0, seed)
    events = bank.run(SampleBlock(*experiment(seed, samples=30_000, fault_at=20_000)))
    changed, over = (sum(isinstance(e, kind) for e in events) for kind in (ChangeDetected, CauseEnded))
    print(f"{changed} alarms, {over} over")
    assert changed > 3
    assert over >= changed / 2
    assert len(bank.active_faults) <= 2


def test_friction_is_a_gain_where_its_effect_is_proportional_to_it() -> None:
    """Not in an output-error predictor, which remembers for as long as the friction lets it."""
    watched = lasting_changes.monitor()
    for model, s, is_gain in (
        (watched.model, watched.settings, True),
        (reference_model(), settings_of("speed", 0), False),
    ):
        rec = experiment(0, output=model.drive.output)
        for name in {"fm", "fc"}.intersection(model.monitored):
            hypotheses = [candidate_cause(model, s, name).hypothesis(size) for size in (0.2, 0.8)]
            _, trace = HypothesisBank(model, s, hypotheses).run_traced(SampleBlock(*rec), reference=True)
            effect = np.nanstd(trace.eps[:, 1:] - trace.eps[:, :1], axis=0) / np.expm1([0.2, 0.8])
            assert bool(effect[1] > 0.95 * effect[0]) is is_gain
            assert all(hypothesis.is_gain is is_gain for hypothesis in hypotheses)
