"""What is found of faults that begin in a record: as if the whole record had been run with the fault in it."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration import injection
from monitor_core.calibration.fault_trials import PROBES, run_trials
from monitor_core.calibration.injection import InjectedFault, changed_values, equivalent_load, faulty_torque, inject
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.simulated_copies import Plants, innovations
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.isolability import default_hypotheses
from monitor_core.detection.multimodel.multimodel_detector import HypothesisThreshold, MultiModelThresholds
from monitor_core.detection.multimodel.naming import Event
from monitor_core.drive.structure import Output
from monitor_core.modeling.standard_drives import INTERVAL_S
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Threshold
from tests.core.calibration.healthy_axes import plant_with, record
from tests.core.cases import Case
from tests.core.simulated import changing_output

OWN = (Threshold(1.0, 30.0), Threshold(1.0, 12.0), Threshold(1.0, 80.0))
PLANT = plant_with(0.0, memory=100)
MODEL, SETTINGS = AXIS = MonitoredAxis(PLANT.model, replace(PLANT.settings, thresholds=OWN))
FAULTS = [InjectedFault("kT", 0.3), InjectedFault("kT", -0.3), InjectedFault("1/Ja", 0.3), InjectedFault("fm", 0.6)]


@pytest.fixture(scope="module")
def healthy(seed: int) -> SampleBlock:
    """A record without a false alarm: with thresholds as low as these some have one."""
    records = (record(PLANT, seed + k, 6000) for k in range(20))
    return next(candidate for candidate in records if not AxisMonitor(MODEL, SETTINGS).update(candidate))


def test_faults_are_found_and_named(healthy: SampleBlock) -> None:
    found, onsets = run_trials(AXIS, healthy, FAULTS, 20, 6.0)
    assert onsets == 20
    for caught in found:
        print(caught.fault, caught.exact, caught.delay(0.5), caught.delay(0.9), caught.first)
        right = [n == caught.fault.parameter for n in caught.first]
        assert caught.found_within(6.0) > 0.9
        assert np.mean(right) > 0.8
        directions = {d for d, good in zip(caught.direction, right, strict=True) if good}
        assert directions == {"up" if caught.fault.size > 0 else "down"}
        assert 0.1 < caught.delay(0.5) <= caught.delay(0.9) < 6.0
    assert [caught.exact for caught in found] == [True, True, False, True]


def test_it_is_the_same_as_the_whole_record_with_the_fault_in_it(healthy: SampleBlock) -> None:
    """To the sample: the state is restored at the onset, the rest is the monitor's own."""
    (found,), onsets = run_trials(AXIS, healthy, FAULTS[:1], 2, 6.0)
    assert onsets == 2
    at = len(healthy.t_us) - round(6.0 / INTERVAL_S) - 1
    load = equivalent_load(MODEL, changed_values(MODEL, "kT", 0.3))
    assert load is not None
    u = healthy.u.copy()
    u[at:] = faulty_torque(AXIS, healthy, load)[at:]
    changes = AxisMonitor(MODEL, SETTINGS).update(SampleBlock(healthy.t_us, u, healthy.y))
    (first,) = [c.alarm.raised_us for c in changes if c.alarm.raised_us > healthy.t_us[at]][:1]
    assert (first - int(healthy.t_us[at])) * 1e-6 + INTERVAL_S == pytest.approx(found.delay_s[-1], abs=1e-9)


def test_without_a_fault_nothing_is_found(healthy: SampleBlock) -> None:
    found, _ = run_trials(AXIS, healthy, [InjectedFault("fm", 1e-9), InjectedFault("1/Ja", 1e-9)], 10, 6.0)
    assert all(caught.found_within(6.0) == 0.0 for caught in found)
    assert all(caught.delay(0.5) == np.inf for caught in found)


def test_a_change_that_is_not_found_is_tried_at_few_onsets(
    healthy: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the multi-model detector with thresholds that nothing reaches; smaller changes are not tried."""
    hypotheses = default_hypotheses(MODEL, SETTINGS)
    never = tuple(HypothesisThreshold(h.cause, h.size, 1e9, 0.0, h.alike) for h in hypotheses)
    samples, run = list[int](), HypothesisBank.run

    def counted(bank: HypothesisBank, block: SampleBlock) -> list[Event]:
        samples.append(block.size)
        return run(bank, block)

    monkeypatch.setattr(HypothesisBank, "run", counted)
    faults = [InjectedFault("kT", size) for size in (0.1, 0.3, -0.1)]
    found, onsets = run_trials(AXIS, healthy, faults, 3 * PROBES, 0.5, MultiModelThresholds(1.0, never))
    assert onsets == 3 * PROBES
    assert [caught.fault for caught in found] == faults
    assert all(np.isinf(caught.delay_s).all() and len(caught.delay_s) == onsets for caught in found)
    watched = sum(samples) - (len(healthy.t_us) - round(0.5 / INTERVAL_S) - 1)
    assert watched == 2 * PROBES * round(0.5 / INTERVAL_S)


def test_a_record_that_is_too_short(healthy: SampleBlock) -> None:
    with pytest.raises(ValueError, match="too short"):
        run_trials(AXIS, healthy.select(slice(0, 1500)), FAULTS, 5, 6.0)


def test_the_simulated_plant_is_the_model(seed: int) -> None:
    """In innovations form, with the record's own innovations, it measures the very record."""
    block = record(PLANT, seed, 1500)
    found = innovations(AXIS, block, (300,))
    plants, zero = Plants(AXIS, [MODEL.nominal]), np.zeros(1, np.int64)
    before = block.u[299:300]
    _, x = plants.run(zero, found.x, block.u[298:299], before[np.newaxis], np.zeros((1, 1)))
    y, _ = plants.run(zero, x, before, block.u[300:, np.newaxis], found.eps[300:, np.newaxis])
    assert np.abs(y[:, 0] - block.y[300:]).max() < 1e-9 * np.abs(block.y).max()


def test_innovations_do_not_depend_on_where_the_record_is_cut(seed: int) -> None:
    """A long record is run in parts."""
    block = record(PLANT, seed, 12_000)
    found, split = (innovations(AXIS, block, range(300, 12_000, step)) for step in (11_000, 700))
    np.testing.assert_array_equal(found.eps, split.eps)
    assert found.eps.shape == (12_000,)
    np.testing.assert_array_equal(found.x[0], split.x[0])


def test_a_simulated_fault_does_not_depend_on_the_parts(healthy: SampleBlock, monkeypatch: pytest.MonkeyPatch) -> None:
    """The outputs after each onset are simulated in parts; the torque acts late, into the next one."""
    late = MonitoredAxis(MODEL, replace(SETTINGS, delay_s=0.4 * INTERVAL_S))
    fault, at = [InjectedFault("1/Ja", 0.3)], np.array([3000, 4000])

    def outputs() -> Floats:
        ((_, load, _, y),) = inject(late, healthy, fault, at, 1000)
        assert load is None
        assert y is not None
        return y

    at_once = outputs()
    monkeypatch.setattr(injection, "CHUNK", 70)
    np.testing.assert_array_equal(outputs(), at_once)
    assert abs(at_once - np.stack([healthy.y[k : k + 1000] for k in at], axis=1)).max() > 0


@pytest.mark.parametrize(("delay_s", "within"), [(0.0, 1e-4), (0.002, 0.06)])
@pytest.mark.parametrize("output", ["speed", "angle"])
def test_the_monitor_finds_the_innovations_of_simulated_plants_again(
    output: Output, delay_s: float, within: float, seed: int
) -> None:
    """Several side by side, with Coulomb friction and an offset.

    A torque that acts late is the mean of both in the plant.
    """
    case = Case("plant", output, ("kT", "fm"), delay_s=delay_s)
    axis, rng = MonitoredAxis(case.model, case.settings()), np.random.default_rng(seed)
    N, W = 1200, 3
    k = np.arange(N)
    u = 2.0 * np.sin(k / 40) * np.sin(k / 170) + 0.3 * rng.standard_normal(N)
    eps = np.sqrt(axis.settings.lam0) * rng.standard_normal((N, W))
    start = np.zeros((W, len(axis.model.drive.states)))
    y, _ = Plants(axis, [axis.model.nominal]).run(
        np.zeros(W, np.int64), start, np.zeros(W), np.repeat(u[:, np.newaxis], W, axis=1), eps
    )
    for a in range(W):
        found = innovations(axis, SampleBlock(5000 * k, u, np.ascontiguousarray(y[:, a])), (N // 2,)).eps
        apart = (found - eps[:, a])[-N // 4 :] / np.sqrt(axis.settings.lam0)
        assert np.sqrt(np.mean(apart**2)) < within


def test_the_simulated_fault_is_the_plant_with_the_fault(seed: int) -> None:
    """Without noise, against the simulation of a drive whose inertia changes."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((600, 1))
    faulty = changed_values(MODEL, "1/Ja", 0.5)
    expected = changing_output(MODEL.drive, ((MODEL.nominal, u[:300]), (faulty, u[300:])))
    plants = Plants(AXIS, [MODEL.nominal, faulty])
    y0, state = plants.run(np.zeros(1, np.int64), np.zeros((1, 5)), np.zeros(1), u[:300], np.zeros((300, 1)))
    y1, _ = plants.run(np.ones(1, np.int64), state, u[299], u[300:], np.zeros((300, 1)))
    assert np.concatenate([y0, y1]) == pytest.approx(expected, abs=1e-10)
