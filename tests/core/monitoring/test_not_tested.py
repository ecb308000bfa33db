"""A parameter that is not tested says so, with the reason; and what is advised gets it tested."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection import MultiModelDetector, MultiModelThresholds
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS, Experiment
from monitor_core.kernel.state import UNSEEN
from monitor_core.monitoring import AxisMonitor, MonitoringOptions, NotTested, Status, recommended_settings
from monitor_core.monitoring.recommended_settings import SettingsError
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.supervised import MODEL, SUPERVISED, TORQUE_NOISE, H, lively_then_still, moved

NAMES = MODEL.monitored
P0 = tuple((0.02 * MODEL.scale) ** 2)


def lively(seed: int, samples: int) -> Experiment:
    rng = np.random.default_rng(seed)
    return moved("speed", multisine(rng, samples, H, BAND_HZ, TORQUE_RMS), rng)


def reasons(monitor: AxisMonitor) -> list[NotTested | None]:
    return [p.not_tested for p in monitor.status().parameters]


def test_through_the_life_of_an_axis_and_the_time_for_which_it_is_tested(seed: int) -> None:
    """Settling takes 1 s, P(0) ten memories of 0.25 s, then all is tested; any cut of the samples counts the same."""
    settings = replace(SUPERVISED, lam=0.98)
    rec = lively(seed, 900)
    monitor, other = AxisMonitor(MODEL, settings), AxisMonitor(MODEL, settings)
    assert reasons(monitor) == 3 * [NotTested.NO_SAMPLE]
    seen, statuses = list[NotTested | None](), [monitor.status().parameters[0].status]
    for k in range(900):
        monitor.update(SampleBlock(*rec).select(slice(k, k + 1)))
        seen += reasons(monitor)[:1]
        statuses.append(monitor.status().parameters[0].status)
    assert seen == 200 * [NotTested.SETTLING] + 499 * [NotTested.SEEDING] + 201 * [None]
    assert list(dict.fromkeys(statuses)) == [Status.WAITING, Status.SETTLING, Status.SEEDING, Status.TRACKING]
    assert {p.tested_s for p in monitor.status().parameters} == {200 * H}
    assert monitor.status().untested() == monitor.status().untested_so_far() == {}
    other.update(SampleBlock(*rec))
    assert other.status() == monitor.status()


def test_a_closed_gate_and_unknown_conditions(seed: int) -> None:
    """For longer than a memory: until then a robot rests between two motions."""
    settings = replace(SUPERVISED, P0=P0)
    N, memory = 600, round(SUPERVISED.memory)
    rec = lively(seed, N)
    for closed, reason in ((memory + 2, NotTested.CONDITIONS), (memory - 2, None)):
        unknown = np.where(np.arange(N) < N - closed, 0.0, np.nan)
        for own in ({"gate": unknown == 0}, {"shift": np.column_stack(3 * [unknown])}):
            monitor = AxisMonitor(MODEL, settings)
            monitor.update(SampleBlock(*rec, **own))
            assert reasons(monitor) == 3 * [reason]
        saved = AxisMonitor(MODEL, settings)
        saved.from_arrays(monitor.to_arrays())
        assert reasons(saved) == reasons(monitor)


def test_standing_still_before_and_after_P0_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rec = moved("speed", lively_then_still(rng, 1000, 4000, 10), rng)
    quiet = rec._replace(y=np.where(np.arange(len(rec.y)) < 1200, rec.y, 0.0))
    for settings in (SUPERVISED, replace(SUPERVISED, P0=P0)):
        monitor = AxisMonitor(MODEL, settings)
        monitor.update(SampleBlock(*quiet).select(slice(0, 5000)))
        assert reasons(monitor) == 3 * [NotTested.NOT_OBSERVED]


@pytest.mark.parametrize(
    ("unjudged", "reason"), [(2600, NotTested.WARM_UP), (0, None), (3000, NotTested.WARM_UP)], ids=str
)
def test_an_unknown_heat_is_the_reason_where_the_samples_would_have_sufficed(
    unjudged: int, reason: NotTested | None, seed: int
) -> None:
    """A gate leaves out more of the samples, but with a heat that had been known they would have been enough."""
    settings = replace(SUPERVISED, P0=P0, lam=0.98)  # a memory of 50 samples
    samples = SampleBlock(*lively(seed, 3000), gate=np.arange(3000) % 100 < 20)
    monitor = AxisMonitor(MODEL, settings)
    monitor.judge(unjudged == 0)
    monitor.update(samples.select(slice(unjudged)))
    learned = monitor.learned
    if unjudged < 3000:
        monitor.judge(True)
        monitor.update(samples.select(slice(unjudged, None)))
    status = monitor.status()
    assert status.counters["gated"] > status.counters["used"]
    assert status.untested_so_far() == ({} if reason is None else {reason: NAMES})
    assert status.unjudged_s == learned * H
    restored = AxisMonitor(MODEL, settings)
    restored.judge(False)  # as at a start at an unknown heat
    restored.from_arrays(monitor.to_arrays())
    assert restored.status().unjudged_s == 0


def test_the_multimodel_detector_needs_no_P0_and_has_its_own_time(seed: int) -> None:
    detector = MultiModelDetector(MODEL, SUPERVISED, MultiModelThresholds(1e6))
    monitor = AxisMonitor(MODEL, SUPERVISED, detector, "multimodel")
    monitor.update(SampleBlock(*lively(seed, 1000)))
    assert reasons(monitor) == 3 * [None]
    assert {p.tested_s for p in monitor.status().parameters} == {800 * H}
    assert monitor.status().untested_so_far() == {}


# --- P(0) is not found: the record is too short, or a parameter cannot be determined ----------------------------------


RECOMMENDED = MonitoringOptions(torque_noise=TORQUE_NOISE, output_noise=1.0, settling_time_s=1.0)


def monitored(model: AxisModel, options: MonitoringOptions, rec: Experiment) -> AxisMonitor:
    monitor = AxisMonitor(model, recommended_settings(model, H, options))
    monitor.update(SampleBlock(*rec))
    return monitor


def test_a_record_too_short_for_ten_memories_and_the_memory_that_is_advised(seed: int) -> None:
    rec = lively(seed, 6 * 200)
    monitor = monitored(MODEL, RECOMMENDED, rec)
    status = monitor.status()
    assert status.untested_so_far() == {NotTested.SEEDING: NAMES}
    remedy = status.remedy
    assert remedy is not None
    assert (remedy.seeding_s, remedy.record_s) == pytest.approx((10.0, 21.0))
    assert remedy.left_s == pytest.approx(10 - 5, abs=2 * H)
    assert remedy.memory_s == pytest.approx(5 / 20, rel=0.1)
    shorter = replace(RECOMMENDED, memory_s=remedy.memory_s, joint_state=remedy.joint_state or None)
    assert monitored(MODEL, shorter, rec).status().untested_so_far() == {}
    longer = lively(seed, round(remedy.record_s / H) + 1)
    assert monitored(MODEL, RECOMMENDED, longer).status().untested_so_far() == {}


def test_no_memory_is_advised_that_the_predictor_does_not_allow(seed: int) -> None:
    """With little torque noise the predictor is slow: a second of motion is too short for any memory."""
    slow = replace(RECOMMENDED, torque_noise=0.003)
    remedy = monitored(MODEL, slow, lively(seed, 400)).status().remedy
    assert remedy is not None
    assert remedy.memory_s is None
    with pytest.raises(SettingsError):
        recommended_settings(MODEL, H, replace(slow, memory_s=1.0 / 20, joint_state=True))


def steady(seed: int, samples: int) -> Experiment:
    """Slow motion that shows friction and torque offset, but no damping of the gearbox."""
    rng = np.random.default_rng(seed)
    return moved("speed", multisine(rng, samples, H, (0.0, 3.0), TORQUE_RMS), rng)


def test_one_parameter_that_cannot_be_determined_is_named_and_without_it_the_others_are_tested(
    seed: int,
) -> None:
    rec = steady(seed, 3000)
    with_dg = replace(MODEL, monitored=("kT", "fm", "dg"), scales={}, bounds={})
    settings = replace(SUPERVISED, lam=1 - H / 0.5, settle_s=0.5)
    monitor = AxisMonitor(with_dg, settings)
    monitor.update(SampleBlock(*rec))
    assert monitor.status().counters["seeding"] > 2 * settings.seed_updates
    assert monitor.status().untested_so_far() == {
        NotTested.BLOCKED: ("kT", "fm"),
        NotTested.UNCERTAIN: ("dg",),
    }
    assert monitor.batch.state.observed[2, 0] == UNSEEN
    without = AxisMonitor(replace(with_dg, monitored=("kT", "fm")), settings)
    without.update(SampleBlock(*rec))
    assert without.status().untested_so_far() == {}


def test_a_change_that_the_tests_cannot_find_by_its_whole_size_is_not_tested(seed: int) -> None:
    """With a standard deviation of the whole size, nu is three times that."""
    rough = replace(SUPERVISED, P0=tuple(MODEL.scale**2 / SUPERVISED.lam0), information_floor=0.0)
    sharp: Floats = MODEL.scale * [0.01, 0.01, 1.0]
    for settings, untested in ((rough, NAMES), (replace(rough, P0=tuple(sharp**2 / rough.lam0)), ("fm",))):
        monitor = AxisMonitor(MODEL, settings)
        monitor.batch.state.P[:, :, 0] = np.diag(settings.P0)
        monitor.update(SampleBlock(np.arange(202) * 5000, np.zeros(202), np.zeros(202)))
        st = monitor.batch.state
        st.P[:, :, 0], st.observed[:], st.mode[:] = np.diag(settings.P0), 0, 7
        assert monitor.status().untested().get(NotTested.UNCERTAIN, ()) == untested


# --- Advice about the memory, when an axis is set up ------------------------------------------------------------------


def advice(options: MonitoringOptions) -> str:
    with pytest.raises(SettingsError) as caught:
        recommended_settings(MODEL, H, options)
    return str(caught.value)


SHORT = MonitoringOptions(torque_noise=0.003, output_noise=1.0, memory_s=0.2)


def number_after(words: str, text: str) -> float:
    return float(text.split(words)[1].split()[0].rstrip(","))


def test_each_way_out_of_a_memory_that_is_too_short_works() -> None:
    words = advice(SHORT)
    assert "Set joint_state = true, raise memory_s to" in words
    for changed in (
        {"joint_state": True},
        {"memory_s": number_after("memory_s to ", words)},
        {"torque_noise": number_after("torque_noise to ", words)},
    ):
        assert isinstance(recommended_settings(MODEL, H, replace(SHORT, **changed)), Settings)


def test_only_ways_that_are_open_are_named() -> None:
    """A gain from the file of nominal values is not changed by a noise, and more noise may make a predictor slower."""
    assert "joint_state" not in advice(replace(SHORT, memory_s=0.05))
    gain = tuple(recommended_settings(MODEL, H, replace(SHORT, memory_s=10.0)).K)
    assert "torque_noise" not in advice(replace(SHORT, gain=gain, innovation_variance=1.0))
    assert "torque_noise" not in advice(replace(SHORT, torque_noise=1.0))
