"""The multi-model detector as the detector of an axis: from samples to alarms, saved, restored, adopted, looking on."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm, Cause, FormerName
from monitor_core.detection.alarm import MODEL_ERROR, OUTPUT_NOISE, TORQUE_OFFSET, TORQUE_SIGN, Onset
from monitor_core.detection.multimodel.candidates import candidate_cause, causes_of
from monitor_core.detection.multimodel.hypothesis import HEALTHY
from monitor_core.detection.multimodel.multimodel_detector import (
    HypothesisThreshold,
    MultiModelDetector,
    MultiModelThresholds,
    bank_of,
)
from monitor_core.detection.multimodel.naming import (
    CauseEnded,
    CauseIdentified,
    ChangeDetected,
    Event,
    Share,
    SizeCorrected,
)
from monitor_core.drive.structure import DELAY
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, FAULT_AT, NOISE, TORQUE_RMS, Experiment, experiment
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, reference_model, three_mass
from monitor_core.monitoring import AxisMonitor, Fleet
from monitor_core.monitoring.alarm_tracker import AlarmTracker
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import BY_NAME
from tests.core.figures import settings_of
from tests.core.laws import part
from tests.core.simulated import simulated
from tests.shares import soaked

MODEL = reference_model()
DAY = MultiModelThresholds(86400 / INTERVAL_S)
ONSET = Onset(4, 3, 5)
DETECTOR = MultiModelDetector(MODEL, Settings.paper(INTERVAL_S), DAY)


def share(cause: str, size: float = 0.2, probability: float = 1.0) -> Share:
    return Share(cause, probability, size, 0.01)


def changed(t: int, cause: str, size: float = 0.2) -> ChangeDetected:
    return ChangeDetected(t, ONSET, (share(cause, size),))


def named(t: int, since: int, *shares: Share) -> CauseIdentified:
    return CauseIdentified(t, since, ONSET, shares, certain=True)


class Book(AlarmTracker):
    """Open alarms, fed with events of the bank."""

    def take(self, event: Event) -> list[Alarm]:
        return [change.alarm for change in self.update([event], DETECTOR.interpret)]


def open_alarms(book: Book) -> list[tuple[int, str, str, str]]:
    return [(e.raised_us, e.stage, e.parameter, e.direction) for e in book.open]


def feed(*events: Event) -> tuple[Book, list[list[Alarm]]]:
    book = Book()
    return book, [book.take(event) for event in events]


# --- the book ----------------------------------------------------------------------------------------


def test_an_alarm_is_raised_named_corrected_once_and_ended() -> None:
    fm, kT = share("fm", 0.2, 0.99), share("kT", 0.1, 0.01)
    book, alarms = feed(
        changed(10, "kT"), named(12, 10, fm, kT), named(20, 10, share("kT", 0.1)), CauseEnded(30, 28, "kT")
    )
    ((raised,), (first,), (corrected,), (ended,)) = alarms
    assert (raised.stage, raised.parameter, raised.onset_us, raised.onset_low_us) == ("changed", "kT", 4, 3)
    assert (first.stage, first.parameter, first.causes) == (
        "named",
        "fm",
        (Cause("fm", 0.99), Cause("kT", 0.01)),
    )
    assert first.size == pytest.approx(0.06 * np.expm1(0.2))
    stated = np.hypot(0.06 * np.exp(0.2) * 0.01, MODEL_ERROR * 0.06 * np.expm1(0.2))
    assert first.size_sd == pytest.approx(stated)
    assert corrected.past == (FormerName(12, "changed", "kT", "up"), FormerName(20, "named", "fm", "up"))
    assert (ended.ended_us, ended.first, ended.raised_us) == (30, ("kT", "up"), 10)
    assert book.open == ()


def test_a_corrected_size_belongs_to_the_open_alarm_of_its_cause() -> None:
    book, (_, (before,)) = feed(changed(10, "kT"), named(12, 10, share("kT", 0.2)))
    (after,) = book.take(SizeCorrected(20, 10, share("kT", 0.1)))
    assert after == replace(before, updated_us=20, size=after.size, size_sd=after.size_sd)
    assert after.size == pytest.approx(np.expm1(0.1))
    assert book.take(SizeCorrected(30, 10, share("fm", 0.1))) == []


def test_a_cause_whose_evidence_began_after_the_alarm_leaves_its_onset() -> None:
    """No alarm is raised before its own onset, whatever cause explains more later."""
    fm, later, about = share("fm"), Onset(18, 15, 19), Onset(11, 2, 14)
    _, ((raised,), (named_later,)) = feed(changed(10, "kT"), CauseIdentified(20, 10, later, (fm,), certain=True))
    assert named_later.onset == raised.onset == ONSET
    _, (_, (named_soon,)) = feed(changed(10, "kT"), CauseIdentified(20, 10, about, (fm,), certain=True))
    assert named_soon.onset == Onset(10, 2, 10)
    _, ((at_once,),) = feed(CauseIdentified(20, 10, later, (fm,), certain=True))
    assert at_once.onset == Onset(10, None, 10)


def test_the_same_cause_soon_after_the_end_reopens_its_alarm_whatever_was_seen_first() -> None:
    book = Book(reopen_us=100)
    for event in (changed(10, "kT"), named(12, 10, share("kT")), CauseEnded(30, 28, "kT")):
        book.take(event)
    assert book.take(changed(40, "fm")) == []
    (again,) = book.take(named(45, 40, share("kT", 0.4)))
    assert (again.key, again.reopened_us, again.onset, again.ended_us) == ((10, "kT", "up"), 40, ONSET, None)
    (refined,) = book.take(named(50, 40, share("kT", 0.3)))
    assert refined.key == again.key
    assert refined.size == pytest.approx(np.expm1(0.3))
    (ended,) = book.take(CauseEnded(60, 58, "kT"))
    assert (ended.key, ended.ended_us) == (again.key, 60)


def test_what_does_not_last_ends_and_a_cause_that_stands_takes_what_is_more_of_it() -> None:
    book, alarms = feed(
        changed(10, "kT"),
        named(12, 10, share("kT")),
        changed(40, "fm", -0.3),
        named(45, 40, share("kT", 0.4)),
    )
    assert open_alarms(book) == [(10, "named", "kT", "up")]
    assert [(e.raised_us, e.ended_us) for e in alarms[3]] == [(10, None)]
    assert book.open[0].size == pytest.approx(np.expm1(0.4))
    assert book.open[0].onset_us == 4
    (again,) = book.take(changed(60, "kT", 0.1))
    assert (again.raised_us, again.crossings) == (10, 2)
    assert book.take(CauseEnded(70, 60, HEALTHY)) == []
    assert open_alarms(book) == [(10, "named", "kT", "up")]
    assert book.take(changed(80, "fm")) == []
    assert [(a.parameter, a.raised_us) for a in book.unreported] == [("fm", 80)]
    assert book.take(CauseEnded(90, 80, HEALTHY)) == []
    assert book.unreported == ()


def test_more_of_a_cause_does_not_decide_which_one_it_is() -> None:
    """What is seen later is seen from the axis with that cause: it tells nothing of what else that may have been."""
    kT, load = share("kT", 0.2, 0.6), share("fm", 0.2, 0.4)
    book, _ = feed(changed(10, "kT"), named(12, 10, kT, load), changed(40, "kT"))
    (more,) = book.take(named(45, 40, share("kT", 0.3, 0.9), share("1/Ja", 0.2, 0.1)))
    assert more.causes == (Cause("kT", 0.6), Cause("fm", 0.4))
    assert more.size == pytest.approx(np.expm1(0.3))


def test_more_of_a_cause_changes_its_size_once_it_has_lasted() -> None:
    book, _ = feed(changed(10, "kT"), named(12, 10, share("kT", 0.2)), changed(40, "kT"))
    (more,) = book.take(replace(named(45, 40, share("kT", -0.1)), settled=False))
    assert more.size == pytest.approx(np.expm1(0.2))
    assert more.direction == "up"
    (more,) = book.take(named(50, 40, share("kT", -0.1)))
    assert more.size == pytest.approx(np.expm1(-0.1))
    assert more.direction == "down"


def test_another_cause_than_the_one_that_stands_at_first_sight_is_an_alarm_of_its_own() -> None:
    book, _ = feed(changed(10, "kT"), named(12, 10, share("kT")), changed(40, "kT"), named(45, 40, share("fm")))
    assert open_alarms(book) == [(10, "named", "kT", "up"), (40, "named", "fm", "up")]
    book.take(named(50, 40, share("1/Ja")))
    assert open_alarms(book) == [(10, "named", "kT", "up"), (40, "named", "1/Ja", "up")]
    assert book.is_open("1/Ja")
    assert not book.is_open("fm")


def test_that_all_is_as_it_was_raises_nothing() -> None:
    book, alarms = feed(changed(10, HEALTHY), named(12, 10, share(HEALTHY)), CauseEnded(20, 10, HEALTHY))
    assert (book.open, alarms) == ((), [[], [], []])


# --- quantities --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["paper", "speed-zero-nominals", "speed-skew", "angle-paper"])
def test_sizes_go_there_and_back(name: str) -> None:
    model, s = BY_NAME[name].model, BY_NAME[name].settings()
    for cause in causes_of(model):
        quantity = candidate_cause(model, s, cause).quantity
        change, sd = quantity.change(0.25, 0.01)
        if np.isfinite(change):
            assert quantity.size(change) == pytest.approx(0.25)
            assert quantity.change(0.26, 0.01)[0] - change == pytest.approx(sd, rel=0.02)
            assert quantity.unit
    assert candidate_cause(model, s, DELAY).quantity.change(1.0, 0.0)[0] == pytest.approx(s.interval_s)
    assert np.isnan(candidate_cause(model, s, TORQUE_SIGN).quantity.change(np.nan, np.nan)[0])
    assert np.isnan(candidate_cause(model, s, OUTPUT_NOISE).quantity.size(-2.0))
    assert candidate_cause(model, s, TORQUE_OFFSET).quantity.unit == "N m"
    with pytest.raises(KeyError):
        candidate_cause(model, s, "nothing")


# --- from samples to alarms --------------------------------------------------------------------------


def detector(seed: int, thresholds: MultiModelThresholds = DAY) -> MultiModelDetector:
    return MultiModelDetector(MODEL, settings_of("speed", seed), thresholds)


def monitor(seed: int, alarms: str = "multimodel") -> AxisMonitor:
    settings = settings_of("speed", seed)
    return AxisMonitor(MODEL, settings, MultiModelDetector(MODEL, settings, DAY), alarms)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fault", "sign", "name"),
    [({"kT": 0.7}, 1, ("kT", "down")), ({}, -1, (TORQUE_SIGN, "up"))],
    ids=["parameter", "sensor"],
)
def test_a_cause_is_named_with_its_size(fault: dict[str, float], sign: int, name: tuple[str, str], seed: int) -> None:
    right = 0
    for k in range(seed, seed + 3):
        watched = monitor(k)
        rec = experiment(k, fault, samples=2600)
        rec.u[FAULT_AT:] *= sign
        watched.update(SampleBlock(*rec))
        found = watched.open_alarms
        if [(e.parameter, e.direction, e.stage) for e in found] == [(*name, "named")]:
            right += 1
            if fault:
                assert found[0].size == pytest.approx(-0.3, abs=0.1)
                assert found[0].causes[0].alike == ("torque scale", "output scale")
    assert right >= 2


def test_a_fault_from_the_first_sample_on_may_have_begun_before_it(seed: int) -> None:
    rec = experiment(seed, {"kT": 0.7}, samples=2600)
    faulty = SampleBlock(rec.t_us[FAULT_AT:], rec.u[FAULT_AT:], rec.y[FAULT_AT:])
    for record, known in ((faulty, False), (SampleBlock(*rec), True)):
        watched = monitor(seed)
        watched.update(record)
        (alarm,) = watched.open_alarms
        assert (alarm.onset_low_us is not None) == known


def test_each_detector_alarms_where_it_is_the_source_and_shows_its_evidence_elsewhere(seed: int) -> None:
    rec = SampleBlock(*experiment(seed, {"1/Ja": 1.5}, samples=2600))
    by_cusum, by_multimodel = monitor(seed, "cusum"), monitor(seed)
    (first, *_), (second, *_) = by_cusum.update(rec), by_multimodel.update(rec)
    assert first.alarm.raised_us != second.alarm.raised_us
    for watched in (by_cusum, by_multimodel):
        status = watched.status().detectors
        assert [d.name for d in status] == ["cusum", "multimodel"]
        assert [d.name for d in status if d.alarms] == [watched.alarm_source]
        assert all(d.leading and d.evidence >= 0 for d in status)
    assert by_cusum.status().detectors[0].evidence == by_multimodel.status().detectors[0].evidence
    assert by_cusum.causes == MODEL.monitored
    assert set(by_multimodel.causes) > set(MODEL.monitored)


def state(watched: AxisMonitor) -> list[bytes]:
    assert watched.multimodel is not None
    arrays = watched.to_arrays() | {f"beside {k}": v for k, v in watched.multimodel.bank.to_arrays().items()}
    return [array.tobytes() for array in arrays.values()]


@pytest.mark.parametrize("at", soaked([500, 1040, 1150, 1500], 1040, 1150))
def test_a_saved_detector_goes_on(at: int, seed: int) -> None:
    """Also where something has changed and is not named, or is named and its size is looked for."""
    rec = experiment(seed, {"1/Ja": 1.3}, samples=1600)
    uninterrupted, first = monitor(seed), monitor(seed)
    uninterrupted.update(SampleBlock(*rec))
    first.update(SampleBlock(*part(rec, 0, at)))
    second = monitor(seed)
    assert second.multimodel_key == first.multimodel_key
    assert first.multimodel is not None
    assert second.multimodel is not None
    second.from_arrays(first.to_arrays())
    second.multimodel.bank.from_arrays(first.multimodel.bank.to_arrays())
    second.adopt(first.open_alarms)  # the journal says the same
    second.update(SampleBlock(*part(rec, at)))
    assert state(second) == state(uninterrupted)


_GO_ON = """
import sys
import numpy as np
from monitor_core.kernel.hypotheses import run_hypotheses
from tests.core.detection.multimodel.test_hypothesis_bank import DETECTOR
with np.load(sys.argv[1]) as saved:
    DETECTOR.from_arrays(dict(saved))
assert not run_hypotheses.signatures
print(*(f"{h.cause}/{h.size}/{h.alike}" for h in DETECTOR.bank.hypotheses))
"""


def test_a_saved_detector_is_restored_without_the_kernel(tmp_path: Path) -> None:
    """A daemon that was upgraded answers before its kernel has been compiled."""
    made = MultiModelDetector(MODEL, Settings.paper(INTERVAL_S), DAY)
    hypotheses = [f"{h.cause}/{h.size}/{h.alike}" for h in made.bank.hypotheses]
    arrays = made.to_arrays()
    assert arrays is not None
    np.savez(tmp_path / "saved.npz", **arrays)  # type: ignore[arg-type]
    command = [sys.executable, "-c", _GO_ON, str(tmp_path / "saved.npz")]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (answer.stdout.strip(), answer.stderr) == (" ".join(hypotheses), "")


def test_a_saved_detector_with_other_candidates_is_refused() -> None:
    made = MultiModelDetector(MODEL, Settings.paper(2 * INTERVAL_S), DAY)
    arrays = DETECTOR.bank.to_arrays() | {"distinct": np.frombuffer(b'[[999, ["kT"]]]', np.uint8)}
    with pytest.raises(ValueError, match=r"there are \d+ candidates"):
        made.from_arrays(arrays)


def test_a_fleet_does_what_its_axes_do(seed: int) -> None:
    settings = settings_of("speed", seed)
    rec = experiment(seed, {"kT": 1.3}, samples=1600)
    fleet = Fleet([MODEL] * 2, [settings] * 2, {1: MultiModelDetector(MODEL, settings, DAY)}, {1: "multimodel"})
    fleet.update({a: SampleBlock(rec.t_us, rec.u, rec.y) for a in (0, 1)})
    alone = monitor(seed)
    alone.update(SampleBlock(*rec))
    assert state(fleet.monitors[1]) == state(alone)
    assert fleet.monitors[0].multimodel is None
    with pytest.raises(ValueError, match="is the alarm source, but does not run"):
        Fleet([MODEL], [settings], alarm_sources={0: "multimodel"})


# --- after a restart: the journal is right about what is open ------------------------------------------


def repaired(seed: int, broken: int, samples: int) -> tuple[Experiment, Floats]:
    """Well again from sample ``broken`` on: the torque is scaled as kT was, exactly."""
    rec = experiment(seed, samples=samples, fault_at=samples - 1)
    return rec._replace(u=np.where(np.arange(samples) < broken, rec.u / 1.3, rec.u)), rec.u


def test_an_alarm_that_the_bank_has_forgotten_stands_and_ends(seed: int) -> None:
    """Of kT by +30 %, then well: the adopted alarm is not raised again, and it ends."""
    rec, _ = repaired(seed, 1500, 4000)
    fresh = monitor(seed)
    old = Alarm("kT", "up", 1, 2, 3, None, 0.3, 0.01, 1, "named", (Cause("kT", 1.0),), "", None, None, "", ())
    fresh.adopt([old])
    before = fresh.update(SampleBlock(*part(rec, 0, 1500)))
    assert [c.alarm.parameter for c in before if c.alarm.raised_us != 2] == []
    assert [e.raised_us for e in fresh.open_alarms] == [2]
    fresh.update(SampleBlock(*part(rec, 1500)))
    assert 2 not in [e.raised_us for e in fresh.open_alarms]


def test_an_alarm_without_a_name_gets_one_or_ends(seed: int) -> None:
    """Its evidence is lost: the bank looks at it for three memories."""
    rec = experiment(seed, samples=1500)
    old = Alarm("fm", "up", 1, 2, 2, None, 0.01, 0.01, 1)
    fresh = monitor(seed)
    fresh.adopt([old])
    changes = fresh.update(SampleBlock(*rec))
    assert [(c.kind, c.alarm.raised_us) for c in changes if c.alarm.raised_us == 2] == [("ended", 2)]


def test_a_sensor_fault_that_was_open_stands(seed: int) -> None:
    rec = experiment(seed, samples=1500)
    sign = replace(Alarm(TORQUE_SIGN, "up", 1, 2, 2, None, np.nan, np.nan, 1), stage="named")
    fresh = monitor(seed)
    fresh.adopt([sign])
    fresh.update(SampleBlock(rec.t_us, -rec.u, rec.y))
    assert [e.raised_us for e in fresh.open_alarms] == [2]


# --- disturbances that do not last ---------------------------------------------------------------------


def disturbed(rec: Experiment, samples: int, factor: float, begin: int = 2000) -> SampleBlock:
    """With another torque constant for so many samples, exactly."""
    u = rec.u.copy()
    u[begin : begin + samples] /= factor
    return SampleBlock(rec.t_us, u, rec.y)


@pytest.mark.parametrize("factor", [0.5, 1.1, 2.0])
@pytest.mark.parametrize("samples", [50, 200, 400])
def test_what_lasts_for_seconds_leaves_no_alarm(samples: int, factor: float, seed: int) -> None:
    for k in range(seed, seed + 3):
        watched = monitor(k)
        changes = watched.update(disturbed(experiment(k, samples=7000), samples, factor))
        assert watched.open_alarms == (), k
        assert watched.multimodel is not None
        assert not watched.multimodel.bank.active_faults, k
        assert {c.kind for c in changes} <= {"ended"}, k


def test_what_lasts_for_seconds_leaves_the_size_of_an_alarm(seed: int) -> None:
    for k in range(seed, seed + 3):
        watched, sizes = monitor(k), list[float | None]()
        rec = experiment(k, {"kT": 0.8}, samples=12_000, fault_at=0)
        samples = disturbed(rec, 100, 0.5, 6000)
        for first in range(0, samples.size, 200):
            watched.update(samples.select(slice(first, first + 200)))
            sizes += [a.size for a in watched.open_alarms if a.parameter == "kT"] if first >= 5000 else []
        assert [a.parameter for a in watched.open_alarms] == ["kT"], k
        assert np.array(sizes, float) == pytest.approx(-0.2, abs=0.03), k


def with_torque(rec: Experiment, samples: int, size: float) -> SampleBlock:
    """With a torque that acts besides the measured one for so many samples; ``size``: relative to the measured one."""
    u = rec.u.copy()
    u[2000 : 2000 + samples] -= size * rec.u.std() * np.sin(np.pi * np.arange(samples) / samples)
    return SampleBlock(rec.t_us, u, rec.y)


@pytest.mark.parametrize("size", [0.2, 0.3, 0.6])
@pytest.mark.parametrize("samples", [100, 200])
def test_a_torque_that_acts_for_a_second_is_no_lasting_fault(samples: int, size: float, seed: int) -> None:
    for k in range(seed, seed + 3):
        events = detector(k).bank.run(with_torque(experiment(k, samples=6000), samples, size))
        assert [type(event) for event in events][-1:] in ([], [CauseEnded]), k
        assert not [event for event in events if isinstance(event, CauseIdentified) and event.settled], k


def test_a_fault_of_an_axis_that_then_stands_is_still_there(seed: int) -> None:
    """Nothing speaks for it meanwhile, and nothing against it."""
    for k in range(seed, seed + 3):
        rng = np.random.default_rng(k)
        u = np.concatenate([multisine(rng, 1000, INTERVAL_S, BAND_HZ, TORQUE_RMS), np.zeros(6000)])
        values = REFERENCE_VALUES | {"kT": 0.8}
        rec = simulated(rng, three_mass("speed"), u, output_noise=NOISE["speed"], values=values)
        watched = monitor(k)
        watched.update(SampleBlock(rec.t_us, rec.u, rec.y))
        assert [a.parameter for a in watched.open_alarms] == ["kT"], k


def test_a_size_is_corrected_although_a_disturbance_came_between(seed: int) -> None:
    for k in range(seed, seed + 3):
        samples = with_torque(experiment(k, {"kT": 0.8}, samples=7000, fault_at=0), 200, -1.0)
        events = [type(event) for event in detector(k).bank.run(samples)]
        fault, disturbance = 2 * [CauseIdentified], [ChangeDetected, CauseIdentified, CauseEnded]
        assert events == [ChangeDetected, *fault, *disturbance, SizeCorrected], k


def test_an_alarm_of_noise_ends_with_the_noise(seed: int) -> None:
    rng, rec = np.random.default_rng(seed), experiment(seed, samples=9000)
    y, noise = rec.y.copy(), NOISE["speed"] * rng.normal(size=2000)
    y[2000:4000] += 2.0 * noise
    watched = monitor(seed)
    watched.update(SampleBlock(*part(rec._replace(y=y), 0, 3900)))
    assert [a.parameter for a in watched.open_alarms] == [OUTPUT_NOISE]
    watched.update(SampleBlock(*part(rec._replace(y=y), 3900)))
    assert watched.open_alarms == ()


# --- thresholds ------------------------------------------------------------------------------------------


def test_thresholds_of_a_record_say_which_hypotheses_there_are(seed: int) -> None:
    own = (HypothesisThreshold("kT", 0.2, 9.0, 0.01, ("torque scale",)), HypothesisThreshold(TORQUE_SIGN, np.nan, 8.0))
    bank = bank_of(MODEL, settings_of("speed", seed), MultiModelThresholds(1e6, own))
    assert bank.causes == ("kT", TORQUE_SIGN)
    assert bank.hypotheses[0].alike == ("torque scale",)
    with pytest.raises(ValueError, match="thresholds of nothing, which the axis does not have"):
        detector(seed, MultiModelThresholds(1e6, (HypothesisThreshold("nothing", 0.2, 9.0),)))


def test_a_size_that_was_read_a_tenth_off_is_put_right_and_nothing_else_is_found(seed: int) -> None:
    """What is left of the change is smaller than any other size of its cause."""
    wrong = 1.1 * np.log(0.8)
    bank = detector(seed).bank
    bank.adopt({"kT": wrong}, None)
    t_us, u, y = experiment(seed, {"kT": 0.8}, samples=40_000, fault_at=0)
    named = [event for event in bank.run(SampleBlock(t_us, u, y)) if isinstance(event, CauseIdentified)]
    assert {event.shares[0].cause for event in named} == {"kT"}
    (size,) = bank.active_faults.to_array()[:, 1]
    assert abs(size - np.log(0.8)) < abs(wrong - np.log(0.8)) / 3


def test_a_skew_that_healthy_records_show_is_no_fault(seed: int) -> None:
    own = tuple(HypothesisThreshold(DELAY, size, 9.0, allowance) for size, allowance in ((-1.0, 0.1), (1.0, 0.0)))
    offset = HypothesisThreshold(TORQUE_OFFSET, 0.3, 9.0, 0.1)
    found = detector(seed, MultiModelThresholds(0.0, (*own, offset))).bank
    assert [(h.cause, h.size) for h in found.hypotheses] == [(DELAY, 1.0), (TORQUE_OFFSET, 0.3)]
    assert found.allowance.tolist() == [0.0, 0.1]


def test_where_there_can_be_no_bank(seed: int) -> None:
    case = BY_NAME["angle-paper"]
    with pytest.raises(ValueError, match="not stable"):
        MultiModelDetector(case.model, replace(case.settings(), K=()), DAY)
    with pytest.raises(ValueError, match="cannot distinguish some"):
        MultiModelDetector(MODEL, replace(settings_of("speed", seed), unidentifiable=(("kT", "fm"),)), DAY)
